#!/usr/bin/python3
"""What icbench simulate says of cores that are not there. Never drawn beside what was measured."""
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import style  # first: it checks what is installed

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D

from figure import Built, Figure, Omitted, Panel, Plate, main
from over_threads import thread_axis
from results import (InputError, calibrated_on, calibration_of, is_simulated, read_json, redundant_share, useful_rate,
                     workload_label, workload_order)

kFiles = "results of icbench simulate"
kNumbers = ("threads", "real_time", "items_per_second", "queries", "records", "redundant_records", "lock_wait_share",
            # of --validate
            "measured_items_per_second", "error_items_per_second", "rounds")
# Column, title, axis, whether logarithmic.
kMetrics = (("throughput", "Throughput", "M op/s", True),
            ("speedup", "Speed-up over the same cache on one core", "speed-up", True),
            ("redundant_share", "Records that one thread would not have made", "redundant records, %", False),
            ("waiting_share", "Time waiting for locks", "time waiting for locks, %", False))


def in_words(validated_to: int, place: str) -> str:
    """What everything that was simulated has to say: up to how many threads such figures were held against measured
    ones, and where.
    """
    return (f"simulated, validated to {style.threads_text(validated_to)} on {place}" if validated_to
            else "simulated, not validated")


@dataclass
class Simulated:
    """One file."""
    label: str
    slug: str
    path: Path
    context: dict
    rows: pd.DataFrame

    @property
    def calibration(self) -> dict:
        return calibration_of(self.context)

    @property
    def host(self) -> str:
        """Where the costs were measured."""
        return str(self.calibration.get("host_name") or self.context.get("host_name") or "the machine")

    @property
    def place(self) -> str:
        """Where it was validated."""
        return calibrated_on(self.context)

    @property
    def said(self) -> str:
        """What every picture of it has to say."""
        threads = int(pd.to_numeric(self.rows["validated_to_threads"], errors="coerce").fillna(0).min())
        return in_words(threads, self.place)


def load(paths) -> list[Simulated]:
    """Raises InputError for a file that holds nothing simulated."""
    found = []
    for number, path in enumerate(map(Path, paths), 1):
        data = read_json(path, "icbench simulate --out FILE", "a file of icbench simulate")
        entries = data.get("benchmarks") if isinstance(data, dict) else None
        entries = [e for e in entries if isinstance(e, dict) and is_simulated(e)] if isinstance(entries, list) else []
        rows = pd.DataFrame.from_records(entries)
        if rows.empty or not {"cache", "workload", "workload_kind", "real_time", *kNumbers[:3]} <= set(rows):
            raise InputError(f"{path}: nothing simulated in it; make some with `icbench simulate --out FILE`")
        for name in kNumbers:
            rows[name] = pd.to_numeric(rows[name], errors="coerce") if name in rows else np.nan
        if "validated_to_threads" not in rows:
            rows["validated_to_threads"] = 0
        rows["seconds"] = rows["real_time"] * 1e-3
        rows["throughput"] = useful_rate(rows) * 1e-6
        one = rows[rows["threads"] == 1].set_index(["workload", "cache"])["throughput"]
        rows["speedup"] = [t / one.get((w, c), np.nan) for w, c, t in rows[["workload", "cache", "throughput"]].values]
        rows["redundant_share"] = 100 * redundant_share(rows)
        rows["waiting_share"] = 100 * rows["lock_wait_share"]
        context = data.get("context") if isinstance(data.get("context"), dict) else {}
        found.append(Simulated(path.stem, f"simulated-{number}", path, context, rows))
    return found


def _draw(axes, layout: style.Layout, part: pd.DataFrame, counts, column: str, logarithmic: bool) -> None:
    thread_axis(axes, counts, layout)
    values = part[column].to_numpy(float)
    if logarithmic:
        style.log_axis(axes.yaxis, values, most=5 if layout.small else 6)
    else:
        style.linear_axis(axes.yaxis, values, 5 if layout.small else 6)
    for cache in style.cache_order(part["cache"]):
        line = part[part["cache"] == cache].sort_values("threads")
        axes.plot(line["threads"], line[column],
                  **(style.line_options(cache, layout) | {"linestyle": style.kDashed}))


def _handles(caches: list[str], layout: style.Layout) -> list:
    return [Line2D([], [], **(style.line_options(c, layout) | {"linestyle": style.kDashed})) for c in caches]


def build(simulated: Simulated) -> Built:
    rows, plates = simulated.rows, []
    counts = sorted(rows["threads"].dropna().unique())
    if len(counts) < 2:
        raise Omitted("only one number of cores was simulated")
    for column, title, unit, logarithmic in kMetrics:
        known = rows[np.isfinite(rows[column]) & ((rows[column] > 0) | (not logarithmic))]
        if known.empty or not (known[column] != 0).any():
            continue
        if column == "waiting_share":
            known = known[known.groupby("cache")[column].transform("max") > 0]
        panels = [Panel(workload_label(w), partial(_draw, part=known[known["workload"] == w], counts=counts,
                                                   column=column, logarithmic=logarithmic))
                  for w in workload_order(known)]
        caches = style.cache_order(known["cache"].unique())
        plates.append(Plate(column, f"{title}: {simulated.said}", panels, partial(_handles, caches), "virtual cores",
                            unit, "Dashed: nothing here was measured. "
                            f"Costs of operations are those of {simulated.host}."))
    if not plates:
        raise Omitted("no row has a rate")
    table = rows[["workload", "cache", "threads", "throughput", "speedup", "redundant_share", "waiting_share",
                  "validated_to_threads"]].assign(simulated=True)
    return Built(table, plates)


FIGURE = Figure(
    "simulated", "What more cores would do",
    "Every line is simulated, hence dashed: the cache's real operations, carried out in virtual time on cores that are "
    "not there. What threads see of each other's records, and so the work that they repeat, is exact for these times; "
    "times are added up from costs that were measured on one thread, from models of the locks, and from published "
    "times that a cache line takes between cores. Memory bandwidth and caches that cores share are left out. Each "
    "title says up to how many threads such figures were compared with measured ones.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, kFiles))
