#!/usr/bin/python3
"""Steps of an operation against the operations that interfere with it."""
import math
import sys

import style  # first: it checks what is installed

import pandas as pd
from matplotlib import ticker

from correctness import bound_of, Correctness, load
from figure import Built, Figure, Omitted, Panel, Plate, main
from over_threads import cache_handles


def build(c: Correctness) -> Built:
    if c.progress is None:
        raise Omitted("the file says nothing about progress")
    table = pd.DataFrame([{"cache": p["cache"], "operation": p["operation"], "declared": p["declared"],
                           "bound": bound_of(p)[0], "interfering_operations": n, "steps": steps}
                          for p in c.progress for n, steps in p["steps_by_interference"]])
    if table.empty:
        raise Omitted("no steps were counted against interference")
    panels = []
    for operation, part in table.groupby("operation", sort=False):
        panels.append(Panel(str(operation), lambda axes, layout, part=part: _draw(axes, layout, part)))
    caches = style.cache_order(table["cache"])
    plate = Plate("steps", "steps of one operation", panels, lambda layout: cache_handles(caches, layout),
                  "operations of other threads in between", "atomic steps",
                  "Dashed: the bound that the cache documents." if table["bound"].notna().any() else "",
                  (2, 2), (1.7, 1.2), (0.42, 0.3))
    return Built(table, [plate])


def _draw(axes, layout, part: pd.DataFrame) -> None:
    counts = sorted(part["interfering_operations"].unique())
    axes.set_xscale("symlog", base=2, linthresh=1)
    axes.set_xlim(counts[0] - 0.2, counts[-1] * 1.2 + 0.2)
    shown = counts if len(counts) <= 7 else counts[::math.ceil(len(counts) / 6)]
    axes.xaxis.set_major_locator(ticker.FixedLocator(shown))
    axes.xaxis.set_minor_locator(ticker.NullLocator())
    axes.xaxis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
    bounds = pd.to_numeric(part["bound"], errors="coerce").dropna()
    style.log_axis(axes.yaxis, [*part["steps"].clip(lower=1), *bounds], most=5 if layout.small else 6)
    for cache in style.cache_order(part["cache"]):
        line = part[part["cache"] == cache].sort_values("interfering_operations")
        options = style.line_options(cache, layout)
        axes.plot(line["interfering_operations"], line["steps"].clip(lower=1), zorder=3, **options)
        bound = pd.to_numeric(line["bound"], errors="coerce").dropna()
        if not bound.empty:
            axes.axhline(bound.iloc[0], color=options["color"], linestyle=style.kDashed,
                         linewidth=layout.line * 0.7, zorder=2)


FIGURE = Figure(
    "steps", "Steps against interference",
    "How many atomic steps one operation takes when other threads complete ever more operations in between, "
    "under a schedule that is out to delay it. A wait-free operation stays below its dashed bound: an insert "
    "takes as long as ever, a query at most grows with the records that were there when it read the length of a "
    "list. A line that climbs without a bound is lock-free at best. Both axes are logarithmic.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, "JSON of icstress"))
