"""The report's part on single trials, as timelines."""
from __future__ import annotations

from tables import text
from timeline_results import Timeline

kTitle = "Timelines"


def section(timeline: Timeline, anchor: str, figures: str) -> str:
    """The page. `figures`: their HTML."""
    return (f'<h2 id="{anchor}">Timeline: {text(timeline.label.removeprefix("sweep/"))}</h2>{figures}'
            f'<p class="note">From <code>{text(timeline.path.name)}</code>, one trial, every operation of which was '
            "timed.</p>")
