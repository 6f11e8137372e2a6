"""What differs between two runs: two builds on one machine, or one program on two machines.

Every cell (cache, workload, thread count) that both measured gets the ratio of the second run over the first with its
95 % interval, by bootstrap: over ratios paired by repetition where both runs had the same seed, so that a repetition
asked for the same points and rays; else of the ratio of medians, each run's repetitions drawn by themselves. Runs are
told apart by machine and never pooled. Intervals are expanded for few repetitions as those of intervals.py are, by the
fewest that go into a ratio; of fewer than kFewRepetitions there is an interval, but no verdict, for it covers too little.
"""
from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

import style
from intervals import kFewRepetitions, kMinRepetitions, tail
from results import kIdentityKeys, Setup

kDraws = 1000
kMachineKeys = ("host_name", "cpu_model", "cpu", "num_cpus", "machine")
kBuildKeys = ("commit", "dirty", "compiler", "compiler_flags", "flags", "build_type", "library_build_type")
kCell = ["cache", "panel", "threads"]
# Field, words, more is better.
kMetrics = (("items_per_second", "throughput", True), ("latency_query_p999_ns", "slowest query in a thousand", False),
            ("redundant_records", "redundant records, where no repetition had none", False), ("bytes_per_record", "bytes a record", False),
            ("relmse", "relMSE", False))


@dataclass
class Comparison:
    """`second` over `first`. `cells`: a line a metric and cell; `overall`: a line a metric, cache and thread count."""
    label: str
    slug: str
    first: Setup
    second: Setup
    names: tuple[str, str]
    one_machine: bool
    paired: bool
    cells: pd.DataFrame
    overall: pd.DataFrame
    alone: tuple[int, int]      # cells that only the first, only the second measured
    differing: list[tuple[str, str, str]] = field(default_factory=list)


@dataclass
class SameChange:
    """One change of the build (or of circumstances), measured on several machines."""
    label: str
    slug: str
    parts: list[Comparison]     # one of each machine
    names: list[str]            # theirs


@dataclass
class OneVersion:
    """One commit on several machines."""
    label: str
    slug: str
    setups: list[Setup]         # at least one of each machine
    names: list[str]            # theirs


def machine_of(setup: Setup) -> tuple:
    return tuple(str(setup.context.get(key)) for key in kMachineKeys)


def machine_name(setup: Setup) -> str:
    return str(setup.context.get("host_name") or setup.context.get("cpu_model") or "unknown machine")


def _build_name(setup: Setup) -> str:
    commit = setup.context.get("commit")
    return f"commit {str(commit)[:12]}{' with changes' if setup.context.get('dirty') is True else ''}" if commit else \
        setup.label


def _seeds(setup: Setup) -> set:
    return {str(c.get("seed")) for c in setup.contexts}


