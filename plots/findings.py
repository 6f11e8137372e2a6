"""What the results say, as numbers with their interval and base.

Everything here is computed from the rows; a finding that the rows do not carry is not made.
"""
from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

import contention_map
import speed_error
import style
from figure import Omitted
from intervals import interval_of, kMinRepetitions, kPairKeys, paired
from over_threads import cache_rows, kUncached, panels_of, thread_marks
from results import Setup, is_lock


kStrict = "_snapshot"  # ends the name of a cache that differs from its namesake by stricter queries alone


@dataclass
class Finding:
    title: str
    value: str     # the number that stands out
    text: str      # what it is a number of
    base: str      # against what, in absolute terms


def synchronised(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of caches that many threads may use: those whose mechanism is one."""
    return rows[~rows["mechanism"].isin(["none", "unknown", ""])]


def structures(setup: Setup) -> list[str]:
    """Structures on which a lock meets something that is none, the most populated first."""
    rows = synchronised(cache_rows(setup))
    found = []
    for structure, part in rows.drop_duplicates(["structure", "cache"]).groupby("structure"):
        locks = part["mechanism"].map(is_lock)
        if locks.any() and not locks.all():
            found.append((-len(part), structure))
    return [structure for _, structure in sorted(found)]


def leaders(rows: pd.DataFrame, value: str, smaller: bool = False) -> pd.DataFrame:
    """Per panel, of rows of one structure at one thread count: the best cache, the best of the other kind,
    their ratio.

    The other kind of a lock is everything without one, and the reverse. The ratio is paired by repetition and
    says how many times better the leader is. `smaller` means that small values are the good ones.
    """
    made = []
    for panel, part in rows[rows[value] > 0].groupby("panel", sort=False):
        medians = part.groupby("cache")[value].median().sort_values(ascending=smaller)
        locks = {c: is_lock(m) for c, m in zip(part["cache"], part["mechanism"])}
        best = medians.index[0]
        others = [c for c in medians.index if locks[c] != locks[best]]
        absolute = interval_of(part.loc[part["cache"] == best, value])
        line = {"panel": panel, "best": best, "median": absolute[0], "low": absolute[1], "high": absolute[2],
                "rival": others[0] if others else "", "ratio": math.nan, "ratio_low": math.nan,
                "ratio_high": math.nan}
        if others:
            pairs = paired(part[part["cache"] == best], part[part["cache"] == others[0]], ["panel"], value)
            ratio = interval_of(1 / pairs["ratio"] if smaller else pairs["ratio"])
            line |= {"ratio": ratio[0], "ratio_low": ratio[1], "ratio_high": ratio[2]}
        made.append(line)
    return pd.DataFrame(made)


def overall(rows: pd.DataFrame, value: str, smaller: bool = False) -> dict | None:
    """The leader over all panels by geometric mean, against the best cache of the other kind; None if there
    is none.

    Only panels that both ran count. The interval is over repetitions of the geometric mean of their paired
    ratios.
    """
    rows = rows[rows[value] > 0]
    medians = rows.groupby(["panel", "cache"])[value].median().unstack("cache")
    common = medians.loc[:, medians.notna().sum() == medians.notna().sum().max()].dropna()
    if common.empty:
        return None
    means = np.exp(np.log(common).mean()).sort_values(ascending=smaller)
    locks = {c: is_lock(m) for c, m in zip(rows["cache"], rows["mechanism"])}
    best = means.index[0]
    others = [c for c in means.index if locks[c] != locks[best]]
    if not others:
        return None
    rival = others[0]
    found = _mean_ratio(rows[rows["panel"].isin(common.index)], best, rival, value, smaller)
    if found is None or found["panels"] < len(common):
        return None
    return found | {"best": best, "rival": rival, "rival_is_lock": locks[rival], "base": means[rival],
                    "own": means[best]}


def _mean_ratio(rows: pd.DataFrame, cache: str, base: str, value: str, smaller: bool = False) -> dict | None:
    """How many times better `cache` is than `base`, as the geometric mean over the panels that both ran.

    The interval is over repetitions of the mean of the ratios paired by repetition; None if no repetition has
    all panels.
    """
    pairs = paired(rows[rows["cache"] == cache], rows[rows["cache"] == base], ["panel"], value)
    pairs = pairs[pairs["ratio"] > 0]
    logs = np.log(1 / pairs["ratio"] if smaller else pairs["ratio"])
    panels = pairs["panel"].nunique()
    table = logs.groupby([pairs[k] for k in kPairKeys]).agg(["mean", "size"])
    whole = table[table["size"] == panels]
    if whole.empty:
        return None
    each = logs.groupby(pairs["panel"]).median()
    return {"ratio": interval_of(np.exp(whole["mean"])), "panels": panels, "names": set(each.index),
            "least": (math.exp(each.min()), each.idxmin()), "most": (math.exp(each.max()), each.idxmax())}


def _kind(lead: dict) -> str:
    return "the best lock" if lead["rival_is_lock"] else "the best cache without a lock"


def _interval(ratio: tuple, unit: str = "×") -> str:
    return style.interval(*ratio[:3], unit)


def _what(lead: dict) -> str:
    """Of how many workloads a ratio is, or of which."""
    return f"geometric mean of {lead['panels']} workloads" if lead["panels"] > 1 else lead["least"][1]


def _decided(ratio: tuple) -> str:
    if not math.isfinite(ratio[1]):
        return f" Fewer than {kMinRepetitions} repetitions: no interval."
    return "" if ratio[1] > 1 else " Undecided: the interval does not exclude a tie."


def place(setup: Setup, threads: int) -> str:
    """"8 threads (all cores)"."""
    cores = setup.cores
    if not cores or threads == cores:
        return f"{style.threads_text(threads)}{' (all cores)' if cores else ''}"
    return (f"{style.threads_text(threads)} "
            + (f"({round(threads / cores, 2):g} a core)" if threads > cores else f"(of {cores} cores)"))


def of_throughput(setup: Setup, structure: str, threads: int) -> Finding | None:
    rows = cache_rows(setup)
    rows = rows[rows["panel"].isin(panels_of(rows)[0])]
    at = synchronised(rows[(rows["structure"] == structure) & (rows["threads"] == threads)])
    lead = overall(at, "items_per_second") if not at.empty else None
    if not lead:
        return None
    (least, at_least), (most, at_most) = lead["least"], lead["most"]
    spread = (f" From {style.number(least)}× ({at_least}) to {style.number(most)}× ({at_most})."
              if lead["panels"] > 1 else "")
    return Finding(f"Best mechanism at {place(setup, threads)}", _interval(lead["ratio"]),
                   f"{lead['best']} over {_kind(lead)}, {lead['rival']}, on the same structure "
                   f"({structure}); {_what(lead)}.{spread}{_decided(lead['ratio'])}",
                   f"Base: {lead['rival']} at {style.threads_text(threads)}, "
                   f"{style.number(lead['base'] * 1e-6)} M "
                   f"operations/s{' (the same mean)' if lead['panels'] > 1 else ''}")


def of_latency(setup: Setup, structure: str, threads: int) -> Finding | None:
    column = "latency_query_p999_ns"
    rows = cache_rows(setup)
    if column not in rows:
        return None
    rows = rows[rows["panel"].isin(panels_of(rows)[0])]
    at = synchronised(rows[(rows["structure"] == structure) & (rows["threads"] == threads)])
    lead = overall(at, column, smaller=True) if not at.empty else None
    if not lead:
        return None
    return Finding(f"Slowest query in a thousand, {place(setup, threads)}", _interval(lead["ratio"]),
                   f"shorter with {lead['best']} ({style.duration(lead['own'] * 1e-9)}) than with "
                   f"{_kind(lead)}, {lead['rival']}; {_what(lead)}.{_decided(lead['ratio'])}",
                   f"Base: {lead['rival']}, p99.9 of a query {style.duration(lead['base'] * 1e-9)}")


def of_break_even(setup: Setup, structure: str, threads: int) -> Finding | None:
    try:
        table = contention_map.ratios(setup)
    except Omitted:
        return None
    table = table[(table["structure"] == structure) & (table["threads"] == threads)]
    if table.empty:
        return None
    cache = min(table["cache"].unique(), key=lambda c: (not c.endswith("wait_free"), c))
    family = table.loc[table["cache"] == cache, ["family", "placement"]].drop_duplicates().iloc[0]
    line = table[(table["cache"] == cache) & (table["family"] == family["family"])
                 & (table["placement"] == family["placement"])].sort_values("record_cost_us")
    verdicts = [contention_map.verdict(row) for _, row in line.iterrows()]
    costs = line["record_cost_us"].to_list()
    sure = next((i for i, v in enumerate(verdicts) if v != "faster"), len(verdicts))
    slow = next((i for i, v in enumerate(verdicts) if v == "slower"), len(verdicts))
    crossing = contention_map.break_even(line.iloc[max(0, sure - 1):slow + 1])  # not where noise around 1 falls through it
    title = f"Break-even cost of a record, {place(setup, threads)}"
    cheapest = line.iloc[0]
    base = (f"Base: {cheapest['best_lock']}, {style.number(cheapest['best_lock_speed'] * 1e-6)} M queries/s "
            f"at {style.number(costs[0])} µs a record")
    at_least = (f"{style.interval(cheapest['median'], cheapest['low'], cheapest['high'], '×')} at "
                f"{style.number(costs[0])} µs")
    if sure == len(verdicts):
        last = line.iloc[-1]
        still = (f", still {style.interval(last['median'], last['low'], last['high'], '×')} at "
                 f"{style.number(costs[-1])} µs"
                 if len(costs) > 1 else "")
        return Finding(title, f"> {style.number(costs[-1])} µs",
                       f"{cache} is faster than the best lock on {structure} at every cost measured: "
                       f"{at_least}{still}.",
                       base)
    slower = costs[slow] if slow < len(costs) else None
    if sure == 0:
        return Finding(title, "none found", f"{cache} could not be shown to be faster than the best lock on "
                       f"{structure} even for cheap records: {at_least}.", base)
    lower, upper = style.number(costs[sure - 1]), style.number(slower) if slower is not None else "∞"
    value = f"> {lower} µs" if crossing is None else f"≈ {style.number(crossing)} [{lower}, {upper}] µs"
    beyond = "beyond, no difference could be shown"
    if slower is not None:
        beyond = f"from {upper} µs it is slower likewise"
    return Finding(title, value, f"Up to {lower} µs a record {cache} is faster than the best lock on "
                   f"{structure} with its whole interval ({at_least}); {beyond}.", base)


def of_strictness(setup: Setup, threads: int) -> Finding | None:
    """Throughput of a cache with linearizable queries over the one without, on the same structure."""
    rows = cache_rows(setup)
    rows = rows[rows["panel"].isin(panels_of(rows)[0]) & (rows["threads"] == threads)
                & (rows["items_per_second"] > 0)]
    names = style.cache_order(rows["cache"])
    strict = next((c for c in names if c.endswith(kStrict) and c.removesuffix(kStrict) in names), None)
    if strict is None:
        return None
    plain = strict.removesuffix(kStrict)
    found = _mean_ratio(rows, strict, plain, "items_per_second")
    if found is None:
        return None
    (least, at_least), (most, at_most), ratio = found["least"], found["most"], found["ratio"]
    where = at_least
    if found["panels"] > 1:
        where = (f"geometric mean of {found['panels']} workloads. From {style.number(least)}× ({at_least}) to "
                 f"{style.number(most)}× ({at_most})")
    speeds = rows[(rows["cache"] == plain) & rows["panel"].isin(found["names"])].groupby("panel")
    speed = math.exp(np.log(speeds["items_per_second"].median()).mean())
    return Finding(f"What strictness costs, {place(setup, threads)}", _interval(ratio),
                   f"the throughput of {strict}, whose queries are atomic snapshots, over that of {plain}, whose "
                   f"queries are not; {where}.{'' if ratio[2] < 1 else _decided(ratio)}",
                   f"Base: {plain}, {style.number(speed * 1e-6)} M operations/s")


def of_error(setup: Setup, structure: str, threads: int) -> Finding | None:
    """relMSE of path tracing over that of a cache in the same time, at the setting nearest to the middle of
    both."""
    rows = setup.rows
    rows = rows[(rows["relmse"] > 0) & (rows["seconds_indirect"] > 0) & (rows["threads"] == threads)]
    rows = rows[rows["placement"] == rows["placement"].min()]
    path = rows[rows["integrator"] == "path"]
    cached = rows[~rows["integrator"].isin(kUncached) & (rows["structure"] == structure)]
    scenes = [s for s in sorted(set(path["scene"]) & set(cached["scene"])) if s]
    if not scenes:
        return None
    scene = scenes[0]
    path, cached = path[path["scene"] == scene], cached[cached["scene"] == scene]
    cache = min(cached["cache"].unique(), key=lambda c: (not c.endswith("wait_free"), c))
    cached = cached[cached["cache"] == cache]
    table = cached.groupby("workload")[["seconds_indirect", "relmse"]].median().reset_index()
    own = speed_error.front(table.rename(columns={"seconds_indirect": "seconds"}))
    times = path.groupby("workload")["seconds_indirect"].median()
    inside = own[(own["seconds"] >= times.min()) & (own["seconds"] <= times.max())]
    if inside.empty:
        return None
    middle = math.sqrt(max(own["seconds"].min(), times.min()) * min(own["seconds"].max(), times.max()))
    chosen = inside.iloc[np.abs(np.log(inside["seconds"] / middle)).argmin()]
    ratios, errors = [], []
    for key, part in cached[cached["workload"] == chosen["workload"]].groupby(kPairKeys):
        rival = path[(path["run"] == key[0])
                     & (path["repetition_index"] == key[1])].sort_values("seconds_indirect")
        seconds, error = part[["seconds_indirect", "relmse"]].iloc[0]
        if len(rival) and rival["seconds_indirect"].iloc[0] <= seconds <= rival["seconds_indirect"].iloc[-1]:
            other = math.exp(np.interp(math.log(seconds), np.log(rival["seconds_indirect"]),
                                       np.log(rival["relmse"])))
            ratios.append(other / error)
            errors.append(other)
    if not ratios:
        return None
    ratio = interval_of(ratios)
    setting = str(chosen["workload"]).split(":", 1)
    return Finding("Error at equal time", _interval(ratio),
                   f"less relMSE with {cache} "
                   f"({setting[1].replace(':', ', ') if len(setting) > 1 else scene}) than with path tracing "
                   f"in the same {style.duration(chosen['seconds'])}; {scene}, "
                   f"{style.threads_text(threads)}.{_decided(ratio)}",
                   f"Base: path tracing, relMSE {style.number(interval_of(errors)[0])}; the cache has "
                   f"{style.number(chosen['relmse'])}")


def findings(setup: Setup) -> list[Finding]:
    """The findings of the summary, those that the rows carry."""
    full, beyond = thread_marks(setup, cache_rows(setup)) if not cache_rows(setup).empty else (1, None)
    made: list[Finding | None] = []
    for structure in structures(setup)[:1]:
        made.append(of_throughput(setup, structure, full))
        if beyond:
            made.append(of_throughput(setup, structure, beyond))
        made += [of_break_even(setup, structure, full), of_latency(setup, structure, beyond or full)]
    made.append(of_strictness(setup, full))
    errors = speed_error_structures(setup)
    marks = sorted(setup.rows.loc[setup.rows["integrator"] == "path", "threads"].unique())
    at = max((t for t in marks if t <= (setup.cores or t)), default=None)
    if errors and at:
        made.append(of_error(setup, errors[0], at))
    return [finding for finding in made if finding]


def speed_error_structures(setup: Setup) -> list[str]:
    """Structures with measured errors, in the order of `structures`, others behind."""
    rows = cache_rows(setup)
    have = list(dict.fromkeys(rows.loc[rows["relmse"] > 0, "structure"]))
    first = [s for s in structures(setup) if s in have]
    return first + [s for s in have if s not in first]
