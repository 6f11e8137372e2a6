"""Results files of icbench: loading, and what their columns mean. Medians and intervals are in intervals.py.

Input is Google Benchmark's JSON format, one entry per repetition. Files of one machine and one build are
pooled into one Setup; different machines or builds give separate Setups and are never mixed in one figure.
"""
from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

# Files that agree in these measured the same program in the same circumstances and may be pooled.
kIdentityKeys = (
    "host_name", "cpu_model", "cpu", "num_cpus", "cores", "packages", "machine", "allowed_units", "kernel",
    "governor", "boost", "transparent_huge_pages", "cgroup_cpu_quota", "hypervisor", "commit", "dirty",
    "compiler", "compiler_flags", "flags", "build_type", "library_build_type")
# Entries of a configuration that must agree for files of one setup to be pooled: what rows are measured with.
kMeasuringKeys = ("reference_spp", "latency_every", "breakdown")
# Commands whose rows are trials of caches under workloads, each by itself; files that say nothing are taken.
kCommands = (None, "sweep", "trace replay", "simulate")
# Differences in these need no remark when files are pooled.
kFreeKeys = {"date", "load_avg", "command_line", "seed", "complete", "executable", "pin_map", "mhz_per_cpu",
             "configuration", "configuration_hash", "resumed", "merged"}

kLongBeginning = 20  # characters, more than which values that differ are shown without what they begin with in common
kLongestDetail = 40  # characters shown of a value that differs, if they tell it from the others

kSecondsPerUnit = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}
kTextColumns = ("name", "cache", "workload", "workload_kind", "structure", "mechanism", "consistency",
                "placement", "scene", "integrator", "order", "time_unit", "run_type", "error_message",
                "run_name")
kNumericColumns = (
    "threads", "repetition_index", "real_time", "cpu_time", "items_per_second", "queries", "hits", "inserts",
    "records", "redundant_records", "utilisation", "lock_wait_share", "cas_attempts", "cas_failures",
    "nodes_discarded", "bytes_per_record", "record_cost_us", "rays_per_record", "accuracy", "spp", "cell_size", "rays",
    "rmse", "relmse", "mean_ratio", "reference_relmse", "seconds_indirect", "validated_to_threads", "width", "height")
kWorkloadParameters = {"rays": "rays_per_record", "a": "accuracy", "cost": "record_cost_us"}


class InputError(Exception):
    """What is wrong with the input, where, and how to mend it, in one line."""


@dataclass
class Setup:
    """Everything measured by one build on one machine."""
    label: str
    slug: str
    context: dict
    contexts: list[dict]
    paths: list[Path]
    rows: pd.DataFrame  # measured ones
    remarks: list[str] = field(default_factory=list)
    # Of workloads that replay a trace: what tells it from others of that name, and the file that says so.
    traces: dict[str, tuple[str, str]] = field(default_factory=dict)
    # Rows of icbench simulate, never drawn as measured: of one virtual machine with one set of costs.
    simulated: pd.DataFrame = field(default_factory=pd.DataFrame)
    simulated_paths: list[Path] = field(default_factory=list)      # what they are from

    def _topology(self, *names: str) -> int | None:
        """A count of what the run was allowed to use, else of the whole machine."""
        context = self.context
        for part in (context.get("allowed"), context, context.get("machine")):
            for name in names if isinstance(part, dict) else ():
                if _count(part.get(name)):
                    return _count(part[name])
        return None

    @property
    def processing_units(self) -> int | None:
        return self._topology("units", "num_cpus")

    @property
    def cores(self) -> int | None:
        return self._topology("cores") or self.processing_units

    @property
    def packages(self) -> int | None:
        return self._topology("packages")

    @property
    def boundaries(self) -> list[tuple[int, str]]:
        """(threads, kind) of every topology boundary, in the order of threads."""
        found = set()
        listed = self.context.get("boundaries")
        for boundary in listed if isinstance(listed, list) else []:
            threads = _count(boundary.get("threads")) if isinstance(boundary, dict) else None
            if threads:
                found.add((threads, str(boundary.get("kind", "boundary"))))
        return sorted(found)

    @property
    def complete(self) -> bool | None:
        """False as soon as one measured file says so; None when none of them says anything."""
        said = [c["complete"] for c in self.contexts if "complete" in c and not c.get("simulated")]
        return all(_truth(s) for s in said) if said else None


