"""Files that are written whole or not at all."""
from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def write_whole(path: Path, content: bytes | str) -> None:
    """Writes a file beside `path` that then takes its place: what was there stays until all is written. Raises OSError,
    which names `path`.
    """
    scratch = path.with_name(f".{path.name}.scratch")
    try:
        # Names of files may hold bytes that are no characters.
        scratch.write_bytes(content.encode("utf-8", "replace") if isinstance(content, str) else content)
        os.replace(scratch, path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        with suppress(OSError):
            scratch.unlink()
