#!/usr/bin/python3
"""Latency percentiles of queries and inserts per cache."""
import sys
from functools import partial

import style  # first: it checks what is installed

import pandas as pd

import percentiles
from figure import Built, Figure, Omitted, Panel, Plate, main
from intervals import interval_note
from over_threads import (cache_handles, cache_rows, groups_of, kGroupKeys, panels_of,
                          thread_marks)
from results import Setup

kPanels = 4  # workloads drawn; each takes a panel per operation and thread count


def long_form(rows: pd.DataFrame) -> pd.DataFrame:
    """One line per repetition, operation and percentile; nanoseconds."""
    return percentiles.long_form(rows, [*kGroupKeys, "placement"])


def build(setup: Setup) -> Built:
    rows = cache_rows(setup)
    tall = long_form(rows)
    if tall.empty:
        raise Omitted("no row has latencies")
    table = percentiles.curves(tall, kGroupKeys)
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
        panels = []  # the scales of one are those of the same operation at the other thread count
        for title in titles:
            for operation in ("query", "insert"):
                part = drawn[(drawn["panel"] == title) & (drawn["operation"] == operation)]
                for threads in marks:
                    one = part[part["threads"] == threads]
                    if not one.empty:
                        panels.append(Panel(title, partial(percentiles.draw, part=one, neighbours=part),
                                            f"{operation}, {style.threads_text(threads)}"))
        if not panels:
            continue
        caches = style.cache_order(drawn["cache"])
        plates.append(Plate(group.slug, group.title, panels,
                            lambda layout, caches=caches: cache_handles(caches, layout),
                            "percentile of operations", "latency",
                            f"{interval_note(drawn['n'])} Markers: the longest of all that were timed.", (4, 2),
                            (1.65, 1.05), (0.46, 0.33)))
    left_out = sorted(set(table["threads"]) - set(marks))
    if left_out:
        notes.append("drawn at all cores and at about four threads a core; the CSV has every thread count")
    return Built(table, plates, notes)


FIGURE = Figure(
    "latency", "Latency of single operations",
    "How long one operation takes: the 50th percentile is the usual case, the 99.9th what one in a thousand "
    "has to bear, the marker the worst one seen. Each further nine takes as much room as the last, and the scale of "
    "latency is logarithmic. Lines that stay low and flat to the right are good; a steep end means that a few "
    "operations wait very long, typically behind a thread that was put to sleep while it held a lock. That shows "
    "most with more threads than processing units.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE))
