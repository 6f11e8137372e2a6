"""A lock on a folder that one run at a time writes to."""
from __future__ import annotations

import fcntl
import os
from pathlib import Path


class Taken(Exception):
    """Another run has the lock: one line for the user."""


def lock_folder(folder: Path, option: str) -> int:
    """A lock on a folder for this process, until it ends or closes it. Raises Taken, which names the option that
    chooses another folder, OSError.
    """
    lock = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        raise Taken(f"another run is writing to '{folder}'; wait for it or choose another {option}") from None
    return lock