def _count(value) -> int | None:
    try:
        number = int(float(value))
    except (TypeError, ValueError, OverflowError):
        return None
    return number if number > 0 else None


def _truth(value) -> bool:
    return value.strip().lower() in ("true", "1", "yes") if isinstance(value, str) else bool(value)


def is_lock(mechanism: str) -> bool:
    """Whether a mechanism name is that of a lock, of any kind."""
    text = str(mechanism).lower().replace("-", "_").replace(" ", "_")
    return bool(re.search(r"mutex|spin|queu|(^|_)(rw|lck|(?<!no_)lock(ed|s)?(?!_free))(_|$)", text))


def is_wait_free(mechanism: str) -> bool:
    return "wait_free" in str(mechanism).lower().replace("-", "_").replace(" ", "_")


def workload_parameters(workload: str) -> dict[str, str]:
    """{"rays": "64", "a": "0.2"} of "cornell_box:rays=64:a=0.2"."""
    return dict(part.split("=", 1) for part in workload.split(":")[1:] if "=" in part)


def workload_label(workload: str) -> str:
    """A workload's name for people: "mix 90/10, hot spot" of "mix_90_10:order=hot_spot"."""
    base, *rest = workload.split(":")
    mix = re.fullmatch(r"mix_(\d+)_(\d+)", base)
    words = [f"mix {mix[1]}/{mix[2]}" if mix else base.replace("_", " ")]
    for part in rest:
        key, _, value = part.partition("=")
        value = value.replace("_", " ")
        known = {"cost": f"{value} µs a record", "rays": f"{value} rays", "a": f"a = {value}",
                 "order": value}
        words.append(known.get(key, f"{key.replace('_', ' ')} {value}".strip()))
    return ", ".join(words)


def workload_order(rows: pd.DataFrame) -> list[str]:
    """Workloads in a stable reading order: by kind, then by name with numbers compared as numbers."""
    kinds = ["read_only", "mix", "insert_only", "miss_driven", "ray_traced"]
    pairs = rows[["workload", "workload_kind"]].drop_duplicates("workload").itertuples(index=False)

    def key(pair):
        rank = kinds.index(pair.workload_kind) if pair.workload_kind in kinds else len(kinds)
        pieces = re.split(r"(\d+(?:\.\d+)?)", pair.workload)
        return rank, [(float(p), "") if i % 2 else (0.0, p) for i, p in enumerate(pieces)]
    return [pair.workload for pair in sorted(pairs, key=key)]


