#!/usr/bin/python3
"""Contention map: where going without locks pays, over threads and the cost of a record."""
import math
import sys
from functools import partial

import style  # first: it checks what is installed

import numpy as np
import pandas as pd
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from figure import Built, Figure, Omitted, Panel, Plate, main
from intervals import few_note, kMinRepetitions, paired, summarise
from over_threads import cache_rows
from results import Setup, is_lock, is_wait_free, workload_label

kColours = LinearSegmentedColormap.from_list("locks to wait-free",
                                             ["#B04A00", "#F2B183", "#FAFAFA", "#7DB7DF", "#00568A"])
kTopRatio = 4.0  # the colour scale ends here at the latest: one extreme cell must not bleach the others


def _without_cost(workload: str) -> str:
    return ":".join(part for part in workload.split(":") if not part.startswith("cost="))


def ratios(setup: Setup) -> pd.DataFrame:
    """One line per structure, wait-free cache, workload, threads and record cost: the ratio to the best lock.

    Speed is queries answered per second, so that redundant inserts do not count as work. The best lock is the
    one of the highest median speed in that very cell; picking it after the fact favours the locks, never the
    other side.
    """
    rows = cache_rows(setup)
    rows = rows[(rows["workload_kind"] == "miss_driven") & rows["record_cost_us"].notna()].copy()
    if rows.empty:
        raise Omitted("no miss_driven rows with a record cost")
    rows["speed"] = rows["items_per_second"]
    rows = rows[rows["speed"] > 0]
    rows["family"] = rows["workload"].map(_without_cost)
    locked = rows[rows["mechanism"].map(is_lock)]
    free = rows[rows["mechanism"].map(is_wait_free)]
    cell = ["structure", "family", "placement", "threads", "record_cost_us"]
    if locked.empty or free.empty:
        raise Omitted(f"no {'locked' if locked.empty else 'wait-free'} cache ran a miss_driven workload")
    speeds = locked.groupby([*cell, "cache"])["speed"].median().reset_index()
    best = speeds.loc[speeds.groupby(cell)["speed"].idxmax()].rename(columns={"cache": "best_lock",
                                                                              "speed": "best_lock_speed"})
    chosen = locked.merge(best[[*cell, "best_lock"]], on=cell)
    pairs = paired(free, chosen[chosen["cache"] == chosen["best_lock"]], cell, "speed")
    if pairs.empty:
        raise Omitted("no structure has a wait-free and a locked cache at the same threads and record cost")
    table = summarise(pairs, [*cell, "cache"], "ratio").merge(best, on=cell)
    return table.drop(columns="spread")


def break_even(line: pd.DataFrame) -> float | None:
    """The record cost, us, at which the ratio falls through 1 for the last time; None if it never does.

    `line` holds one thread count; between two costs the ratio is taken as straight over log cost.
    """
    line = line.sort_values("record_cost_us")
    costs, values = line["record_cost_us"].to_numpy(float), line["median"].to_numpy(float)
    for i in range(len(values) - 2, -1, -1):
        if values[i] > 1 >= values[i + 1]:
            share = math.log(values[i]) / (math.log(values[i]) - math.log(values[i + 1]))
            if costs[i] <= 0:
                return float(costs[i] + share * (costs[i + 1] - costs[i]))
            return float(costs[i] * (costs[i + 1] / costs[i]) ** share)
    return None


def verdict(row) -> str:
    """"faster", "slower", or "undecided" when the interval holds 1 or there is none."""
    if not math.isfinite(row["low"]):
        return "undecided"
    return "faster" if row["low"] > 1 else "slower" if row["high"] < 1 else "undecided"


def build(setup: Setup) -> Built:
    table = ratios(setup)
    table["verdict"] = [verdict(row) for _, row in table.iterrows()]
    span = min(kTopRatio, max(1.2, float(np.exp(np.abs(np.log(table["median"]))).max())))
    several = table["placement"].nunique() > 1
    panels = []
    keys = ["structure", "cache", "family", "placement"]
    for (structure, cache, family, placement), part in table.groupby(keys):
        words = [f"{cache} over the best lock, {structure.replace('_', ' ')}", workload_label(family)]
        panels.append(Panel(", ".join(words + [placement] * several),
                            partial(_draw, part=part, span=span)))
    few = (table["n"] < kMinRepetitions).sum()
    foot = "Pale, the number in grey: undecided, its 95 % interval holds 1" + (
        f", or there is none, of fewer than {kMinRepetitions} repetitions ({few} of {len(table)} cells)." if few else ".")
    foot = " ".join(filter(None, (foot, few_note(table["n"]))))
    high, wide = table["threads"].nunique(), table["record_cost_us"].nunique()
    columns = (3 if wide <= 4 else 2, 1)
    heights = (max(0.9, 0.34 * high), max(0.7, 0.27 * high))
    title = f"speed of wait-free over the best locked cache (colours end at {style.number(span, 2)}×)"
    plate = Plate("map", title, panels, lambda layout: _handles(), "cost of a record, µs", "threads", foot,
                  columns, heights, (0.34, 0.24))
    return Built(table, [plate])


