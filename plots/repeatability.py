#!/usr/bin/python3
"""How far pictures of one seed lie apart because threads share a cache, beside how far they are from the truth."""
import sys
from functools import partial

import style  # first: it checks what is installed

import pandas as pd
from matplotlib.lines import Line2D

from figure import Built, Figure, Omitted, Panel, Plate, main
from intervals import interval_note
from pareto_results import Measured
from repeatability_results import about, groups, kFiles, load, points

kColours = (style.kBlue, style.kVermilion, style.kGreen, style.kPurple, style.kOrange, style.kSky)
kDrawn = {"rms_to_single_share_of_mean": True, "rms_to_last_run_share_of_mean": False}  # filled or hollow
kErrorColour = "#6b6b6b"


def _draw(axes, layout: style.Layout, part: pd.DataFrame, counts: list[int]) -> None:
    caches = [c for c in style.cache_order(part["cache"]) if _differs(part[part["cache"] == c])][::-1]
    place = {cache: i for i, cache in enumerate(caches)}
    values = []
    for number, threads in enumerate(counts):
        colour = kColours[number % len(kColours)]
        shift = 0.0 if len(counts) == 1 else 0.46 * (0.5 - number / (len(counts) - 1))
        mine = part[(part["threads"] == threads) & part["cache"].isin(caches)]
        for name, is_filled in kDrawn.items():
            if name not in mine:
                continue
            shown = mine[mine[name] > 0]
            below = 0.0 if is_filled else 0.11  # so that intervals do not cover each other
            y = [place[cache] + shift - below for cache in shown["cache"]]
            axes.plot(100 * shown[name], y, linestyle="none", marker="o", markersize=layout.marker,
                      color=colour, markerfacecolor=colour if is_filled else "white", markeredgewidth=0.9,
                      zorder=3 if is_filled else 2.5)
            known = shown[shown[f"{name}_low"].notna()]
            axes.hlines([place[cache] + shift - below for cache in known["cache"]], 100 * known[f"{name}_low"],
                        100 * known[f"{name}_high"], color=colour, linewidth=layout.line * 0.7, zorder=2)
            values += [*(100 * shown[name])]
    own = 100 * (part["error"] / part["mean"]).median()
    floor = 100 * (part["reference_rmse"] / part["mean"]).median() if "reference_rmse" in part else 0.0
    for value, line in (own, style.kSolid), (floor, style.kDotted):
        if value > 0:
            axes.axvline(value, color=kErrorColour, linewidth=layout.line, linestyle=line, zorder=1)
            values.append(value)
    style.log_axis(axes.xaxis, values, most=5 if layout.small else 8)
    axes.set_ylim(-0.6, len(caches) - 0.4)
    axes.set_yticks(range(len(caches)), [cache.replace("_", " ") for cache in caches])


def _differs(part: pd.DataFrame) -> bool:
    return bool((part["rms_to_single"] > 0).any())


def _handles(counts: list[int], has_runs: bool, layout: style.Layout) -> list:
    made = []
    for number, threads in enumerate(counts):
        made.append(Line2D([], [], linestyle="none", marker="o", markersize=layout.marker,
                           color=kColours[number % len(kColours)], label=style.threads_text(threads)))
    if has_runs:
        made.append(Line2D([], [], linestyle="none", marker="o", markersize=layout.marker, color=kErrorColour,
                           markerfacecolor="white", label="hollow: from run to run"))
    made.append(Line2D([], [], color=kErrorColour, linewidth=layout.line, label="error of the pictures"))
    made.append(Line2D([], [], color=kErrorColour, linewidth=layout.line, linestyle=style.kDotted,
                       label="reference's own error"))
    return made


def build(measured: Measured) -> Built:
    table = points(measured)
    counts = sorted(table.loc[table["threads"] > 1, "threads"].unique())
    panels, most, same = [], 0, set()
    for name, part in groups(table):
        shared = part[part["threads"] > 1]
        differing = [c for c in shared["cache"].unique() if _differs(shared[shared["cache"] == c])]
        same |= set(shared["cache"]) - set(differing)
        if differing:
            panels.append(Panel(name, partial(_draw, part=shared, counts=counts), about(part)))
            most = max(most, len(differing))
    if not panels:
        raise Omitted("no picture of several threads differs from that of one")
    foot = "Filled: from the picture of one thread through the same cache."
    if same:
        foot += f" No difference at all: {', '.join(style.cache_order(same)).replace('_', ' ')}."
    foot += f" {interval_note(table.loc[table['threads'] > 1, 'n'])}"
    has_runs = "rms_to_last_run" in table and bool((table["rms_to_last_run"] > 0).any())
    height = 0.2 * most + 0.3
    return Built(table, [Plate("", "Differences between pictures of one seed", panels,
                               partial(_handles, counts, has_runs), "RMS difference, % of the picture's mean", "",
                               foot, (1, 1), (height, 0.75 * height), (1.55, 1.1))])


FIGURE = Figure(
    "repeatability", "The error that threads add",
    "Each line is a cache, each point an RMS difference between pictures of one seed at identical primary hits: "
    "filled, from the picture that one thread makes; hollow, from one run to the next on as many threads. The vertical "
    "line is how far the pictures are from the truth. Points far to the left of it: what threads add does not matter.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, kFiles))
