#!/usr/bin/python3
"""Parallel efficiency against threads: how much of each added thread arrives."""
import sys

from figure import Built, Figure, Omitted, main
from intervals import paired, summarise
from over_threads import cache_rows, groups_of, kGroupKeys, line_plates, with_oversubscription
from results import Setup


def build(setup: Setup) -> Built:
    rows = cache_rows(setup)
    rows = rows[rows["items_per_second"] > 0].copy()
    if rows.empty:
        raise Omitted("no row has items_per_second")
    keys = ["cache", "panel"]
    rows["base_threads"] = rows.groupby(keys)["threads"].transform("min")
    several = rows.groupby(keys)["threads"].transform("nunique") > 1
    rows = rows[several]
    if rows.empty:
        raise Omitted("only one thread count was measured, an efficiency needs two")
    units = setup.processing_units
    usable = rows["threads"].clip(upper=units) if units else rows["threads"]
    least = rows["base_threads"].clip(upper=units) if units else rows["base_threads"]
    rows["per_unit"] = rows["items_per_second"] / (usable / least)
    base = rows[rows["threads"] == rows["base_threads"]]
    ratios = paired(rows, base, keys, "per_unit")
    if ratios.empty:
        raise Omitted("no repetitions could be paired with those of the lowest thread count")
    table = summarise(ratios, [*kGroupKeys, "base_threads"], "ratio")
    table = with_oversubscription(table, rows)
    plates, notes = line_plates(
        setup, table, groups_of(setup, rows), "parallel efficiency, %", logarithmic=False, scale=100,
        extra=lambda axes: axes.axhline(100, color="#555555", linewidth=0.6, zorder=1.5),
        footnote="Ratios are paired by repetition.")
    bases = sorted(table["base_threads"].unique())
    if bases != [1]:
        notes.append("the base of some caches is not one thread but "
                     f"{', '.join(str(int(b)) for b in bases if b > 1)}")
    return Built(table, plates, notes)


FIGURE = Figure(
    "efficiency", "Parallel efficiency",
    "The throughput of N threads divided by N times that of one thread of the same cache: 100 % means that "
    "every added thread brings its full share. Past the number of processing units the divisor stays at that "
    "number, since no more work can be done at once. Two hardware threads of one core share its units, so a "
    "drop at an SMT boundary is the processor's doing; a drop before it comes from the cache or from memory.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE))
