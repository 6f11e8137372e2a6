#!/usr/bin/python3
"""Error against seconds, over VPL counts and accuracies, with the point of TIC that the tables use."""
import sys
from functools import partial
from statistics import median

import style  # first: it checks what is installed

import pandas as pd

from figure import Built, Figure, Omitted, Panel, Plate, main
from speed_error import front
from thesis_results import kFiles, Measured, load, method_handles, method_line

kShown = ("igi", "interleaved", "ic", "tic", "cells")


def _draw(measured: Measured, part: pd.DataFrame, target, axes, layout) -> None:
    for method in kShown:
        line = part[part["method"] == method]
        options = method_line(measured, method, layout)
        axes.plot(line["seconds"], line["rmse"],
                  **options | {"linestyle": "none", "alpha": 0.35, "markersize": layout.marker * 0.8})
        best = front(line, "rmse")
        axes.plot(best["seconds"], best["rmse"], zorder=3, **options)
    if target:
        axes.axhline(target["rmse"], color=style.kBlue, linewidth=layout.line * 0.7, linestyle=style.kDotted,
                     zorder=1)
        axes.plot([median(target["seconds"])], [target["rmse"]], marker="o", markersize=layout.marker * 2.4,
                  markerfacecolor="none", markeredgecolor=style.kBlue, linestyle="none", zorder=4)
    style.log_axis(axes.xaxis, part["seconds"], most=5)
    style.log_axis(axes.yaxis, part["rmse"], most=5)


def build(measured: Measured) -> Built:
    rows = [{
        "scene": name, "method": point["method"], "vpls": point["vpls"], "paths": point["paths"],
        "accuracy": point["accuracy"], "seconds": median(point["seconds"]), "rmse": point["rmse"],
        "relmse": point["relmse"], "flicker": point["flicker"]
    } for name, scene in measured.scenes.items() for point in (scene["equal_error"] or {}).get("points", [])
            if point["rmse"] > 0 and min(point["seconds"]) > 0]
    if not rows:
        raise Omitted("no animation has errors against converged IGI")
    table = pd.DataFrame(rows)
    panels = [
        Panel(measured.scenes[name]["title"],
              partial(_draw, measured, part, measured.scenes[name]["equal_error"]["target"]))
        for name, part in table.groupby("scene", sort=False)
    ]
    count = measured.data["settings"]["converged_vpls"]
    return Built(table, [
        Plate(
            "all", "Error against time", panels, lambda layout: method_handles(measured, kShown, layout),
            "seconds a frame for the indirect light", "RMSE, W/(m² sr)",
            footnote=f"Against IGI of {count:,} VPLs, on the last frames; medians over them. "
            "Lines join the points that no other of the same method beats in both.")
    ])


FIGURE = Figure(
    "thesis_equal_error", "Error against time",
    "Every point is a method with a number of VPLs (hash cells: of light paths a pixel) and, for the caching "
    "methods, an accuracy; lower left "
    "is better. The circle is TIC as in all tables. Along the dotted line through it the methods have the "
    "same error: how far to the right a method's line crosses it is TIC's speed-up at equal error. Where a "
    "line ends before it crosses, only a bound is known.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, kFiles))
