#!/usr/bin/python3
"""Latency percentiles of queries and inserts per cache."""
import re
import sys

import style  # first: it checks what is installed

import pandas as pd
from matplotlib import ticker

from figure import Built, Figure, Omitted, Panel, Plate, main
from over_threads import (cache_handles, cache_rows, groups_of, interval_note, kGroupKeys, panels_of,
                          thread_marks)
from results import Setup, summarise

kPercentiles = {"p50": "50", "p90": "90", "p99": "99", "p999": "99.9", "max": "max"}
kPanels = 4  # workloads drawn; each takes a panel per operation and thread count


def long_form(rows: pd.DataFrame) -> pd.DataFrame:
    """One line per repetition, operation and percentile; nanoseconds."""
    columns = [c for c in rows if re.fullmatch(r"latency_(query|insert)_(p50|p90|p99|p999|max)_ns", c)]
    if not columns:
        return rows.iloc[:0].assign(latency_ns=[], operation=[], percentile=[])
    keys = [*kGroupKeys, "placement"]
    tall = rows[[*keys, *columns]].melt(keys, var_name="field", value_name="latency_ns")
    tall = tall[tall["latency_ns"] > 0].copy()
    tall[["operation", "percentile"]] = tall.pop("field").str.extract(r"latency_(query|insert)_(\w+)_ns")
    return tall


def build(setup: Setup) -> Built:
    rows = cache_rows(setup)
    tall = long_form(rows)
    if tall.empty:
        raise Omitted("no row has latencies")
    table = summarise(tall, [*kGroupKeys, "operation", "percentile"], "latency_ns")
    full, beyond = thread_marks(setup, tall)
    marks = [m for m in (full, beyond) if m]
    shown = table[table["threads"].isin(marks)]
    if shown.empty:
        raise Omitted(f"no row has latencies at {full} threads")
    notes, plates = [], []
    for group in groups_of(setup, rows[rows["cache"].isin(shown["cache"])]):
        mine = shown[shown["cache"].isin(group.caches)]
        titles, note = panels_of(mine, kPanels)
        if note and note not in notes:
            notes.append(note)
        drawn = mine[mine["panel"].isin(titles)]
        panels = []
        for title in titles:
            for operation in ("query", "insert"):
                part = drawn[(drawn["panel"] == title) & (drawn["operation"] == operation)]
                for threads in marks:
                    one = part[part["threads"] == threads]
                    if not one.empty:
                        name = f"{title}: {operation}, {style.threads_text(threads)}"
                        panels.append(_panel(name, one, part))
        if not panels:
            continue
        caches = style.cache_order(drawn["cache"])
        plates.append(Plate(group.slug, group.title, panels,
                            lambda layout, caches=caches: cache_handles(caches, layout),
                            "percentile of operations", "latency", interval_note(drawn), (4, 2), (1.65, 1.05),
                            (0.46, 0.33)))
    left_out = sorted(set(table["threads"]) - set(marks))
    if left_out:
        notes.append("drawn at all cores and at about four threads a core; the CSV has every thread count")
    return Built(table, plates, notes)


def _panel(title: str, part: pd.DataFrame, neighbours: pd.DataFrame) -> Panel:
    """One panel; its scale is shared with the same operation at the other thread count."""
    places = {p: i for i, p in enumerate(kPercentiles)}

    def draw(axes, layout):
        for cache in style.cache_order(part["cache"]):
            line = part[part["cache"] == cache]
            line = line.assign(x=line["percentile"].map(places)).sort_values("x")
            options = style.line_options(cache, layout)
            axes.plot(line["x"], line["median"], zorder=3, **options)
            known = line[line["low"].notna()]
            axes.vlines(known["x"], known["low"], known["high"], color=options["color"],
                        linewidth=layout.line * 0.8, zorder=2.5)
        axes.set_xlim(-0.3, len(places) - 0.7)
        axes.xaxis.set_major_locator(ticker.FixedLocator(list(places.values())))
        axes.xaxis.set_major_formatter(ticker.FixedFormatter(list(kPercentiles.values())))
        values = neighbours[["median", "low", "high"]].to_numpy().ravel()
        style.log_axis(axes.yaxis, values, lambda value: style.short_duration(value * 1e-9),
                       5 if layout.small else 6)
    return Panel(title, draw)


FIGURE = Figure(
    "latency", "Latency of single operations",
    "How long one operation takes: the 50th percentile is the usual case, the 99.9th what one in a thousand "
    "has to bear, the maximum the worst one seen. The scale is logarithmic. Lines that stay low and flat to "
    "the right are good; a steep end means that a few operations wait very long, typically behind a thread "
    "that was put to sleep while it held a lock. That shows most with more threads than processing units.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE))
