"""The report's part on what becomes of all others when a thread is held in the middle of an operation."""
from __future__ import annotations

import style  # first: it checks what is installed

from intervals import few_note, summarise
from pareto_results import Measured
from preemption_results import panel_name
from tables import interval, note_line, table, text

kTitle = "When a thread is held"
kKeys = ["workload", "threads", "hold_ms", "cache", "held"]
# Of the table: field, while a thread is held or while none is.
kColumns = (("stalled_share", True), ("stalled_share", False), ("latency_query_max_ns", True),
            ("latency_query_p999_ns", True), ("others_operations_per_second", True),
            ("others_operations_per_second", False))


def numbers(measured: Measured) -> str:
    """A line for each cache: what the others lose while a thread is held."""
    rows = measured.rows
    fields = {"stalled_share": 100.0, "latency_query_max_ns": 1e-6, "latency_query_p999_ns": 1e-3,
              "others_operations_per_second": 1e-6}
    known = {name: summarise(rows, kKeys, name).set_index(kKeys) for name in fields if name in rows}
    head = ('<th>cache</th><th class="n">others\' time in operations over half a hold, %</th>'
            '<th class="n">the same, nobody held</th><th class="n">longest query, ms</th><th class="n">p99.9 of queries, µs</th>'
            '<th class="n">operations of the others, M/s</th><th class="n">the same, nobody held</th>')
    made = ""
    for (workload, threads, hold), part in rows.groupby(["workload", "threads", "hold_ms"]):
        lines = []
        for cache in style.cache_order(part["cache"]):
            cells = []
            for name, held in kColumns:
                key = (workload, threads, hold, cache, held)
                found = known[name].loc[key] if name in known and key in known[name].index else None
                cells.append("–" if found is None
                             else interval(found["median"], found["low"], found["high"], fields[name]))
            lines.append(f"<tr><td>{text(cache)}</td>" + "".join(f'<td class="n">{c}</td>' for c in cells) + "</tr>")
        made += f"<h3>{text(panel_name(workload, threads, hold).capitalize())}</h3>{table(head, lines, 'wide')}"
    return made


def section(measured: Measured, anchor: str, figures: str) -> str:
    """The page. `figures`: their HTML."""
    made = f'<h2 id="{anchor}">{text(kTitle)}</h2>'
    if not measured.complete:
        made += '<div class="banner">Incomplete: this part shows what was measured until the run was cut short.</div>'
    repetitions = style.plural(int(measured.rows["repetition_index"].nunique()), "repetition")
    few = few_note(measured.rows.groupby(kKeys)["repetition_index"].nunique())
    made += figures + numbers(measured) + note_line(f"Median [low, high] over {repetitions}. {few}".rstrip(". "))
    paths = ", ".join(path.name for path in measured.paths)
    return made + f'<p class="note">From <code>{text(paths)}</code>, measured on {text(measured.label)}.</p>'
