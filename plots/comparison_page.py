"""The report's part on what differs between runs, one for each pair of runs that are compared."""
from __future__ import annotations

import math

import pandas as pd

import style
from comparison import Comparison, kMetrics, metric_words
from intervals import kConfidence, kFewRepetitions
from tables import interval, note_line, table, text

kTitle = "What differs"
kLines = 15             # cells shown of a metric
kLongest = 60           # characters of a value of the environment
kScales = {"items_per_second": (1e-6, "M operations/s"), "latency_query_p999_ns": (1e-3, "µs")}


def _shown(value: str) -> str:
    return value if len(value) <= kLongest else value[:kLongest] + " …"


def _environment(one: Comparison) -> str:
    lines = [f'<tr><td>{text(key.replace("_", " "))}</td><td class="raw">{text(_shown(a))}</td>'
             f'<td class="raw">{text(_shown(b))}</td></tr>' for key, a, b in one.differing]
    if not lines:
        return ""
    head = f"<th>recorded</th><th>{text(one.names[0])}</th><th>{text(one.names[1])}</th>"
    return f"<details><summary>What was recorded differently</summary>{table(head, lines)}</details>"


def _sentence(cells: pd.DataFrame, value: str) -> str:
    """How many cells differ, and how many would by chance."""
    counts = cells["verdict"].value_counts()
    judged = int((cells["low"].notna() & (cells["n"] >= kFewRepetitions)).sum())
    name = text(style.capital(metric_words(value)))
    if not judged:
        return f"<p>{name}: fewer than {kFewRepetitions} repetitions, too few for a verdict.</p>"
    better, worse = int(counts.get("better", 0)), int(counts.get("worse", 0))
    chance = (1 - kConfidence) * judged
    return (f"<p><b>{name}</b>: of {style.plural(judged, 'cell')}, {better} better and {worse} worse with the whole "
            f"interval; chance alone would make about {style.number(chance, 2)} at most.</p>")


def _cells(one: Comparison, value: str) -> str:
    cells = one.cells[one.cells["metric"] == value]
    if cells.empty:
        return ""
    made = _sentence(cells, value)
    decided = cells[cells["verdict"] != "undecided"].copy()
    if decided.empty:
        return made
    decided["size"] = decided["ratio"].map(lambda r: abs(math.log(r)))
    scale, unit = kScales.get(value, (1.0, ""))
    head = (f'<th>cache</th><th>workload</th><th class="n">threads</th><th class="n">{text(one.names[0])}</th>'
            f'<th class="n">{text(one.names[1])}</th><th class="n">ratio</th>')
    lines = [f'<tr><td>{text(r.cache)}</td><td>{text(r.panel)}</td><td class="n">{r.threads}</td>'
             f'<td class="n">{style.number(r.first * scale)}</td><td class="n">{style.number(r.second * scale)}</td>'
             f'<td class="n {"good" if r.verdict == "better" else "bad"}">{interval(r.ratio, r.low, r.high)}</td></tr>'
             for r in decided.sort_values("size", ascending=False).head(kLines).itertuples()]
    left = len(decided) - len(lines)
    more = f"the {kLines} largest differences{f', in {unit}' if unit else ''}; {left} more are in the CSV" if left > 0 \
        else f"all decided differences{f', in {unit}' if unit else ''}"
    return f"{made}{table(head, lines)}{note_line(more)}"


def section(one: Comparison, figure: str) -> str:
    """`figure`: HTML of the figure, or why there is none."""
    made = f'<h3 id="{one.slug}">{text(one.label)}</h3>'
    how = ("paired by repetition: both runs had the same seed" if one.paired
           else "of medians: the runs had different seeds")
    what = "Two builds on one machine." if one.one_machine else \
        "Two machines: a ratio tells how much faster one is than the other, not which program is better."
    made += f'<p>{what} Every ratio is that of {text(one.names[1])} over {text(one.names[0])}, {how}.</p>'
    if one.first.complete is False or one.second.complete is False:
        made += '<div class="banner">One of the runs was cut short.</div>'
    if any(one.alone):
        made += note_line(f"{one.alone[0]} cells were measured by the first run alone, {one.alone[1]} by the second "
                          "alone")
    made += figure + "".join(_cells(one, value) for value, _, _ in kMetrics if len(one.cells)) + _environment(one)
    return made
