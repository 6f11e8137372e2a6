#!/usr/bin/python3
"""One version on several machines: throughput against threads, a panel a machine."""
import sys
from functools import partial

import style  # first: it checks what is installed

import pandas as pd

from comparison import kBuildKeys, one_versions, OneVersion
from figure import Built, Figure, Omitted, Panel, Plate, main
from intervals import interval_note, summarise
from over_threads import (cache_handles, cache_rows, draw_over_threads, groups_of, kGroupKeys, panels_of,
                          topology_handles, with_oversubscription)
from results import InputError, load

kWorkloads = 3  # drawn of a structure; the CSV has all
kScale = 1e-6


def build(version: OneVersion) -> Built:
    setups = dict(zip(version.names, version.setups))
    rows = {name: cache_rows(setup) for name, setup in setups.items()}
    tables = [with_oversubscription(summarise(mine, kGroupKeys, "items_per_second"), mine).assign(machine=name)
              for name, mine in rows.items()]
    table = pd.concat(tables, ignore_index=True)
    known = table[table["median"] > 0]
    known = known[known.groupby(["panel", "cache"])["machine"].transform("nunique") > 1]
    if known.empty:
        raise Omitted("no cache ran the same workload on two machines")
    if known["threads"].nunique() < 2:
        raise Omitted("only one thread count was measured")
    notes, plates = [], []
    together = pd.concat(rows.values(), ignore_index=True)
    for group in groups_of(version.setups[0], together[together["cache"].isin(known["cache"])], across=False):
        mine = known[known["cache"].isin(group.caches)]
        titles, note = panels_of(mine, kWorkloads)
        if note and note not in notes:
            notes.append(note)
        plates += [_plate(f"{group.slug}-{number}", f"{title}, {group.title}", mine[mine["panel"] == title], setups)
                   for number, title in enumerate(titles, 1)]
    unequal = [key.replace("_", " ") for key in kBuildKeys
               if len({str(setup.context.get(key)) for setup in version.setups}) > 1]
    if unequal:
        notes.append(f"the builds of this version differ in {', '.join(unequal)}")
    return Built(table, plates, notes)


def _plate(slug: str, title: str, table: pd.DataFrame, setups: dict) -> Plate:
    counts, panels, marks = sorted(table["threads"].unique()), [], {}
    for name, setup in setups.items():
        mine = table[table["machine"] == name]
        if len(mine):
            panels.append(Panel(name, partial(draw_over_threads, part=mine, setup=setup, marked=mine, counts=counts,
                                              spanned=table, scale=kScale, logarithmic=True),
                                str(setup.context.get("cpu_model") or "")))
            marks |= {handle.get_label(): handle for handle in topology_handles(setup, mine)}
    caches = style.cache_order(table["cache"])
    return Plate(slug, title, panels, lambda layout: [*cache_handles(caches, layout), *marks.values()], "threads",
                 "million operations per second", f"{interval_note(table['n'])} All panels have the same axes.")


FIGURE = Figure(
    "machine_throughput", "One version on each machine",
    "A panel a machine, on the same axes; nothing is averaged over machines. Each line is a cache under the workload "
    "that the title names, as in the figures of each machine by itself: which cache leads, and from how many threads "
    "on, may be another one on another machine. Only caches that two machines ran under a workload are drawn. Grey "
    "lines and the shade are each machine's own boundaries and oversubscription.",
    build)


def read(paths) -> list[OneVersion]:
    found = one_versions(load(paths))
    if not found:
        raise InputError(f"{', '.join(map(str, paths))}: no commit that two machines measured")
    return found


if __name__ == "__main__":
    sys.exit(main(FIGURE, read))
