#!/usr/bin/python3
"""What a query costs in one structure after another, each with one thing more than the last."""
import sys
from functools import partial

import style  # first: it checks what is installed

import pandas as pd
from matplotlib import ticker

from anatomy_results import kFiles, kPoints, load, name_of, points
from figure import Built, Figure, Panel, Plate, main
from intervals import interval_note
from pareto_results import Measured

kColours = {"wait_free": style.kVermilion, "replicated": style.kOrange, "packed_scalar": style.kSky,
            "packed_wait_free": style.kBlue, "packed_batch": style.kBlue}


def _draw(axes, layout: style.Layout, part: pd.DataFrame) -> None:
    base = part.iloc[0]["ns"]
    for y, (_, line) in enumerate(part.iloc[::-1].iterrows()):
        is_bound = line["part"] not in kColours
        axes.barh(y, line["ns"], height=0.66, color="white" if is_bound else kColours[line["part"]],
                  edgecolor=style.kGrey if is_bound else "none", hatch="////" if is_bound else None, linewidth=0.8,
                  zorder=2)
        if pd.notna(line["ns_low"]):
            axes.hlines(y, line["ns_low"], line["ns_high"], color="black", linewidth=layout.line * 0.8, zorder=3)
        said = f"{style.number(line['ns'])} ns"
        if line["ns"] != base:
            said += f" ({style.number(base / line['ns'])}×)"
        end = line["ns_high"] if pd.notna(line["ns_high"]) else line["ns"]
        axes.text(end + 0.02 * base, y, said, va="center", fontsize=layout.font * 0.92)
    axes.set_yticks(range(len(part)), [name_of(p) for p in part["part"].iloc[::-1]])
    axes.set_ylim(-0.6, len(part) - 0.4)
    axes.set_xlim(0, 1.45 * max(part["ns"].max(), part["ns_high"].max()))
    axes.xaxis.set_major_locator(ticker.MaxNLocator(4))
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)


def build(measured: Measured) -> Built:
    table = points(measured)
    panels = [Panel(kPoints.get(name, name), partial(_draw, part=part))
              for name, part in table.groupby("points", sort=False)]
    records = int(table["records"].max())
    height = 0.27 * table["part"].nunique() + 0.2
    foot = (f"One thread, {records:,} records, read-only. In brackets: how many times as fast as the first. Hatched: "
            f"what bounds a query, no caches. {interval_note(table['n'])}")
    return Built(table, [Plate("", "Time of one query", panels, lambda layout: [], "nanoseconds", "", foot, (2, 1),
                               (height, height), (1.3, 1.1))])


FIGURE = Figure(
    "anatomy_time", "Where the time of a query goes",
    "Every bar is the time of one query on one thread; from bar to bar one thing changes. The first is the structure "
    "of the thesis, the blue ones are the packed octree's. The hatched bars are no caches, but what bounds one: a "
    "structure that can no longer change, and a query that is told beforehand which records are valid.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, kFiles))
