"""Ctrl-C ends a script with one line and status 130."""
from __future__ import annotations

import os
import signal
import sys
from pathlib import Path


def _end(*_) -> None:
    """At once: processes that draw, for which leaving in good order would wait, end with this one."""
    os.write(2, f"{Path(sys.argv[0]).name}: interrupted\n".encode())
    os._exit(130)


def end_with_a_line() -> None:
    """From now on; not where interrupts are ignored, as in a shell's background, or answered in another way."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)