def read_json(path: Path, made_by: str, expected: str):
    """What a JSON file holds. Raises InputError, one line: `made_by` is the command that makes such a file, `expected`
    what such files are called.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; make one with `{made_by}`") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file; {expected} is JSON") from None
    try:
        data = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        where = f"line {error.lineno}" if isinstance(error, json.JSONDecodeError) else "nested too deep"
        raise InputError(f"{path}: not JSON ({where}); {expected} is expected") from None
    if half := _half_a_character(text):
        line = text.count("\n", 0, half.start()) + 1
        raise InputError(f"{path}: line {line} has half a character ({half[0]}), which no page can show; take it out")
    return data


def _half_a_character(text: str) -> re.Match | None:
    """The first surrogate in a JSON text that is escaped without the other one that makes a character of it."""
    pairs = r"\\u[dD][89abAB][0-9a-fA-F]{2}\\u[dD][c-fC-F][0-9a-fA-F]{2}"
    for found in re.finditer(rf"\\\\|{pairs}|\\u[dD][89a-fA-F][0-9a-fA-F]{{2}}", text):
        if len(found[0]) == len(r"\uD800"):
            return found
    return None


def is_simulated(entry: dict) -> bool:
    """Whether an entry comes from icbench simulate: no measurement, and never drawn as one."""
    return bool(entry.get("simulated")) or str(entry.get("name", "")).startswith("simulate/")


def calibration_of(context: dict) -> dict:
    """What a file of icbench simulate says about the costs that it is from."""
    said = context.get("calibration")
    return said if isinstance(said, dict) else {}


def calibrated_on(context: dict) -> str:
    """Where those costs were measured, and what is simulated was validated: a calibration may come from elsewhere."""
    host = calibration_of(context).get("host_name")
    return "this machine" if host in (None, "", context.get("host_name", host)) else str(host)


def imagined_machine(context: dict) -> str:
    """What a file of icbench simulate simulated: the virtual machine, and all but the name of its calibration."""
    costs = {key: value for key, value in calibration_of(context).items() if key not in ("file", "validation")}
    return json.dumps([context.get("virtual_machine"), costs], sort_keys=True)


def _read(path: Path) -> tuple[dict, list]:
    data = read_json(path, "icbench sweep --out FILE", "a results file of icbench")
    if not isinstance(data, dict) or not isinstance(data.get("benchmarks"), list):
        raise InputError(f"{path}: no \"benchmarks\" list; a results file in Google Benchmark's format is "
                         "expected")
    if not isinstance(data.get("context"), dict):
        raise InputError(f"{path}: no \"context\"; without it nobody knows which machine this was")
    return data["context"], [entry for entry in data["benchmarks"] if isinstance(entry, dict)]


def _infer_kind(workload: str, scene) -> str:
    base = workload.split(":")[0]
    if base.startswith("mix"):
        return "mix"
    return base if base in ("read_only", "insert_only", "miss_driven") else "ray_traced" if scene else "other"


def _leave_out_untold(rows: pd.DataFrame) -> None:
    """Takes away percentiles of fewer timed operations than they tell of: of 200 the 99.9th is the longest of all,
    which has a field of its own.
    """
    for column in rows:
        part = re.fullmatch(r"latency_(query|insert)_p(\d+)_ns", column)
        samples = f"latency_{part[1]}_samples" if part else ""
        if samples in rows:
            least = round(1 / max(1e-12, 1 - float(f"0.{part[2]}")))
            rows[column] = rows[column].mask(rows[samples] < least)


def _tidy(entries: list, context: dict, run: int, remarks: list[str], path: Path) -> pd.DataFrame:
    """The usable repetitions of one file with the columns of this module, typed, absent numbers as NaN."""
    rows = pd.DataFrame.from_records([e for e in entries if e.get("run_type", "iteration") == "iteration"])
    if rows.empty:
        return rows
    rows["simulated"] = simulated = [is_simulated(e) for e in entries if e.get("run_type", "iteration") == "iteration"]
    if any(simulated):
        remarks.append(f"{sum(simulated)} simulated rows of {path.name} are left out of all figures of measurements: "
                       "they were not measured, and are drawn by themselves")
    rows["calibrated_on"] = calibrated_on(context)
    rows["imagined_machine"], rows["from_file"] = imagined_machine(context), path.name
    failed = rows.get("error_occurred", pd.Series(False, rows.index)).fillna(False).astype(bool)
    if failed.any():
        remarks.append(f"{failed.sum()} trials of {path.name} failed and are left out")
        rows = rows[~failed]
    for column in kTextColumns:
        rows[column] = rows[column].fillna("").astype(str) if column in rows else ""
    parts = rows["name"].str.extract(r"^[^/]+/(?P<workload>.+)/(?P<cache>[^/]+)/threads:(?P<threads>\d+)")
    for column in ("workload", "cache"):
        rows[column] = rows[column].where(rows[column] != "", parts[column].fillna(""))
    if "threads" not in rows:
        rows["threads"] = parts["threads"]
    numeric = set(kNumericColumns) | {c for c in rows if c.startswith("latency_")}
    for column in sorted(numeric):
        values = pd.to_numeric(rows[column], errors="coerce") if column in rows else np.nan
        if column in rows and (odd := (rows[column].notna() & values.isna()).sum()):
            remarks.append(f"{odd} values of {column} in {path.name} are no numbers, and count as absent")
        rows[column] = pd.Series(values, rows.index, dtype=float).replace([np.inf, -np.inf], np.nan)
    _leave_out_untold(rows)
    usable = (rows["workload"] != "") & (rows["cache"] != "") & (rows["threads"] >= 1)
    if not usable.all():
        remarks.append(f"{(~usable).sum()} rows of {path.name} name no workload, cache or threads and are "
                       "left out")
    impossible = usable & ((rows["real_time"] < 0) | (rows["items_per_second"] < 0))
    if impossible.any():
        remarks.append(f"{impossible.sum()} rows of {path.name} took less than no time or did less than nothing, and "
                       "are left out")
    rows = rows[usable & ~impossible].copy()
    if rows.empty:
        return rows
    rows["threads"] = rows["threads"].astype(int)
    for parameter, column in kWorkloadParameters.items():
        parsed = rows["workload"].map(lambda w, p=parameter: workload_parameters(w).get(p))
        rows[column] = rows[column].fillna(pd.to_numeric(parsed, errors="coerce"))
    for column in ("structure", "mechanism"):
        rows[column] = rows[column].replace("", "unknown")
    rows["placement"] = rows["placement"].replace("", str(context.get("placement", "")))
    inferred = [_infer_kind(w, s) for w, s in zip(rows["workload"], rows["scene"])]
    rows["workload_kind"] = rows["workload_kind"].where(rows["workload_kind"] != "", inferred)
    rows["seconds"] = rows["real_time"] * rows["time_unit"].map(kSecondsPerUnit).fillna(1e-9)
    units = Setup("", "", context, [], [], rows).processing_units
    beyond = rows["threads"] > units if units else pd.Series(False, rows.index)
    if "oversubscribed" in rows:
        rows["oversubscribed"] = rows["oversubscribed"].fillna(beyond).astype(bool)
    else:
        rows["oversubscribed"] = beyond
    counted = rows.groupby(["name", "cache", "workload", "threads", "placement"]).cumcount()
    rows["repetition_index"] = rows["repetition_index"].fillna(counted).astype(int)
    rows["run"] = run
    # One cell may be measured by two parts of a run (sweep and pareto); `take` tells their repetitions apart.
    rows["take"] = rows.groupby(["cache", "workload", "threads", "placement", "spp", "repetition_index"],
                                dropna=False).cumcount()
    return rows


def _identity(context: dict, keys) -> tuple:
    return tuple(json.dumps(context.get(key), sort_keys=True) for key in keys)


def _slug(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9]+", "-", text).strip("-").lower() or "setup"


def useful_rate(rows: pd.DataFrame) -> pd.Series:
    """Operations per second that count as work done.

    Where inserts come from misses, a cache that makes threads compute the same record twice also makes them insert it
    twice; counting those inserts would reward it, so queries alone count there.
    """
    missed = (rows["workload_kind"].isin(["miss_driven", "ray_traced", "trace"])
              & (rows["queries"] > 0) & (rows["seconds"] > 0))
    return rows["items_per_second"].where(~missed, rows["queries"] / rows["seconds"])


def redundant_share(rows: pd.DataFrame) -> pd.Series:
    """Records made beyond what a single thread needs for the same work, over that need; NaN where nothing is needed."""
    needed = rows["records"] - rows["redundant_records"]
    return (rows["redundant_records"] / needed).where(needed > 0)


def _of_one_machine(simulated: pd.DataFrame, remarks: list[str]) -> pd.DataFrame:
    """Of simulated rows those of one virtual machine with one set of costs: that with most cores, else the first.

    Others are no repetitions of them. Rows of --validate are not taken either: each is from the costs of its moments.
    """
    if "measured_items_per_second" in simulated:
        simulated = simulated[simulated["measured_items_per_second"].isna()]
    if simulated["imagined_machine"].nunique() < 2:
        return simulated
    most = simulated.groupby("imagined_machine", sort=False)["threads"].max()
    taken = simulated["imagined_machine"] == most.idxmax()
    mine, others = (", ".join(simulated.loc[which, "from_file"].unique()) for which in (taken, ~taken))
    remarks.append(f"what {others} simulated is of another virtual machine, or by other costs, than what {mine} did: "
                   f"answers for more cores are those of {mine}")
    return simulated[taken]


def _tell_sizes_apart(rows: pd.DataFrame) -> None:
    """Names scenes that were rendered at several sizes by theirs as well: neither times nor errors are one curve."""
    size = ", " + rows["width"].map("{:g}".format) + " × " + rows["height"].map("{:g}".format)
    several = size.where(rows["width"] > 0).groupby(rows["scene"]).transform("nunique") > 1
    rows.loc[several & (rows["width"] > 0) & (rows["scene"] != ""), "scene"] += size


def _is_rendered(configuration: dict) -> bool:
    """Whether a sweep has workloads that a reference judges."""
    synthetic = ("read_only", "insert_only", "mix_", "miss_driven", "trace")
    return any(not str(name).startswith(synthetic) for name in configuration.get("workloads", [""]))


def _require_same_measuring(setup: Setup, path: Path, context: dict) -> None:
    """Raises InputError if a sweep was measured in another way than one before."""
    def of(one: dict) -> dict | None:
        said = one.get("configuration")
        return said if isinstance(said, dict) and said.get("command") == "sweep" else None

    mine = of(context)
    for earlier, other in zip(setup.paths, setup.contexts):
        theirs = of(other)
        for key in kMeasuringKeys if mine and theirs else ():
            if key == "reference_spp" and not (_is_rendered(mine) and _is_rendered(theirs)):
                continue
            if mine.get(key) != theirs.get(key):
                raise InputError(f"{path}: {key} is {mine.get(key, False)} here and {theirs.get(key, False)} in "
                                 f"{earlier.name}; draw files of one setting at a time")


def _require_same_traces(setup: Setup, path: Path, configuration: dict, entries: list) -> None:
    """Raises InputError if a workload's trace is another one than in a file before, though its name is the same."""
    traces = configuration.get("traces")
    if configuration.get("command") == "trace replay":
        traces = {entry.get("workload"): configuration.get("trace") for entry in entries}
    for workload, trace in (traces if isinstance(traces, dict) else {}).items():
        known, earlier = setup.traces.setdefault(workload, (trace, path.name))
        if known != trace:
            raise InputError(f"{path}: the trace of workload {workload} is another one than in {earlier}; draw files "
                             "of one trace at a time")


