"""The report's part on where time goes, of a sweep that accounted for it."""
from __future__ import annotations

import pandas as pd

import style
from intervals import summarise
from over_threads import cache_rows, panels_of, thread_marks
from results import Setup
from tables import interval, note_line, table, text
from time_breakdown import kPanels

kTitle = "Where the time goes"
# Field of what the hardware counted, in words.
kCounters = {"cycles": "cycles", "instructions": "instructions", "cache_misses": "last-level cache misses",
             "l1d_misses": "first-level cache misses", "line_transfers": "lines from another core"}


def counters(setup: Setup) -> str:
    """What the hardware counted of an operation, and why it did not count what is missing."""
    rows = cache_rows(setup)
    told = [context.get("hardware_counters") for context in setup.contexts]
    missing = dict.fromkeys(str(one["note"]) for one in told if isinstance(one, dict) and one.get("note"))
    made = "".join(map(note_line, missing))
    known = [name for name in kCounters if name in rows and pd.to_numeric(rows[name], errors="coerce").notna().any()]
    if not known:
        return made
    operations = rows["queries"].fillna(0) + rows["inserts"].fillna(0)
    rows = rows.assign(**{name: pd.to_numeric(rows[name], errors="coerce") / operations for name in known})
    rows = rows[(operations > 0) & rows[known].notna().any(axis=1)]
    titles, note = panels_of(rows, kPanels)
    counts = sorted({rows["threads"].min(), thread_marks(setup, rows)[0]})
    rows = rows[rows["panel"].isin(titles) & rows["threads"].isin(counts)]
    cells: dict[tuple, dict[str, str]] = {}
    for name in known:
        for one in summarise(rows, ["panel", "cache", "threads"], name).itertuples():
            cells.setdefault((one.panel, one.cache, one.threads), {})[name] = interval(one.median, one.low, one.high)
    order = [(title, cache, threads) for title in titles for cache in style.cache_order(rows["cache"])
             for threads in counts]
    lines = [f'<tr><td>{text(key[0])}</td><td>{text(key[1])}</td><td class="n">{key[2]}</td>'
             + "".join(f'<td class="n">{cells[key].get(name, "–")}</td>' for name in known) + "</tr>"
             for key in order if key in cells]
    head = ('<th>workload</th><th>cache</th><th class="n">threads</th>'
            + "".join(f'<th class="n">{kCounters[name]}</th>' for name in known))
    about = ("Medians over repetitions of what all threads together counted, over queries and inserts; what records "
             "cost to compute, and waiting, is among it")
    return (f'<h3>What the hardware counted, an operation</h3><div class="scroll">{table(head, lines)}</div>'
            f"{note_line(about)}{note_line(note)}{made}")


def section(setup: Setup, anchor: str, figures: str, is_one_of_many: bool) -> str:
    """The page. `figures`: their HTML."""
    machine = f": {text(setup.label)}" if is_one_of_many else ""
    files = ", ".join(f"<code>{text(path.name)}</code>" for path in setup.paths)
    return (f'<h2 id="{anchor}">{kTitle}{machine}</h2>{figures}{counters(setup)}'
            f'<p class="note">From {files}: every operation was timed, which slows small ones; no other number of this '
            "page is from these trials.</p>")