def _medians(samples: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """kDraws medians of resamples of each row of `samples`, NaN below kMinRepetitions columns: rows x kDraws."""
    rows, n = samples.shape
    if n < kMinRepetitions:
        return np.full((rows, kDraws), np.nan)
    made = np.empty((rows, kDraws))
    step = max(1, 2_000_000 // (kDraws * n))
    for start in range(0, rows, step):
        part = samples[start:start + step]
        made[start:start + step] = np.median(part[:, random.integers(0, n, (kDraws, n))], axis=2)
    return made


def _by_size(groups: dict[tuple, np.ndarray]) -> dict[int, list[tuple]]:
    sizes: dict[int, list[tuple]] = {}
    for key, values in groups.items():
        sizes.setdefault(len(values), []).append(key)
    return sizes


def _drawn(groups: dict[tuple, np.ndarray], seed: int) -> dict[tuple, np.ndarray]:
    """Resampled medians of every group."""
    random, made = np.random.default_rng(seed), {}
    for size, keys in sorted(_by_size(groups).items()):
        found = _medians(np.stack([groups[k] for k in keys]), random)
        made |= dict(zip(keys, found))
    return made


def _groups(rows: pd.DataFrame, value: str) -> dict[tuple, np.ndarray]:
    return {key: part.to_numpy(float) for key, part in rows.groupby(kCell)[value]}


def _interval(logs: np.ndarray, n: int) -> tuple[float, float]:
    """Low and high of a ratio by its resampled logs, where each is from at least n repetitions."""
    if n < kMinRepetitions:
        return math.nan, math.nan
    out = tail(n)
    low, high = np.exp(np.percentile(logs, [out, 100 - out]))
    return float(low), float(high)


def _of_metric(first: pd.DataFrame, second: pd.DataFrame, value: str, paired: bool) -> tuple[list[dict], dict]:
    """The cells of one metric, and of each its resampled log ratios. A cell needs a ratio of every repetition: left out
    is one that has any at or below 0, as counts of redundant records may be.
    """
    # The files of one setup are paired with those of the other in their order.
    first, second = (part.assign(file=part["run"].rank(method="dense")) for part in (first, second))
    first, second = (part[part[value].notna()] for part in (first, second))
    first, second = (part[(part[value] > 0).groupby([part[key] for key in kCell]).transform("all")]
                     for part in (first, second))
    before, after = _groups(first, value), _groups(second, value)
    common = [key for key in before if key in after]
    if paired:
        keys = [*kCell, "file", "repetition_index", "take"]
        old, new = (part.drop_duplicates(keys)[[*keys, value]] for part in (first, second))
        merged = new.merge(old, on=keys, suffixes=("", "_before"))
        merged["log"] = np.log(merged[value] / merged[f"{value}_before"])
        logs = _groups(merged, "log")
        common = [key for key in common if key in logs]
        middle = {key: float(np.median(logs[key])) for key in common}
        draws = _drawn({key: logs[key] for key in common}, 1)
        counts = {key: len(logs[key]) for key in common}
    else:
        middle = {key: math.log(np.median(after[key]) / np.median(before[key])) for key in common}
        old = _drawn({key: before[key] for key in common}, 1)
        new = _drawn({key: after[key] for key in common}, 2)
        draws = {key: np.log(new[key] / old[key]) for key in common}
        counts = {key: min(len(before[key]), len(after[key])) for key in common}
    lines = []
    for key in common:
        low, high = _interval(draws[key], counts[key])
        lines.append(dict(zip(kCell, key)) | {
            "metric": value, "first": float(np.median(before[key])), "second": float(np.median(after[key])),
            "ratio": math.exp(middle[key]), "low": low, "high": high, "n": counts[key]})
    return lines, draws


def _verdict(line: dict, better: bool) -> str:
    if line["n"] < kFewRepetitions or not math.isfinite(line["low"]) or line["low"] <= 1 <= line["high"]:
        return "undecided"
    return "better" if (line["low"] > 1) == better else "worse"


def _overall(lines: list[dict], draws: dict, value: str) -> list[dict]:
    """By cache and thread count, the geometric mean of the ratios of all workloads."""
    made, table = [], pd.DataFrame(lines)
    for (cache, threads), part in table.groupby(["cache", "threads"]):
        known = np.stack([draws[cache, panel, threads] for panel in part["panel"]])
        n = int(part["n"].min())
        low, high = _interval(known.mean(axis=0), n)
        made.append({"metric": value, "cache": cache, "threads": int(threads), "workloads": len(part), "n": n,
                     "ratio": float(np.exp(np.log(part["ratio"]).mean())), "low": low, "high": high})
    return made


def compare(first: Setup, second: Setup) -> Comparison:
    one = machine_of(first) == machine_of(second)
    same_seed = len(_seeds(first)) == 1 and _seeds(first) == _seeds(second) and _seeds(first) != {"None"}
    cells, overall = [], []
    for value, _, better in kMetrics:
        if value not in first.rows or value not in second.rows:
            continue
        lines, draws = _of_metric(first.rows, second.rows, value, same_seed)
        if not lines:
            continue
        cells += [line | {"verdict": _verdict(line, better)} for line in lines]
        overall += [line | {"verdict": _verdict(line, better)} for line in _overall(lines, draws, value)]
    keys = [set(map(tuple, s.rows[kCell].drop_duplicates().to_numpy())) for s in (first, second)]
    names = (_build_name(first), _build_name(second)) if one else (machine_name(first), machine_name(second))
    if names[0] == names[1]:
        names = (first.label, second.label)
    label = f"{machine_name(first)}: {names[1]} over {names[0]}" if one else f"{names[1]} over {names[0]}"
    shown = [key for key in dict.fromkeys((*kMachineKeys, *kBuildKeys, *first.context, *second.context))
             if isinstance(first.context.get(key, ""), (str, int, float, bool, dict, type(None)))]
    differing = [(key, str(first.context.get(key, "not said")), str(second.context.get(key, "not said")))
                 for key in shown if first.context.get(key) != second.context.get(key)]
    return Comparison(label, "", first, second, names, one, same_seed, pd.DataFrame(cells), pd.DataFrame(overall),
                      (len(keys[0] - keys[1]), len(keys[1] - keys[0])), differing)


def comparisons(setups: list[Setup]) -> list[Comparison]:
    """What is to be compared of the setups in the order they were given: on each machine its first with the others of
    it; and the first of the first machine with the first of every other.
    """
    machines: dict[tuple, list[Setup]] = {}
    for setup in setups:
        machines.setdefault(machine_of(setup), []).append(setup)
    pairs = [(mine[0], other) for mine in machines.values() for other in mine[1:]]
    firsts = [mine[0] for mine in machines.values()]
    pairs += [(firsts[0], other) for other in firsts[1:]]
    made = [compare(*pair) for pair in pairs]
    for number, one in enumerate(made, 1):
        one.slug = f"difference-{number}"
    return made


def _panel_names(setups: list[Setup]) -> list[str]:
    """By machine, and in full where two would be called the same."""
    short = [machine_name(setup) for setup in setups]
    return [setup.label if short.count(name) > 1 else name for setup, name in zip(setups, short)]


def same_changes(found: list[Comparison]) -> list[SameChange]:
    """Those that several machines measured: from the same commit, with the same that differs."""
    def change(one: Comparison) -> tuple:
        before, after = one.first.context, one.second.context
        pairs = [(key, str(before.get(key)), str(after.get(key))) for key in kIdentityKeys]
        return str(before.get("commit")), str(before.get("dirty")), *(p for p in pairs if p[1] != p[2])

    groups: dict[tuple, list[Comparison]] = {}
    for one in found:
        if one.one_machine:
            groups.setdefault(change(one), []).append(one)
    several = [parts for parts in groups.values() if len(parts) > 1]
    return [SameChange(f"{parts[0].names[1]} over {parts[0].names[0]} on {len(parts)} machines", f"change-{number}",
                       parts, _panel_names([one.first for one in parts])) for number, parts in enumerate(several, 1)]


def one_versions(setups: list[Setup]) -> list[OneVersion]:
    """Commits that several machines measured; a run that does not tell its commit is none of them."""
    groups: dict[tuple, list[Setup]] = {}
    for setup in setups:
        if setup.context.get("commit"):
            groups.setdefault((setup.context["commit"], setup.context.get("dirty") is True), []).append(setup)
    several = [mine for mine in groups.values() if len({machine_of(setup) for setup in mine}) > 1]
    return [OneVersion(f"{_build_name(mine[0])} on {len({machine_of(setup) for setup in mine})} machines",
                       f"version-{number}", mine, _panel_names(mine)) for number, mine in enumerate(several, 1)]


def metric_words(value: str) -> str:
    return next(words for name, words, _ in kMetrics if name == value)


def _counts(comparison: Comparison) -> list[int]:
    return sorted(comparison.overall["threads"].unique()) if len(comparison.overall) else []


def full_threads(comparison: Comparison) -> int:
    """The thread count nearest to all cores of the smaller machine, of those that both runs measured."""
    counts = _counts(comparison)
    cores = min(s.cores or counts[-1] for s in (comparison.first, comparison.second))
    return max((t for t in counts if t <= cores), default=counts[0])


def shown_threads(comparison: Comparison) -> list[int]:
    """At most three thread counts: the least, all cores of the smaller machine, the most."""
    counts = _counts(comparison)
    return counts if len(counts) < 4 else sorted({counts[0], full_threads(comparison), counts[-1]})


def cache_names(comparison: Comparison) -> list[str]:
    return style.cache_order(comparison.overall["cache"]) if len(comparison.overall) else []
