"""Files of icbench repeatability: loading, and medians of every cache on every number of threads."""
from __future__ import annotations

from pathlib import Path

import style  # first: it checks what is installed

import numpy as np
import pandas as pd

from intervals import summarise
from pareto_results import Measured, Settings, pool, read_rows
from results import InputError

kFiles = "results of icbench repeatability"
# What a picture is compared with: field, name.
kKinds = {"rms_to_single": "from the picture of one thread", "rms_to_last_run": "from run to run",
          "rms_to_fewer_threads": "from the next smaller number of threads"}
kShares = [f"{kind}_share_of_{of}" for kind in kKinds for of in ("mean", "error")]
kOthers = ["mean", "error", "rmse", "reference_rmse", "records_made", "redundant_records", "seconds_indirect"]
kNeeded = ("scene", "integrator", "cache", "threads", "rms_to_single", "mean", "error", "seconds_indirect")
kKeys = ["scene", "integrator", "cache", "threads"]
kSettings = ("width", "height", "accuracy", "rays_per_record", "vpls", "reference_spp")


def _read(path: Path) -> tuple[dict, pd.DataFrame]:
    context, rows = read_rows(path, "icbench repeatability", kFiles, kNeeded)
    for name in {*kKinds, *kShares, *kOthers, *kSettings, "threads", "repetition_index"} & set(rows):
        rows[name] = pd.to_numeric(rows[name], errors="coerce")
    rows = rows[rows["rms_to_single"].notna() & (rows["mean"] > 0) & (rows["threads"] > 0)]
    if rows.empty:
        raise InputError(f"{path}: no row has both a difference and a mean")
    if "deterministic" in rows:  # another mode beside the same integrator
        rows["integrator"] += rows["deterministic"].map(lambda on: ", deterministic" if on else "")
    if "interpolation" in rows:
        rows["integrator"] += rows["interpolation"].map(
            lambda level: "" if level == "split_sphere" else f", {str(level).replace('_', ' ')}")
    if "leak_guard" in rows:
        rows["integrator"] += rows["leak_guard"].map(lambda on: ", guarded" if on else "")
    return context, rows.astype({"threads": int})


def load(paths) -> list[Measured]:
    """Raises InputError for a file that is none of icbench repeatability, and for files whose settings differ."""
    return pool(paths, _read, "repeatability", Settings((*kSettings, "frame", "placement", "tiles", "scene_key"),
                                                        ("scene", "integrator")))


def points(measured: Measured) -> pd.DataFrame:
    """One line per cache and number of threads: medians of all that was measured, those of the kinds with intervals,
    and the settings.
    """
    rows = measured.rows
    table = rows.groupby(kKeys, sort=True)["repetition_index"].nunique().rename("n").reset_index()
    for name in [n for n in (*kKinds, *kShares, *kOthers) if n in rows]:
        part = summarise(rows, kKeys, name).drop(columns=["spread", "n"]).rename(
            columns={"median": name, "low": f"{name}_low", "high": f"{name}_high"})
        table = table.merge(part, on=kKeys, how="left")
    first = rows.groupby(kKeys, sort=True)
    for name in [n for n in (*kSettings, "oversubscribed", "single_thread") if n in rows]:
        table = table.merge(first[name].first().rename(name), on=kKeys, how="left")
    return table


def groups(table: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """What is drawn and told together: a scene by an integrator, with its name."""
    return [(f"{scene.replace('_', ' ')}, {integrator.replace('_', ' ')}", part)
            for (scene, integrator), part in table.groupby(["scene", "integrator"])]


def about(part: pd.DataFrame) -> str:
    """What was rendered: "80 × 80 pixels, a = 0.2, 256 rays a record"."""
    line = part.iloc[0]
    forms = {"accuracy": "a = {:g}", "rays_per_record": "{:,.0f} rays a record", "vpls": "{:,.0f} VPLs",
             "reference_spp": "reference of {:,.0f} samples"}
    said = [f"{line['width']:.0f} × {line['height']:.0f} pixels"] if {"width", "height"} <= set(part) else []
    said += [form.format(line[key]) for key, form in forms.items() if key in part and np.isfinite(line[key])]
    return ", ".join(said)
