#!/usr/bin/python3
"""Queries under the machine's roofs: instructions a nanosecond against instructions a cache line from memory."""
import sys
from functools import partial

import style  # first: it checks what is installed

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D

from anatomy_results import kFiles, kPoints, load, memory, name_of, points, roofs
from anatomy_time import kColours
from figure import Built, Figure, Omitted, Panel, Plate, main
from pareto_results import Measured

kMarkers = {"wait_free": "o", "replicated": "s", "packed_scalar": "^", "packed_wait_free": "D", "packed_batch": "v",
            "packed_frozen": "P", "told": "X"}
kFewest = 0.01  # lines a query: what never misses is drawn as if it missed so often


def _look(part: str) -> dict:
    colour = kColours.get(part, style.kGrey)
    return {"marker": kMarkers.get(part, "."), "color": colour,
            "markerfacecolor": colour if part in kColours else "white", "linestyle": "none"}


def _draw(axes, layout: style.Layout, part: pd.DataFrame, roof: dict[str, float], latency: float | None,
          span: tuple[float, float]) -> None:
    x = np.geomspace(*span, 200)
    top = roof["instructions_per_ns"]
    axes.plot(x, np.minimum(top, x * roof["lines_per_ns"]), color="black", linewidth=layout.line)
    if latency:
        axes.plot(x, np.minimum(top, x / latency), color=style.kGrey, linewidth=layout.line * 0.8, linestyle="--")
    for _, line in part.iterrows():
        axes.plot(line["intensity"], line["instructions"] / line["ns"], markersize=layout.marker * 1.7,
                  **_look(line["part"]))
    height = (0.5 * (part["instructions"] / part["ns"]).min(), 1.5 * top)
    style.log_axis(axes.xaxis, span)
    style.log_axis(axes.yaxis, height)
    axes.set_xlim(*span)
    axes.set_ylim(*height)


def build(measured: Measured) -> Built:
    table, roof = points(measured), roofs(measured)
    if not roof or not {"instructions", "lines_from_memory"} <= set(table):
        raise Omitted("the file has no instructions; bench/instructions counts them")
    table = table[table["instructions"] > 0].copy()
    table["intensity"] = table["instructions"] / table["lines_from_memory"].clip(lower=kFewest)
    for name in roof:
        table[name] = roof[name]
    blocks = memory(measured)
    latency = float(blocks.iloc[-1]["median"]) if len(blocks) else None
    span = (0.4 * table["intensity"].min(), 2.5 * table["intensity"].max())
    panels = [Panel(kPoints.get(name, name), partial(_draw, part=part, roof=roof, latency=latency, span=span))
              for name, part in table.groupby("points", sort=False)]

    def handles(layout: style.Layout) -> list:
        made = [Line2D([], [], label=name_of(p), markersize=layout.marker * 1.7, **_look(p))
                for p in kMarkers if p in set(table["part"])]
        made.append(Line2D([], [], color="black", linewidth=layout.line, label="the most that one thread gets"))
        if latency:
            made.append(Line2D([], [], color=style.kGrey, linestyle="--", linewidth=layout.line * 0.8,
                               label="one line after the other"))
        return made

    foot = ("Instructions are counted by callgrind, lines from memory in its simulated caches; times and roofs are "
            "measured. To the right: queries that seldom need memory.")
    return Built(table, [Plate("", "Queries under the machine's roofs", panels, handles,
                               "instructions a cache line from memory", "instructions a nanosecond", foot, (2, 1),
                               (2.4, 2.0), (0.45, 0.36))])


FIGURE = Figure(
    "anatomy_roofline", "Queries under the machine's roofs",
    "The black line is the most that one thread of this machine gets: to the left it is bound by the lines that memory "
    "gives, on the flat part by instructions. On the dashed line it waits for every line before it asks for the next. "
    "A mark is a structure: between the two lines it asks for several lines at once; well below both it waits for "
    "something else, such as the result of the instruction before or a branch that was guessed wrong. What is fast has "
    "few instructions, not many of them a nanosecond: the structures do the same work with more or fewer of them.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, kFiles))
