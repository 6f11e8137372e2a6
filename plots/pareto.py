#!/usr/bin/python3
"""Speed against error of all methods over their parameters, scene by scene."""
import sys
from functools import partial

import style  # first: it checks what is installed

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D

from figure import Built, Figure, Panel, Plate, main
from intervals import interval_note
from pareto_results import kErrors, kFiles, Measured, load, method_order, on_front, points

kDrawn = {"relmse": "Error of the indirect light", "rmse": "The same as a difference of radiance",
          "flip": "What is seen when flipping between pictures",
          "hdrvdp_p75": "Pixels that a human tells apart"}
kFloors = {"relmse": "reference_relmse", "rmse": "reference_rmse"}
kFrontColour = "#c9c2b4"
kFloorColour = "#6b6b6b"


def _drawable(part: pd.DataFrame, error: str) -> pd.Series:
    """The error; of pixels, where it is none, half of one's share: it has to stand somewhere on a logarithmic axis."""
    sized = error.startswith("hdrvdp") and {"width", "height"} <= set(part)
    return part[error].where(part[error] > 0, 50 / (part["width"] * part["height"]) if sized else np.nan)


def _draw(axes, layout: style.Layout, part: pd.DataFrame, error: str) -> None:
    part = part.assign(y=_drawable(part, error))
    part = part[part["y"] > 0]
    floor = part[kFloors[error]].iloc[0] if kFloors.get(error) in part else np.nan
    spans = [f"{error}_low", f"{error}_high"]
    style.log_axis(axes.xaxis, part[["seconds", "seconds_low", "seconds_high"]].to_numpy().ravel(),
                   most=4 if layout.small else 6)
    style.log_axis(axes.yaxis, [*part["y"], *part[spans].to_numpy().ravel(), floor], most=5 if layout.small else 7)
    if floor > 0:
        axes.axhline(floor, color=kFloorColour, linewidth=layout.line * 0.8, linestyle=style.kDashed, zorder=0.6)
    best = part[on_front(part["seconds"], part["y"])].sort_values(["seconds", "y"])
    top, right = axes.get_ylim()[1], axes.get_xlim()[1]
    axes.step([best["seconds"].iloc[0], *best["seconds"], right], [top, *best["y"], best["y"].iloc[-1]],
              where="post", color=kFrontColour, linewidth=layout.line * 3.2, zorder=1, solid_joinstyle="round")
    for method in method_order(part["method"]):
        mine = part[part["method"] == method].sort_values(["seconds", "y"])
        options = style.line_options(method, layout)
        own = mine[on_front(mine["seconds"], mine["y"])]
        rest = mine.drop(own.index)
        axes.plot(rest["seconds"], rest["y"], zorder=2,
                  **(options | {"linestyle": "none", "alpha": 0.35, "markersize": options["markersize"] * 0.6}))
        axes.plot(own["seconds"], own["y"], zorder=3, **options)
        known = own[own[spans[0]].notna() & own["seconds_low"].notna()]
        axes.vlines(known["seconds"], known[spans[0]], known[spans[1]], color=options["color"],
                    linewidth=layout.line * 0.7, zorder=2.5)
        axes.hlines(known["y"], known["seconds_low"], known["seconds_high"], color=options["color"],
                    linewidth=layout.line * 0.7, zorder=2.5)


def _handles(methods: list[str], error: str, has_floor: bool, layout: style.Layout) -> list:
    made = []
    for method in methods:
        line = Line2D([], [], **style.line_options(method, layout))
        line.set_label(method.replace("_", " "))
        made.append(line)
    made.append(Line2D([], [], color=kFrontColour, linewidth=layout.line * 3.2, label="front"))
    if error in kFloors and has_floor:
        made.append(Line2D([], [], color=kFloorColour, linewidth=layout.line * 0.8, linestyle=style.kDashed,
                           label="reference's own error"))
    return made


def build(measured: Measured) -> Built:
    table = points(measured)
    foot = f"Small pale points: settings that another of the same method beats in both. {interval_note(table['n'])}"
    methods = method_order(table["method"])
    plates = []
    for error, title in kDrawn.items():
        if error not in table or not (table[error] > 0).any():
            continue
        panels = [Panel(scene.replace("_", " "), partial(_draw, part=part, error=error), _subtitle(part))
                  for scene, part in table.groupby("scene") if (_drawable(part, error) > 0).any()]
        has_floor = kFloors.get(error) in table
        none = table[table[error] == 0]
        drawn = (_drawable(none, error) > 0).any()
        zero = " An error of 0 is drawn as half a pixel." if drawn else " An error of 0 is not drawn."
        plates.append(Plate(
            error, title, panels, partial(_handles, methods, error, has_floor), "seconds for the indirect light",
            kErrors[error], foot + (zero if len(none) else ""),
            (min(2, len(panels)), 1), (3.4, 2.4), (0.5, 0.4)))
    notes = [] if "path" in methods else ["no path-traced rival was measured"]
    return Built(table, plates, notes)


def _subtitle(part: pd.DataFrame) -> str:
    first = part.iloc[0]
    known = [n for n in ("width", "height", "reference_spp") if n in part and np.isfinite(first[n])]
    if len(known) < 3:
        return ""
    return (f"{int(first['width'])} × {int(first['height'])} pixels, reference of "
            f"{int(first['reference_spp']):,} samples")


FIGURE = Figure(
    "pareto", "Which method for how much time?",
    "Each point is one method with one setting: how long its indirect light took, and how far it is from path tracing "
    "at the very same points of the scene, both axes logarithmic. Left and low is good. A line joins the settings of a "
    "method that make sense, from quick and coarse to slow and fine; the wide pale line is the front, which no other "
    "point beats in both time and error. Below the dashed line an error says nothing: the reference itself is no "
    "better. relMSE weighs every pixel by its own brightness, of pictures scaled to mean luminance 1; RMSE is mostly "
    "that of the brightest pixels. Error of path tracing is noise, and its relMSE falls as its time rises; the methods "
    "that share light start far below, and level off where their bias begins.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, kFiles))