def load(paths) -> list[Setup]:
    """Reads results files and sorts them into setups (one machine, one build each).

    Raises InputError for a file that is missing, no results file, or when nothing usable is in any of them.
    """
    groups: dict[tuple, Setup] = {}
    frames: dict[tuple, list[pd.DataFrame]] = {}
    seen = set()
    for run, path in enumerate(Path(p) for p in paths):
        if os.path.realpath(path) in seen:
            continue
        seen.add(os.path.realpath(path))
        context, entries = _read(path)
        configuration = context.get("configuration")
        configuration = configuration if isinstance(configuration, dict) else {}
        if (command := configuration.get("command")) not in kCommands:
            raise InputError(f"{path}: rows of icbench {command} are no trials by themselves; give results of icbench "
                             "sweep (report.py takes up those of other commands beside a sweep's)")
        key = _identity(context, kIdentityKeys)
        if key not in groups:
            groups[key] = Setup("", "", context, [], [], pd.DataFrame())
            frames[key] = []
        setup = groups[key]
        _require_same_measuring(setup, path, context)
        _require_same_traces(setup, path, configuration, entries)
        setup.contexts.append(context)
        setup.paths.append(path)
        frames[key].append(_tidy(entries, context, run, setup.remarks, path))
    setups = []
    for key, setup in groups.items():
        parts = [f for f in frames[key] if not f.empty]
        if not parts:
            continue
        rows = pd.concat(parts, ignore_index=True)
        again = rows.duplicated(["name", "cache", "threads", "placement", "repetition_index", "real_time",
                                 "cpu_time", "imagined_machine"])
        if again.any():
            setup.remarks.append(f"{again.sum()} rows occur twice in the files and count once")
            rows = rows[~again].reset_index(drop=True)
        rows["items_per_second"] = useful_rate(rows)
        _tell_sizes_apart(rows)
        setup.rows, setup.simulated = (part.reset_index(drop=True) for part in
                                       (rows[~rows["simulated"]], rows[rows["simulated"]]))
        if setup.rows.empty:
            continue
        setup.simulated = _of_one_machine(setup.simulated, setup.remarks).reset_index(drop=True)
        setup.simulated_paths = [p for p, f in zip(setup.paths, frames[key]) if not f.empty and f["simulated"].any()]
        contexts = [c for c, f in zip(setup.contexts, frames[key]) if f.empty or not f["simulated"].all()]
        setup.context = contexts[0]
        keys = set().union(*contexts) - kFreeKeys
        unequal = sorted(k for k in keys if len({_identity(c, [k]) for c in contexts}) > 1)
        if unequal:
            setup.remarks.append("the pooled files differ in " + ", ".join(unequal))
        setups.append(setup)
    if not setups:
        names = ", ".join(str(p) for p in paths)
        if any(len(setup.simulated) for setup in groups.values()):
            raise InputError(f"{names}: simulated, not measured; plots/simulated.py draws it")
        raise InputError(f"{names}: no rows of a sweep; run it again, or without --dry-run (results of other commands "
                         "are taken up beside a sweep's)")
    for setup in groups.values():
        if setup.rows.empty and len(setup.simulated):
            setups[0].remarks.append(f"{len(setup.simulated)} simulated rows of "
                                     f"{', '.join(path.name for path in setup.paths)} come from a machine or build of "
                                     "which nothing measured is here, and are left out")
    _label(setups)
    _name_panels(setups)
    return setups


