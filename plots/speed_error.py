#!/usr/bin/python3
"""Speed against error: seconds of the indirect pass against relMSE, every method and setting."""
import sys
from functools import partial

import style  # first: it checks what is installed

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from figure import Built, Figure, Omitted, Panel, Plate, main
from intervals import interval_note, summarise
from over_threads import Group, groups_of, kUncached, thread_marks
from results import Setup

kThreadCounts = 3  # thread counts drawn per scene: one, all cores, four a core
kFloor = "#6b6b6b"
kKeys = ["scene", "placement", "structure", "series", "integrator", "cache", "threads", "workload",
         "rays_per_record",
         "accuracy", "spp", "cell_size"]


def points(setup: Setup) -> pd.DataFrame:
    """One line per method and setting: seconds and relMSE with intervals."""
    rows = setup.rows
    rows = rows[(rows["relmse"] > 0) & (rows["seconds_indirect"] > 0)].copy()
    if rows.empty:
        raise Omitted("no row has both relmse and seconds_indirect above zero")
    rows["scene"] = rows["scene"].where(rows["scene"] != "", rows["workload"].str.split(":").str[0])
    plain = rows["integrator"].isin(["", "irradiance_cache"])
    rows["series"] = np.where(rows["integrator"].isin(kUncached), rows["integrator"],
                              np.where(plain, rows["cache"], rows["integrator"] + "/" + rows["cache"]))
    parameters = ["rays_per_record", "accuracy", "spp", "cell_size"]
    rows[parameters] = rows[parameters].fillna(0)
    table = summarise(rows, kKeys, "seconds_indirect").rename(
        columns={"median": "seconds", "low": "seconds_low", "high": "seconds_high"}).drop(columns="spread")
    errors = summarise(rows, kKeys, "relmse").rename(
        columns={"median": "relmse", "low": "relmse_low", "high": "relmse_high"}).drop(columns=["spread",
                                                                                                "n"])
    table = table.merge(errors, on=kKeys)
    floor = rows[rows["reference_relmse"] > 0].groupby("scene")["reference_relmse"].median()
    table["reference_relmse"] = table["scene"].map(floor)
    table[parameters] = table[parameters].replace(0, np.nan)
    return table


def front(table: pd.DataFrame, error: str = "relmse") -> pd.DataFrame:
    """The points that no other point beats in both time and error, by rising time."""
    ordered = table.sort_values(["seconds", error])
    return ordered[ordered[error] < ordered[error].cummin().shift(fill_value=np.inf)]


def build(setup: Setup) -> Built:
    table = points(setup)
    keys = ["scene", "placement", "threads"]
    table["on_front"] = False
    for _, part in table.groupby([*keys, "structure"]):
        rivals = part if part["series"].isin(kUncached).all() else pd.concat([part, _rivals(table, part)])
        table.loc[front(rivals).index.intersection(part.index), "on_front"] = True
    cached = table[~table["series"].isin(kUncached)]
    plates, notes = [], []
    if cached.empty:
        groups = [Group("path", "path tracing alone", [], False)]
    else:
        measured = setup.rows[setup.rows["cache"].isin(cached["cache"]) & (setup.rows["relmse"] > 0)].copy()
        measured["speed"] = 1 / measured["seconds_indirect"]
        groups = groups_of(setup, measured, "speed")
    full, beyond = thread_marks(setup, table)
    marks = sorted({int(table["threads"].min()), full, *([beyond] if beyond else [])})[:kThreadCounts]
    if set(table["threads"]) - set(marks):
        notes.append("drawn at one thread, all cores and about four threads a core; the CSV has every thread "
                     "count")
    if not (table["series"] == "path").any():
        notes.append("no path-traced rival was measured")
    if table["reference_relmse"].isna().any():
        notes.append("the error of the reference itself is not known for every scene, so no floor is drawn "
                     "there")
    several = table["placement"].nunique() > 1
    foot = f"Small pale points are settings that the same method beats elsewhere. {interval_note(table['n'])}"
    for group in groups:
        mine = table[table["cache"].isin(group.caches) | table["series"].isin(kUncached)]
        panels, drawn = [], []
        for (scene, placement), part in mine.groupby(["scene", "placement"]):
            for threads in marks:
                one = part[part["threads"] == threads]
                if group.caches and one["series"].isin(kUncached).all():
                    continue
                title = f"{scene.replace('_', ' ')}{', ' + placement if several else ''}, " \
                        f"{style.threads_text(threads)}"
                panels.append(Panel(title, partial(_draw, part=one, neighbours=part)))
                drawn.append(one)
        if panels:
            names = style.cache_order(pd.concat(drawn)["series"])
            floor = pd.concat(drawn)["reference_relmse"].notna().any()
            plates.append(Plate(group.slug, group.title, panels,
                                lambda layout, names=names, floor=floor: _handles(names, layout, floor),
                                "seconds for the indirect light", "error, relMSE to the reference", foot,
                                (3, 2), (2.1, 1.3), (0.46, 0.34)))
    return Built(table, plates, notes)


