#!/usr/bin/python3
"""IGI's visible error against path tracing over the number of VPLs, and the number that was chosen."""
import sys
from functools import partial

import style  # first: it checks what is installed

import pandas as pd
from matplotlib import ticker
from matplotlib.lines import Line2D

from figure import Built, Figure, Omitted, Panel, Plate, main
from thesis_results import kColours, kFiles, Measured, load

kBase = 2


def _draw(part: pd.DataFrame, chosen, axes, layout) -> None:
    for key, name, marker in (("p75", "P > 75 %", "s"), ("p95", "P > 95 %", "o")):
        known = part[part[key].notna()]
        axes.plot(known["vpls"], known[key], color=kColours["igi"], marker=marker, markersize=layout.marker,
                  linewidth=layout.line, markerfacecolor="white" if key == "p95" else kColours["igi"],
                  label=name, zorder=3)
    axes.vlines(part["vpls"], part["p75_low"], part["p75_high"], color=kColours["igi"],
                linewidth=layout.line * 0.8)
    if chosen:
        axes.axvline(chosen, color=style.kBlue, linewidth=layout.line, linestyle=style.kDashed, zorder=2)
    axes.set_xscale("log", base=kBase)
    axes.xaxis.set_major_locator(ticker.FixedLocator(part["vpls"][::2 if len(part) > 5 else 1]))
    axes.xaxis.set_minor_locator(ticker.NullLocator())
    axes.xaxis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
    style.linear_axis(axes.yaxis, part[["p75", "p75_high"]].to_numpy().ravel(), 4)


def _handles(layout) -> list:
    igi = kColours["igi"]
    return [
        Line2D([], [], color=igi, marker="s", markersize=layout.marker, label="IGI, P > 75 %"),
        Line2D([], [], color=igi, marker="o", markersize=layout.marker, markerfacecolor="white",
               label="IGI, P > 95 %"),
        Line2D([], [], color=style.kBlue, linestyle=style.kDashed, label="chosen")
    ]


def build(measured: Measured) -> Built:
    rows = [{"scene": name, **point} for name, scene in measured.scenes.items()
            for point in scene["vpls"]["curve"]]
    if not rows:
        raise Omitted("no scene has a curve over VPL counts")
    table = pd.DataFrame(rows)
    panels = []
    for name, part in table.groupby("scene", sort=False):
        vpls = measured.scenes[name]["vpls"]
        how = f"{vpls['chosen']} VPLs" + ("" if vpls["levelled_off"] else ", not levelled off")
        panels.append(Panel(measured.scenes[name]["title"], partial(_draw, part, vpls["chosen"]), how))
    return Built(table, [
        Plate("all", "Visible error of IGI over the number of VPLs", panels, _handles, "number of VPLs",
              "visible error, %",
              footnote="Last frame. Lines: medians over sets of VPLs; bars: their range.", columns=(4, 2),
              heights=(1.2, 0.95))
    ])


FIGURE = Figure(
    "thesis_vpls", "How many virtual point lights a scene needs",
    "Percent of pixels that a human would tell apart from a path-traced picture (HDR-VDP), for IGI over "
    "the number of virtual point lights. The dashed line is the number chosen for the scene: the smallest "
    "from which on the error stays within a tenth, or 0.1 percentage points, of that at the largest (a tenth of what "
    "it fell by, if that is less: where the reference's own noise holds all errors up). "
    "Direct light is exchanged for that of many samples, so that the noise of area lights does not hide "
    "what VPLs do. The number decides every speed ratio, and is the same for all methods.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, kFiles))