def _handles() -> list:
    return [Patch(facecolor=kColours(0.9), label="wait-free faster"),
            Patch(facecolor=kColours(0.1), label="best lock faster"),
            Line2D([], [], color="black", linewidth=1.2, label="break-even")]


def _draw(axes, layout: style.Layout, part: pd.DataFrame, span: float) -> None:
    grid = part.pivot(index="threads", columns="record_cost_us", values="median")
    grid = grid.sort_index(axis=0).sort_index(axis=1)
    logs = np.log(grid.to_numpy(float)) / math.log(span)
    axes.imshow(np.ma.masked_invalid(logs), cmap=kColours, vmin=-1, vmax=1, aspect="auto", origin="lower",
                interpolation="nearest")
    axes.set_facecolor("#e9e9e9")
    axes.grid(False)
    axes.set_xticks(range(grid.shape[1]), [style.number_tick(c) for c in grid.columns])
    axes.set_yticks(range(grid.shape[0]), [style.thread_label(t) for t in grid.index])
    axes.tick_params(length=0)
    inches = axes.get_position().width * axes.figure.get_figwidth() / grid.shape[1]
    name_size = min(layout.font * 0.78, inches * 72 / 4.0)
    columns = {cost: i for i, cost in enumerate(grid.columns)}
    rows = {threads: i for i, threads in enumerate(grid.index)}
    for _, cell in part.iterrows():
        x, y = columns[cell["record_cost_us"]], rows[cell["threads"]]
        undecided = cell["verdict"] == "undecided"
        if undecided:
            axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor="white", alpha=0.7, linewidth=0))
        strong = abs(math.log(cell["median"])) / math.log(span) > 0.62
        ink = "#6a6a6a" if undecided else "white" if strong else "#1a1a1a"
        axes.text(x, y + 0.06, style.number(cell["median"]), ha="center", va="bottom", color=ink,
                  fontsize=min(layout.font * 0.95, inches * 72 / 2.8),
                  fontweight="normal" if undecided else "bold")
        axes.text(x, y - 0.06, style.short_name(cell["best_lock"]), ha="center", va="top", color=ink,
                  fontsize=name_size)
    _draw_break_even(axes, logs)


def _draw_break_even(axes, logs: np.ndarray) -> None:
    """The line at ratio 1 along the edges of the cells, where two neighbours lie on different sides of it."""
    above = logs > 0
    known = np.isfinite(logs)
    rows, columns = logs.shape
    for y in range(rows):
        for x in range(columns):
            if x + 1 < columns and known[y, x] and known[y, x + 1] and above[y, x] != above[y, x + 1]:
                axes.plot([x + 0.5, x + 0.5], [y - 0.5, y + 0.5], color="black", linewidth=1.2, zorder=4)
            if y + 1 < rows and known[y, x] and known[y + 1, x] and above[y, x] != above[y + 1, x]:
                axes.plot([x - 0.5, x + 0.5], [y + 0.5, y + 0.5], color="black", linewidth=1.2, zorder=4)
    axes.set_xlim(-0.5, columns - 0.5)
    axes.set_ylim(-0.5, rows - 0.5)


FIGURE = Figure(
    "contention_map", "Contention map: where wait-free access pays",
    "Threads upwards, the cost of computing one record to the right. The number in a cell says how many "
    "times faster the wait-free cache answers queries than the best locked cache on the same structure, and "
    "below it stands which lock that was. Blue: wait-free is faster; orange: the lock is. The black line is "
    "break-even, at a ratio of 1. The dearer a record is, the less time the threads spend in the cache at "
    "all, and the closer the two come. Real records cost from a few microseconds (few rays) to milliseconds "
    "(a film's).",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE))
