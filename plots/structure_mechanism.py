#!/usr/bin/python3
"""Structure or mechanism: the throughput of every mechanism on every structure, over one base."""
import math
import sys
from functools import partial

import style  # first: it checks what is installed

import numpy as np
import pandas as pd
from matplotlib.colors import LinearSegmentedColormap

from figure import Built, Figure, Omitted, Panel, Plate, main
from intervals import paired, summarise
from over_threads import cache_rows
from results import Setup, is_lock, is_wait_free

kColours = LinearSegmentedColormap.from_list("slower to faster", ["#F2B183", "#FAFAFA", "#7DB7DF", "#00568A"])
kBase = "global_mutex"  # on the structure that is alphabetically last of those that have it: Ward's
kWorkloads = ("read_only", "mix_90_10", "miss_driven")
kOrdered = {"order=hot_spot", "order=coherent"}
kRecordCost = 1.0       # record cost of the miss-driven workload that is shown, µs, or the next to it
kThreads = 2            # thread counts shown of each workload: all processing units, and the most beyond them


def _workloads(rows: pd.DataFrame) -> list[str]:
    """One of each of kWorkloads, if it was measured."""
    chosen = []
    for kind in kWorkloads:
        names = sorted({w for w in rows["workload"] if w.split(":")[0] == kind and not kOrdered & set(w.split(":"))},
                       key=len)
        if kind == "miss_driven" and names:
            cost = rows[rows["workload"].isin(names)].groupby("workload")["record_cost_us"].first()
            names = [(cost - kRecordCost).abs().idxmin()]
        chosen += names[:1]
    return chosen


def _threads(part: pd.DataFrame) -> list[int]:
    within = part.loc[~part["oversubscribed"].astype(bool), "threads"]
    counts = [within.max()] if len(within) else []
    beyond = part.loc[part["oversubscribed"].astype(bool), "threads"]
    return [int(t) for t in [*counts, *([beyond.max()] if len(beyond) else [])][:kThreads]]


def ratios(setup: Setup) -> pd.DataFrame:
    """One line per workload, placement, threads and cache: throughput over that of the base in the same repetition."""
    rows = cache_rows(setup)
    rows = rows[rows["items_per_second"] > 0]
    structures = sorted(rows.loc[rows["mechanism"] == kBase, "structure"].unique())
    if len(structures) < 2:
        raise Omitted(f"no two structures were measured under {kBase}")
    base = rows[(rows["structure"] == structures[-1]) & (rows["mechanism"] == kBase)]
    shared = rows[rows["structure"].isin(structures) & (rows["mechanism"] != "none")]
    made = []
    for workload in _workloads(base):
        for panel, part in shared[shared["workload"] == workload].groupby("panel"):
            for threads in _threads(part):
                pairs = paired(part[part["threads"] == threads], base[base["panel"] == panel], ["panel", "threads"],
                               "items_per_second")
                made.append(summarise(pairs, ["workload", "panel", "threads", "structure", "mechanism"], "ratio"))
    table = pd.concat(made, ignore_index=True) if made else pd.DataFrame()
    if table.empty:
        raise Omitted("none of its workloads was measured")
    return table.assign(base=base["cache"].iloc[0], base_structure=structures[-1]).drop(columns="spread")


def _draw(axes, layout: style.Layout, part: pd.DataFrame, structures: list[str], mechanisms: list[str],
          span: float) -> None:
    grid = part.pivot(index="mechanism", columns="structure", values="median").reindex(
        index=mechanisms[::-1], columns=structures)
    logs = np.log(grid.to_numpy(float)) / math.log(span)
    axes.imshow(np.ma.masked_invalid(logs), cmap=kColours, vmin=-0.5, vmax=1, aspect="auto", origin="lower",
                interpolation="nearest")
    axes.set_facecolor("#e9e9e9")
    axes.grid(False)
    axes.set_xticks(range(len(structures)), structures)
    axes.set_yticks(range(len(mechanisms)), [m.replace("_", " ") for m in mechanisms[::-1]])
    axes.tick_params(length=0)
    for y in range(logs.shape[0]):
        for x in range(logs.shape[1]):
            if np.isfinite(logs[y, x]):
                axes.text(x, y, style.number(grid.iloc[y, x]), ha="center", va="center", fontsize=layout.font * 0.95,
                          color="white" if logs[y, x] > 0.62 else "#1a1a1a")


def build(setup: Setup) -> Built:
    table = ratios(setup)
    structures = sorted(table["structure"].unique(), key=lambda s: s != table["base_structure"].iloc[0])
    order = style.cache_order(table["mechanism"].unique())
    mechanisms = [m for m in order if is_lock(m)] + [m for m in order if not is_lock(m) and not is_wait_free(m)] + [
        m for m in order if is_wait_free(m)]
    span = max(1.2, float(table["median"].max()))  # not of the slowest: a convoy would bleach all others
    panels = []
    for (title, threads), part in table.groupby(["panel", "threads"], sort=False):
        panels.append(Panel(title, partial(_draw, part=part, structures=structures, mechanisms=mechanisms, span=span),
                            style.threads_text(threads)))
    height = 0.24 * len(mechanisms)
    foot = (f"1 is {table['base'].iloc[0]} in the same panel. Down a column the mechanism changes, along a line the "
            "structure.")
    return Built(table, [Plate("", "Throughput of a mechanism on a structure, over one base", panels, lambda layout: [],
                               "structure", "", foot, (3, 2), (height, height), (1.1, 0.95))])


FIGURE = Figure(
    "structure_mechanism", "Structure or mechanism",
    "The number in a cell is how many times the operations per second of the thesis's lock on the thesis's structure a "
    "cache reaches. Down a column only the mechanism changes: that is what locks cost. Along a line only the structure "
    "changes: that is what it is worth to look for less. A fast structure under a lock may well beat a slow one "
    "without.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE))
