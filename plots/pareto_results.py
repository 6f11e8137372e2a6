"""Files of icbench pareto: loading, medians of every setting, and the front.

Files of one machine and one build are one Measured, with a scene or more; others are kept apart.
"""
from __future__ import annotations

import json
from dataclasses import dataclass, field
from numbers import Number
from pathlib import Path

import style  # first: it checks what is installed

import numpy as np
import pandas as pd

from intervals import summarise
from results import InputError, kIdentityKeys, read_json

kFiles = "results of icbench pareto (a scene each)"
# Errors that the front is drawn for: field, name, what a value is of.
kErrors = {"relmse": "relMSE", "rmse": "RMSE, W/(m² sr)", "relmse_irradiance": "relMSE of irradiance",
           "rmse_irradiance": "RMSE of irradiance, W/m²", "flip": "FLIP", "hdrvdp_p75": "HDR-VDP, % of pixels",
           "hdrvdp_p95": "HDR-VDP, % of pixels at 95 %", "full_relmse": "relMSE of the whole picture"}
kSpread = (*kErrors, "mean_ratio")  # told with the spread of the runs
kOthers = ("full_rmse", "full_flip", "full_mean_ratio", "rays", "records", "seconds")
kOfLast = ("bias", "bias_squared", "bias_squared_error", "deviation", "bias_runs")  # of all runs together: the last one tells
kReference = ("reference_spp", "reference_rmse", "reference_relmse", "reference_rmse_irradiance",
              "reference_relmse_irradiance", "full_reference_relmse", "width", "height", "relmse_scale")
kNeeded = ("scene", "method", "seconds_indirect", "relmse")
kKeys = ["scene", "method", "setting"]


@dataclass
class Pictures:
    """What --images wrote: images.json, and the folder that it is in."""
    folder: Path
    index: dict


@dataclass
class Measured:
    """One machine and build."""
    label: str
    slug: str
    contexts: list[dict] = field(default_factory=list)
    paths: list[Path] = field(default_factory=list)
    rows: pd.DataFrame = field(default_factory=pd.DataFrame)
    pictures: list[Pictures] = field(default_factory=list)

    left_out: list[str] = field(default_factory=list)  # why files were not read

    @property
    def complete(self) -> bool:
        return not self.cut_short

    @property
    def cut_short(self) -> list[str]:
        """The files of runs that did not come to their end."""
        return [path.name for path, context in zip(self.paths, self.contexts) if not context.get("complete", True)]


def setting_of(name: str) -> str:
    """"accuracy:0.2/rays_per_record:64" of "pareto/SCENE/METHOD/accuracy:0.2/rays_per_record:64"."""
    return "/".join(part for part in name.split("/")[3:])


def setting_words(setting: str) -> str:
    """A setting for people: "a = 0.2, 64 rays a record"."""
    forms = {"accuracy": "a = {}", "rays_per_record": "{} rays a record", "spp": "{} spp", "vpls": "{} VPLs",
             "cell_size": "cells of {} px"}
    words = []
    for part in setting.split("/"):
        key, _, value = part.partition(":")
        value = f"{int(value):,}" if value.isdigit() else value
        words.append(forms.get(key, key.replace("_", " ") + " {}").format(value))
    return ", ".join(words)


def on_front(seconds, error) -> np.ndarray:
    """Marks each point unless another is both faster and better."""
    seconds, error = np.asarray(seconds, float), np.asarray(error, float)
    marks = np.zeros(len(seconds), bool)
    least = np.inf  # error of what is faster
    for budget in np.unique(seconds):
        same = np.flatnonzero(seconds == budget)
        marks[same] = error[same] <= least
        least = min([least, *error[same][~np.isnan(error[same])]])
    return marks


