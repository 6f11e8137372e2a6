#!/usr/bin/python3
"""Speed-up against threads over one named base per structure and workload."""
import sys

import style  # first: it checks what is installed

import pandas as pd

from figure import Built, Figure, Omitted, main
from intervals import paired, summarise
from over_threads import cache_rows, groups_of, kGroupKeys, line_plates, with_oversubscription
from results import Setup


def base_of(rows: pd.DataFrame) -> tuple[str, int]:
    """(cache, threads) that speed-ups of one structure and workload refer to.

    The plain sequential cache where it was measured, else the fastest cache, at the lowest thread count.
    """
    threads = rows["threads"].min()
    lowest = rows[rows["threads"] == threads]
    plain = sorted(c for c in lowest["cache"].unique() if c.endswith("sequential"))
    return (plain[0] if plain
            else lowest.groupby("cache")["items_per_second"].median().idxmax()), int(threads)


def build(setup: Setup) -> Built:
    rows = cache_rows(setup)
    rows = rows[rows["items_per_second"] > 0]
    if rows.empty:
        raise Omitted("no row has items_per_second")
    if rows["threads"].nunique() < 2:
        raise Omitted("only one thread count was measured, a speed-up needs two")
    tables, captions, left_out = [], {}, 0
    for (structure, panel), part in rows.groupby(["structure", "panel"]):
        if part["threads"].nunique() < 2:
            left_out += 1
            continue
        cache, threads = base_of(part)
        base = part[(part["cache"] == cache) & (part["threads"] == threads)]
        ratios = paired(part, base, [], "items_per_second")
        if ratios.empty:
            left_out += 1
            continue
        absolute = summarise(base, ["cache"], "items_per_second").iloc[0]
        tables.append(summarise(ratios, kGroupKeys, "ratio").assign(
            base_cache=cache, base_threads=threads, base_operations_per_second=absolute["median"],
            base_low=absolute["low"], base_high=absolute["high"]))
        captions[structure, panel] = (f"1 = {cache}, {style.threads_text(threads)}: "
                                      f"{style.number(absolute['median'] * 1e-6)} M op/s")
    if not tables:
        raise Omitted("no workload has repetitions at two thread counts that could be paired")
    table = with_oversubscription(pd.concat(tables, ignore_index=True), rows)

    groups = groups_of(setup, rows, across=rows.groupby("structure")["cache"].nunique().max() == 1)
    plates, notes = line_plates(
        setup, table, groups, "speed-up", logarithmic=True,
        subtitle=lambda panel, part: captions[part["structure"].iloc[0], panel],
        extra=lambda axes: axes.axhline(1, color="#555555", linewidth=0.6, zorder=1.5),
        footnote="Ratios are paired by repetition.")
    if left_out:
        notes.append(f"{style.plural(left_out, 'workload')} of a structure without repetitions at two thread counts that "
                     "could be paired: no speed-up")
    return Built(table, plates, notes)


FIGURE = Figure(
    "speedup", "Speed-up",
    "How many times the throughput of one fixed base is reached. The base is the same for all lines of a "
    "panel and is named in it with its absolute value: the plain sequential cache on one thread where that "
    "was measured, else the fastest cache on one thread. So a cache that is slow from the start cannot look "
    "good by scaling well. The thin horizontal line is the base itself; a cache below it loses to a single "
    "thread.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE))
