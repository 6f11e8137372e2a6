#!/usr/bin/python3
"""Seconds for the indirect light of every frame, by each method."""
import sys
from functools import partial

import style  # first: it checks what is installed

import pandas as pd
from matplotlib.ticker import MaxNLocator

from figure import Built, Figure, Omitted, Panel, Plate, main
from thesis_results import kFiles, Measured, load, method_handles, method_line

kShown = ("igi", "interleaved", "ic", "tic", "cells")


def _draw(measured: Measured, part: pd.DataFrame, axes, layout) -> None:
    for method, line in part.groupby("method", sort=False):
        options = method_line(measured, method, layout) | {"markersize": layout.marker * 0.8}
        axes.plot(line["frame"] + 1, line["seconds_indirect"], markevery=max(1, len(line) // 8), zorder=3, **options)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    style.log_axis(axes.yaxis, part["seconds_indirect"])


def build(measured: Measured) -> Built:
    rows = [{"scene": name, "method": method, "frame": frame, "seconds_indirect": seconds}
            for name, scene in measured.animations.items() for method in kShown
            for frame, seconds in enumerate(scene["time"]["indirect_per_frame"].get(method) or []) if seconds]
    if not rows:
        raise Omitted("no animation was timed")
    table = pd.DataFrame(rows)
    panels = [
        Panel(measured.scenes[name]["title"], partial(_draw, measured, part),
              f"{measured.scenes[name]['vpls']['chosen']} VPLs")
        for name, part in table.groupby("scene", sort=False)
    ]
    return Built(table, [
        Plate("all", "Indirect light, frame by frame", panels,
              lambda layout: method_handles(measured, kShown, layout), "frame", "seconds",
              footnote="Medians over rounds.")
    ])


FIGURE = Figure(
    "thesis_frame_times", "Indirect light, frame by frame",
    "Seconds that each method takes for the indirect light of every frame. TIC computes everything in the "
    "first frame and "
    "after that only what motion made invalid; the other methods begin anew in every frame.", build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, kFiles))