def _name_panels(setups: list[Setup]) -> None:
    """Names each panel by its workload, and its placement if all setups together have several: comparisons match it."""
    everything = [part for setup in setups for part in (setup.rows, setup.simulated)]
    several = len(set().union(*(part["placement"] for part in everything if len(part)))) > 1
    for rows in everything:
        if len(rows):
            names = {w: workload_label(w) for w in rows["workload"].unique()}
            rows["panel"] = rows["workload"].map(names)
            if several:
                rows["panel"] += rows["placement"].map(lambda placement: f", {placement}" if placement else "")


def _shortened(context: dict, alike: list[dict], key: str) -> str:
    """A value of the identity, without a long beginning that all have, and cut where what is left tells them apart."""
    values = {str(one.get(key, "unknown")) for one in alike}
    common = len(os.path.commonprefix(list(values)))
    shown = {value: (value if common <= kLongBeginning else "…" + value[common:]) for value in values}
    told_apart = len({short[:kLongestDetail] for short in shown.values()}) == len(values)
    return shown[str(context.get(key, "unknown"))][:kLongestDetail if told_apart else None]


def _label(setups: list[Setup]) -> None:
    """Names each setup by its machine, and by what tells it from others of the same name."""
    def name(setup):
        return str(setup.context.get("host_name") or setup.context.get("cpu_model") or "unknown machine")

    for setup in setups:
        alike = [other.context for other in setups if name(other) == name(setup)]
        differing = [k for k in kIdentityKeys if len({_identity(c, [k]) for c in alike}) > 1]
        details = [f"{key.replace('_', ' ')} {_shortened(setup.context, alike, key)}" for key in differing]
        setup.label = ", ".join([name(setup), *details])
    taken: set[str] = set()
    for setup in setups:
        base, count = _slug(setup.label)[:80], 2
        setup.slug = base
        while setup.slug in taken:
            setup.slug, count = f"{base}-{count}", count + 1
        taken.add(setup.slug)
