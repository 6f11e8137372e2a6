#!/usr/bin/python3
"""Two builds on several machines: by how much every cache's throughput differs, a panel a machine."""
import sys
from functools import partial

import style  # first: it checks what is installed

import pandas as pd

from comparison import comparisons, full_threads, same_changes, SameChange
from figure import Built, Figure, Omitted, Panel, Plate, main
from over_threads import panels_of
from results import InputError, load
from run_differences import draw, kMeans, plate_of

kWorkloads = 4  # drawn one by one; the CSV has all


def build(change: SameChange) -> Built:
    cells, means = [], []
    for name, part in zip(change.names, change.parts):
        for tables, table in ((cells, part.cells), (means, part.overall)):
            if len(table):
                tables.append(table[table["metric"] == "items_per_second"].assign(
                    machine=name, drawn=table["threads"] == full_threads(part)))
    if not cells:
        raise Omitted("no two runs have a cell in common")
    cells, means = pd.concat(cells, ignore_index=True), pd.concat(means, ignore_index=True)
    rows = pd.concat([part.first.rows for part in change.parts], ignore_index=True)
    titles, note = panels_of(rows[rows["panel"].isin(cells["panel"])], kWorkloads)
    plates = [_plate("all", "all workloads", means[means["drawn"]], change, kMeans)]
    for number, title in enumerate(titles, 1):
        mine = cells[cells["drawn"] & (cells["panel"] == title)]
        if len(mine):
            plates.append(_plate(f"{number}", title, mine, change, "Ratios of this workload"))
    return Built(cells.drop(columns="drawn"), plates, [note] if note else [])


def _plate(slug: str, title: str, table: pd.DataFrame, change: SameChange, what: str) -> Plate:
    caches = style.cache_order(table["cache"])
    values, panels = table[["ratio", "low", "high"]].to_numpy().ravel(), []
    for name in change.names:
        mine = table[table["machine"] == name]
        if len(mine):
            panels.append(Panel(f"{name}, {style.threads_text(mine['threads'].iloc[0])}",
                                partial(draw, part=mine, caches=caches, values=values)))
    return plate_of(slug, f"{title}: {change.parts[0].names[1]} over {change.parts[0].names[0]}", panels, caches, what)


FIGURE = Figure(
    "machine_differences", "The same change on each machine",
    "A panel a machine, on the same axis; nothing is averaged over machines. Each dot is a cache with as many threads "
    "as the machine has cores: the throughput of the second build over that of the first, first as the geometric mean "
    "over all workloads, then workload by workload. A filled dot is decided: its whole 95 % interval lies on one side. "
    "A change that helps one machine and harms another shows as dots on both sides of the line.",
    build)


def read(paths) -> list[SameChange]:
    found = same_changes(comparisons(load(paths)))
    if not found:
        raise InputError(f"{', '.join(map(str, paths))}: no two builds that two machines measured")
    return found


if __name__ == "__main__":
    sys.exit(main(FIGURE, read))