def points(measured: Measured) -> pd.DataFrame:
    """One line per setting: medians with intervals, bias and deviation of its runs, and its fronts, `front_ERROR`.

    Of seconds, errors and the mean ratio the spread of its runs as well, `X_from` and `X_to`: the interval, or where
    there are too few runs for one, least and most of them; nothing of a single run.
    """
    rows = measured.rows
    table = summarise(rows, kKeys, "seconds_indirect").drop(columns="spread").rename(
        columns={"median": "seconds", "low": "seconds_low", "high": "seconds_high"})
    for name in [e for e in kSpread if e in rows]:
        part = summarise(rows, kKeys, name).drop(columns=["spread", "n"]).rename(
            columns={"median": name, "low": f"{name}_low", "high": f"{name}_high"})
        table = table.merge(part, on=kKeys, how="left")
    for name in ["seconds", *(e for e in kSpread if e in rows)]:
        values = rows.groupby(kKeys)["seconds_indirect" if name == "seconds" else name]
        ends = values.agg(["min", "max"]).where(values.count() > 1).rename(
            columns={"min": f"{name}_from", "max": f"{name}_to"})
        table = table.merge(ends, left_on=kKeys, right_index=True, how="left")
        table[f"{name}_from"] = table[f"{name}_low"].fillna(table[f"{name}_from"])
        table[f"{name}_to"] = table[f"{name}_high"].fillna(table[f"{name}_to"])
    last = rows.sort_values("repetition_index").groupby(kKeys, sort=False)
    for name in [n for n in (*kOthers, *kReference) if n in rows]:
        column = "frame_seconds" if name == "seconds" else name
        table = table.merge(last[name].median().rename(column), on=kKeys, how="left")
    for name in [n for n in kOfLast if n in rows]:
        table = table.merge(last[name].last().rename(name), on=kKeys, how="left")
    for name in [e for e in kErrors if e in table]:
        for _, part in table.groupby("scene"):
            table.loc[part.index, f"front_{name}"] = on_front(part["seconds"], part[name])
        table[f"front_{name}"] = table[f"front_{name}"].astype(bool)
    if "reference_relmse" in table:
        table["below_reference"] = table["relmse"] < 2 * table["reference_relmse"]
    return table


def read_rows(path: Path, command: str, files: str, needed) -> tuple[dict, pd.DataFrame]:
    """The context and the rows, at least one, of a results file whose rows have the columns `needed`. Raises
    InputError; `files` says what is expected.
    """
    data = read_json(path, f"{command} --out FILE", f"a file of `{command}`")
    entries = data.get("benchmarks") if isinstance(data, dict) else None
    if not isinstance(entries, list) or not isinstance(data.get("context"), dict):
        raise InputError(f"{path}: no \"context\" and \"benchmarks\"; {files} are expected")
    rows = pd.DataFrame.from_records([e for e in entries if isinstance(e, dict)])
    if rows.empty:
        raise InputError(f"{path}: no rows; run {command} again with --resume")
    missing = [n for n in ("name", "repetition_index", *needed) if n not in rows]
    if missing:
        raise InputError(f"{path}: its rows have no \"{missing[0]}\"; {files} are expected")
    return data["context"], rows


def _read(path: Path) -> tuple[dict, pd.DataFrame]:
    context, rows = read_rows(path, "icbench pareto", kFiles, kNeeded)
    # Lists and the like, of a later version perhaps, are nothing that rows can be told apart by.
    rows = rows.apply(lambda column: column.map(lambda v: json.dumps(v) if isinstance(v, (list, dict)) else v))
    rows["setting"] = rows["name"].astype(str).map(setting_of)
    for name in {*kErrors, *kOthers, *kOfLast, *kReference, "seconds_indirect", "repetition_index"} & set(rows):
        rows[name] = pd.to_numeric(rows[name], errors="coerce")
    rows = rows[(rows["seconds_indirect"] > 0) & rows["relmse"].notna()]
    if rows.empty:
        raise InputError(f"{path}: no row has both a time and an error")
    return context, rows


