#!/usr/bin/python3
"""What queries at one point read of two structures with the same records in them."""
import math
import sys
from functools import partial

import style  # first: it checks what is installed

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from anatomy_results import examples, kFiles, load, name_of
from figure import Built, Figure, Omitted, Panel, Plate, main
from pareto_results import Measured

kShown = ("wait_free", "packed_wait_free")


def _across(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two directions along the surface."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    u = np.cross(normal, helper)
    u /= np.linalg.norm(u)
    return u, np.cross(normal, u)


def _table(example: dict, part: str) -> pd.DataFrame:
    centre, normal = np.array(example["p"], float), np.array(example["n"], float)
    u, v = _across(normal)
    lines = []
    for record in example["records"]:
        d = np.array(record["p"], float) - centre
        lines.append({"part": part, "x": d @ u, "y": d @ v, "height": d @ normal, "radius": record["radius"],
                      "valid": bool(record["valid"])})
    return pd.DataFrame(lines)


def _draw(axes, layout: style.Layout, table: pd.DataFrame, extent: float, accuracy: float) -> None:
    for valid, colour, order in ((False, style.kGrey, 2), (True, style.kBlue, 3)):
        part = table[table["valid"] == valid]
        axes.plot(part["x"], part["y"], linestyle="none", marker="o", markersize=layout.marker * 0.75, color=colour,
                  markerfacecolor=colour if valid else "white", markeredgewidth=0.8, zorder=order)
        if valid:
            for _, line in part.iterrows():
                axes.add_patch(Circle((line["x"], line["y"]), accuracy * line["radius"], fill=False, color=colour,
                                      linewidth=0.5, alpha=0.5, zorder=1))
    axes.plot([0], [0], linestyle="none", marker="+", markersize=layout.marker * 2.2, color=style.kVermilion,
              markeredgewidth=1.4, zorder=4)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(-extent, extent)
    axes.set_ylim(-extent, extent)
    axes.xaxis.set_major_locator(style.ticker.MaxNLocator(5))
    axes.yaxis.set_major_locator(style.ticker.MaxNLocator(5))


def _handles(layout: style.Layout) -> list:
    dot = dict(linestyle="none", marker="o", markersize=layout.marker * 0.75)
    return [Line2D([], [], linestyle="none", marker="+", markersize=layout.marker * 2, color=style.kVermilion,
                   markeredgewidth=1.4, label="the query"),
            Line2D([], [], color=style.kBlue, label="a valid record, and how far it reaches", **dot),
            Line2D([], [], color=style.kGrey, markerfacecolor="white", label="read in vain", **dot)]


def build(measured: Measured) -> Built:
    found = examples(measured)
    one = found.get("random") or next(iter(found.values()), {})
    parts = [p for p in kShown if p in one]
    if len(parts) < 2:
        raise Omitted("the file does not say what a query reads")
    tables = {part: _table(one[part], part) for part in parts}
    everything = pd.concat(tables.values(), ignore_index=True)
    # Nine in ten: what lies far off on other walls would make the rest too small to see.
    extent = float(np.quantile(np.hypot(everything["x"], everything["y"]), 0.9)) * 1.15 or 1.0
    panels = []
    for part, table in tables.items():
        example, beyond = one[part], int((np.hypot(table["x"], table["y"]) > extent * math.sqrt(2)).sum())
        said = (f"{len(table)} records read, {int(table['valid'].sum())} valid; {example['items']} tested in "
                f"{example['lists']} lists; {example['cache_lines']} cache lines")
        if beyond:
            said += f"; {beyond} lie outside the picture"
        panels.append(Panel(name_of(part), partial(_draw, table=table, extent=extent, accuracy=example["accuracy"]),
                            said))
    foot = ("Seen along the normal of the surface. Chosen is the point whose query reads as many records of Ward's "
            "structure as the median.")
    return Built(everything, [Plate("", "What a query at one point reads", panels, _handles, "metres", "metres", foot,
                                    (2, 1), (3.0, 2.6), (0.5, 0.4))])


FIGURE = Figure(
    "anatomy_map", "What a query reads",
    "Both structures hold the same records, and answer with the same ones: the blue dots, whose circles hold the "
    "query. Hollow dots are records that had to be read only to find that they do not count. Ward's structure knows "
    "only how large a record is and roughly where; the packed one keeps a few bytes of each record in every cell that "
    "it reaches, and so reads little else than what is valid.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, kFiles))
