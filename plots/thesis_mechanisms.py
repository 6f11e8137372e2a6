#!/usr/bin/python3
"""Chapter 7's experiment: speed of the three mechanisms over threads, on every still and animation."""
import sys
from functools import partial

import style  # first: it checks what is installed

import pandas as pd
from matplotlib.lines import Line2D

from figure import Built, Figure, Omitted, Panel, Plate, main
from over_threads import thread_axis
from thesis_results import kFiles, kMechanisms, Measured, load

kWhats = {
    "still": "Stills: irradiance caching, each record from a hemisphere of rays",
    "ic": "Animations: instant caching, the cache cleared after each frame",
    "tic": "Animations: temporal instant caching, records live on"
}


def _draw(part: pd.DataFrame, axes, layout) -> None:
    for cache, line in part.groupby("cache", sort=False):
        line = line.sort_values("threads")
        options = style.line_options(cache, layout)
        axes.plot(line["threads"], line["median"], zorder=3, **options)
        known = line[line["low"].notna()]
        axes.vlines(known["threads"], known["low"], known["high"], color=options["color"],
                    linewidth=layout.line * 0.8)
    axes.axhline(1, color="#555555", linewidth=0.6, zorder=1.5)
    thread_axis(axes, part["threads"].unique(), layout)
    style.log_axis(axes.yaxis, part[["median", "low", "high"]].to_numpy().ravel())


def _handles(measured: Measured, layout) -> list:
    return [
        Line2D([], [],
               **style.line_options(cache, layout) | {"label": f"{measured.title(name)} ({cache})"})
        for name, cache in kMechanisms.items()
    ]


def build(measured: Measured) -> Built:
    rows = [{"scene": name, "what": what, "cache": row["cache"], "threads": row["threads"], **row["speedup"]}
            for name, scene in measured.scenes.items() for what, table in scene["mechanisms"].items()
            for row in table["rows"] if row["speedup"]]
    if not rows:
        raise Omitted("no mechanism was timed")
    table = pd.DataFrame(rows)
    table[["low", "high"]] = table[["low", "high"]].astype(float)
    plates = []
    for what, heading in kWhats.items():
        mine = table[table["what"] == what]
        panels = []
        for name, part in mine.groupby("scene", sort=False):
            base = measured.scenes[name]["mechanisms"][what]["base"]["frames_per_second"]
            panels.append(
                Panel(measured.scenes[name]["title"], partial(_draw, part),
                      f"1 = {style.number(base['median'])} frames/s"))
        if panels:
            plates.append(
                Plate(
                    what, heading, panels, partial(_handles, measured), "threads", "speed-up",
                    footnote="1 is the same structure without synchronisation on one thread. Medians and "
                    "intervals of ratios paired by round.", columns=(4, 2), heights=(1.2, 0.95)))
    return Built(table, plates)


FIGURE = Figure(
    "thesis_mechanisms", "Lock, local copies and wait-free over threads",
    "How many times faster a picture is made than by one thread on the same structure without any "
    "synchronisation; the absolute speed of that base stands under each title. All three mechanisms use "
    "one structure, so a difference between lines is a difference between mechanisms. Thread counts above "
    "the machine's processing units share them.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, kFiles))
