"""The report's part on where time goes, of a sweep that accounted for it."""
from __future__ import annotations

from results import Setup
from tables import text

kTitle = "Where the time goes"


def section(setup: Setup, anchor: str, figures: str, is_one_of_many: bool) -> str:
    """The page. `figures`: their HTML."""
    machine = f": {text(setup.label)}" if is_one_of_many else ""
    files = ", ".join(f"<code>{text(path.name)}</code>" for path in setup.paths)
    return (f'<h2 id="{anchor}">{kTitle}{machine}</h2>{figures}'
            f'<p class="note">From {files}: every operation was timed, which slows small ones; no other number of this '
            "page is from these trials.</p>")
