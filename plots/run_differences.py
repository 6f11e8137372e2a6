#!/usr/bin/python3
"""Two runs: by how much every cache's throughput differs, over all workloads that both measured."""
import sys
from functools import partial

import style  # first: it checks what is installed

import numpy as np
import pandas as pd

from comparison import Comparison, cache_names, comparisons, shown_threads
from figure import Built, Figure, Omitted, Panel, Plate, main
from intervals import kFewRepetitions
from results import InputError, load

kMeans = "Geometric means over the workloads that both runs measured"


def build(comparison: Comparison) -> Built:
    table = comparison.overall
    table = table[table["metric"] == "items_per_second"] if len(table) else table
    if table.empty:
        raise Omitted("the runs have no cell in common")
    caches = [c for c in cache_names(comparison) if c in set(table["cache"])]
    values = table[["ratio", "low", "high"]].to_numpy().ravel()
    panels = [Panel(style.threads_text(threads), partial(draw, part=table[table["threads"] == threads], caches=caches,
                                                         values=values)) for threads in shown_threads(comparison)]
    return Built(comparison.cells, [plate_of("all", f"throughput, {comparison.label}", panels, caches, kMeans)])


def plate_of(slug: str, title: str, panels: list[Panel], caches: list[str], what: str) -> Plate:
    """Of panels by `draw`. `what` says what their dots are."""
    height = 0.16 * len(caches) + 0.25
    return Plate(slug, title, panels, lambda layout: [],
                 "ratio of throughput; right of the line the second run is faster", "",
                 f"{what}; bars: 95 % bootstrap intervals. Hollow: undecided, the interval holds 1, or there are fewer "
                 f"than {kFewRepetitions} repetitions.",
                 (3, 1), (height, height * 0.8), (1.5, 1.15))


def draw(axes, layout: style.Layout, part: pd.DataFrame, caches: list[str], values: np.ndarray) -> None:
    """A line a cache: ratio and interval. `values` span the axis."""
    style.log_axis(axes.xaxis, [*values[np.isfinite(values)], 1.0], most=4)
    axes.axvline(1, color="#555555", linewidth=0.8, zorder=1.5)
    for row, cache in enumerate(reversed(caches)):
        for line in part[part["cache"] == cache].itertuples():
            options = style.line_options(cache, layout) | {"linestyle": "none", "marker": "o"}
            if line.verdict == "undecided":
                options["markerfacecolor"] = "white"
            else:
                options["markerfacecolor"] = options["color"]
            if np.isfinite(line.low):
                axes.hlines(row, line.low, line.high, color=options["color"], linewidth=layout.line, zorder=2)
            axes.plot([line.ratio], [row], zorder=3, **options)
    axes.set_yticks(range(len(caches)), list(reversed(caches)))
    axes.set_ylim(-0.6, len(caches) - 0.4)


FIGURE = Figure(
    "run_differences", "What differs between the runs",
    "Each dot is a cache at one thread count: the throughput of the second run over that of the first, as the "
    "geometric mean over all workloads that both measured. Right of the line the second run is faster. A filled dot "
    "is decided: its whole 95 % interval lies on one side, of six repetitions at least.",
    build)


def read(paths) -> list[Comparison]:
    found = comparisons(load(paths))
    if not found:
        raise InputError(f"{', '.join(map(str, paths))}: one machine and build; a comparison needs two")
    return found


if __name__ == "__main__":
    sys.exit(main(FIGURE, read))