def _pictures(path: Path, context: dict) -> Pictures | None:
    """None where there are none, or no longer."""
    if not isinstance(context.get("images"), str):
        return None
    folder = path.parent / context["images"]
    try:
        index = json.loads((folder / "images.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(index, dict) or not isinstance(index.get("budgets"), list):
        return None
    return Pictures(folder, index)


class Settings:
    """What must be equal in the files of one machine and build for their rows to be runs of one thing.

    `of`: entries of a context's configuration, or of itself, and columns of the rows; `by`: columns whose values have
    settings of their own.
    """

    def __init__(self, of: tuple[str, ...] = (), by: tuple[str, ...] = ()):
        self._of, self._by, self._known = of, by, {}

    def require_equal(self, identity: tuple, path: Path, context: dict, rows: pd.DataFrame) -> None:
        """Raises InputError if a file before had others."""
        configuration = context.get("configuration")
        stated = {**context, **(configuration if isinstance(configuration, dict) else {})}
        mine = {}
        by = [*self._by]
        for what, part in rows.groupby(by if len(by) > 1 else by[0]) if by else [((), rows)]:
            what = what if isinstance(what, tuple) else (what,)
            for name in self._of:
                values = sorted(part[name].dropna().unique(), key=lambda v: (str(type(v)), v)) if name in part \
                    else [stated.get(name)]
                mine[identity, what, name] = " and ".join(f"{v:.15g}" if isinstance(v, Number) else str(v)
                                                          for v in values if v is not None)
        for key, value in mine.items():
            earlier, before = self._known.get(key, (path, value))
            if before != value:
                _, what, name = key
                of = f" of {' by '.join(map(str, what))}" if what else ""
                raise InputError(f"{path}: {name}{of} is {value or 'not told'} here and {before or 'not told'} in "
                                 f"{earlier.name}; "
                                 "draw files of one setting at a time")
        for key, value in mine.items():
            self._known.setdefault(key, (path, value))


def _identity(context: dict) -> tuple:
    return tuple(json.dumps(context.get(k), sort_keys=True) for k in kIdentityKeys)


def pool(paths, read, name: str, settings: Settings) -> list[Measured]:
    """What files hold, one Measured for each machine and build, with slugs of `name`. `read` makes context and rows of
    a file; rows that several files share count once. Raises InputError where `settings` differ.
    """
    groups: dict[tuple, Measured] = {}
    for path in dict.fromkeys(Path(p).resolve() for p in paths):
        context, rows = read(path)
        key = _identity(context)
        settings.require_equal(key, path, context, rows)
        number = len(groups) + 1
        label = str(context.get("host_name") or context.get("cpu_model") or "unknown machine")
        one = groups.setdefault(key, Measured(label, name if number == 1 else f"{name}-{number}"))
        one.contexts.append(context)
        one.paths.append(path)
        one.rows = pd.concat([one.rows, rows], ignore_index=True)
    for one in groups.values():
        told = [n for n in ("name", "repetition_index", "real_time", "seed") if n in one.rows]
        one.rows = one.rows[~one.rows.duplicated(told)].reset_index(drop=True)
    return list(groups.values())


def _settings() -> Settings:
    return Settings(("width", "height", "threads", "reference_spp", "cache", "frame", "scene_key"), ("scene",))


def load(paths) -> list[Measured]:
    """Raises InputError for a file that is none of icbench pareto, and for files whose settings differ."""
    found = pool(paths, _read, "pareto", _settings())
    for one in found:
        one.pictures = [p for p in map(_pictures, one.paths, one.contexts) if p]
    return found


def load_what_can_be(load_files, paths) -> tuple[list, list[str]]:
    """What `load_files`, this module's or another's, makes of files; but those that cannot be read, or not beside those
    before, cost no others: they are left out, and why is told.
    """
    made, good, left_out = [], [], []
    for path in dict.fromkeys(Path(p).resolve() for p in paths):
        try:
            made = load_files([*good, path])
            good.append(path)
        except InputError as error:
            left_out.append(str(error))
    return made, left_out


def method_order(names) -> list[str]:
    return style.cache_order(names)