def _rivals(table: pd.DataFrame, part: pd.DataFrame) -> pd.DataFrame:
    """Points without a cache of the scene, placement and threads of `part`."""
    first = part.iloc[0]
    return table[table["series"].isin(kUncached) & (table["scene"] == first["scene"])
                 & (table["structure"] != first["structure"])
                 & (table["placement"] == first["placement"]) & (table["threads"] == first["threads"])]


def _handles(names: list[str], layout: style.Layout, floor: bool) -> list:
    made = [Line2D([], [], **style.line_options(name, layout)) for name in names]
    made.append(Line2D([], [], color="#c9c2b4", linewidth=layout.line * 3.2, label="Pareto front"))
    if floor:
        made.append(Patch(facecolor="#eeeeee", edgecolor=kFloor, hatch="////", linewidth=0.6,
                          label="reference's own error"))
    return made


def _draw(axes, layout: style.Layout, part: pd.DataFrame, neighbours: pd.DataFrame) -> None:
    floor = part["reference_relmse"].dropna()
    errors = [*neighbours["relmse"], *neighbours["relmse_low"], *neighbours["relmse_high"], *floor[:1]]
    style.log_axis(axes.xaxis, neighbours[["seconds", "seconds_low", "seconds_high"]].to_numpy().ravel(),
                   most=4 if layout.small else 6)
    style.log_axis(axes.yaxis, errors, most=5 if layout.small else 7)
    low, high = axes.get_ylim()
    if not floor.empty:
        low = low / 1.25
        axes.set_ylim(low, high)
        axes.axhspan(low, floor.iloc[0], facecolor="#eeeeee", edgecolor=kFloor, hatch="////", linewidth=0.0,
                     zorder=0.5)
        axes.axhline(floor.iloc[0], color=kFloor, linewidth=0.8, zorder=0.6)
    best = front(part)
    axes.step([best["seconds"].iloc[0], *best["seconds"], axes.get_xlim()[1]],
              [high, *best["relmse"], best["relmse"].iloc[-1]], where="post", color="#c9c2b4",
              linewidth=layout.line * 3.2, zorder=1, solid_joinstyle="round")
    for name in style.cache_order(part["series"]):
        mine = part[part["series"] == name]
        options = style.line_options(name, layout)
        own = front(mine)
        rest = mine.drop(own.index)
        axes.plot(rest["seconds"], rest["relmse"],
                  **(options | {"linestyle": "none", "alpha": 0.35,
                                "markersize": options["markersize"] * 0.6}), zorder=2)
        axes.plot(own["seconds"], own["relmse"], zorder=3, **options)
        known = own[own["relmse_low"].notna() & own["seconds_low"].notna()]
        axes.vlines(known["seconds"], known["relmse_low"], known["relmse_high"], color=options["color"],
                    linewidth=layout.line * 0.7, zorder=2.5)
        axes.hlines(known["relmse"], known["seconds_low"], known["seconds_high"], color=options["color"],
                    linewidth=layout.line * 0.7, zorder=2.5)


FIGURE = Figure(
    "speed_error", "Speed against error",
    "Each point is one method with one setting: how long it takes to compute the indirect light, and how far "
    "the picture is from a path-traced reference (relMSE, relative mean squared error; both axes "
    "logarithmic). Left and low is good. A line joins the settings of a method that make sense, from quick "
    "and coarse to slow and fine; the wide pale line is the front that nothing in the panel beats. Path "
    "tracing is the rival: where its line runs below, the cache is not worth having. So are hash cells, which share "
    "the light of paths within the cells of a grid, as renderers on graphics processors do. Below the hatched floor "
    "errors mean nothing, since the reference itself is no better. Caches of one structure make the same "
    "picture, so they differ by time, not by error.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE))
