"""Which scheme to use: for rays a record and cores, how long each access mechanism takes beside the fastest.

Every answer comes from one kind of evidence, named in it, and kinds are never mixed in one answer:

- a rendered scene whose thread count was measured, where the rays lie among those measured;
- else the miss-driven workload at that thread count, where a record costs a set time; rays become a time by the cost of
  a ray, which the rendered scenes tell;
- else, past the machine's cores, the simulator's results for the miss-driven workload, of the mechanisms that were
  simulated;
- else the Universal Scalability Law of the miss-driven workload, where enough thread counts were measured;
- else nothing: there is no answer for that many cores.

Between two measured record costs the time is taken as straight over the cost, repetition by repetition (the time of a
query is that of the cache plus that of the records made). Outside them the nearest answers, and the answer says so: it
is extrapolated, or simulated and not validated.
"""
from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from figure import Omitted
from intervals import interval_of, kPairKeys, median_intervals, summarise
from over_threads import cache_rows, thread_marks
from results import Setup, is_lock, redundant_share
from scalability import kTail, laws

kRays = [round(2 ** (k / 2)) for k in range(2, 25)]  # 2 to 4,096, two to the octave
kMicroseconds = [0, *(round(10 ** (k / 4), 2) for k in range(-4, 13))]
kFurther = 4         # scaling laws answer up to this many times the most threads measured
kMeasured, kSimulated, kExtrapolated = "measured", "simulated", "extrapolated"
kAlone = "no synchronisation"
# A mechanism whose interval begins no higher may as well be taken. The simulator's are deterministic and may have none:
# there the error that it is held to takes the interval's place.
kNegligible = {kMeasured: 1.02, kSimulated: 1.10, kExtrapolated: 1.02}


def kind_of(mechanism: str) -> str:
    """The access mechanism in a reader's words."""
    name = mechanism.replace("-", "_")
    known = {"none": kAlone, "wait_free": "wait-free", "wait_free_snapshot": "wait-free with snapshot queries",
             "local_write": "local write", "thread_local": "thread-local", "node_lock": "a lock in every node",
             "append_log": "frozen with a log", "tbb": "concurrent containers",
             "concurrent_container": "concurrent containers"}
    if name in known:
        return known[name]
    if "rw" in name or "shared" in name:
        return "readers-writer lock"
    return "one lock" if is_lock(name) else name.replace("_", " ")


@dataclass
class Plane:
    """Times by record cost at one thread count, of one kind of evidence."""
    certainty: str
    rendered: bool               # x is rays a record, times are seconds; else microseconds a record, seconds a query
    threads: int
    accuracy: float              # NaN where there is one for all
    times: dict[float, pd.DataFrame]    # by x: a line a repetition (or refit), a column a cache
    redundant: dict[float, pd.Series]   # by x: share of records made twice, by cache
    about: str
    refits: bool = False         # lines are refits: their scatter is the uncertainty itself
    validated_to: dict[float, pd.Series] = field(default_factory=dict)  # by x: threads by cache; of simulated ones
    place: str = ""              # where those were validated


@dataclass
class Line:
    """What one access mechanism takes, by its fastest cache."""
    kind: str
    cache: str
    ratio: tuple[float, float, float]   # time over that of the fastest
    loss: tuple[float, float, float]    # share of the cores' time that one thread alone would not need
    redundant: float
    time: float                         # seconds; of the picture's indirect light, or of a query


@dataclass
class Answer:
    certainty: str
    how: str
    rendered: bool
    lines: list[Line]           # fastest first
    repetitions: int
    validated_to: int           # threads, where simulated: the least over all times that were looked at
    place: str
    inside: bool = True         # whether x lies within what was measured, or simulated

    @property
    def tied(self) -> list[Line]:
        """What cannot be told from the fastest by more than a trifle, without it."""
        limit = kNegligible[self.certainty]
        return [line for line in self.lines[1:] if not self._least(line) > limit]

    def _least(self, line: Line) -> float:
        """The least that its time may be, over the fastest's; NaN where nothing can be said."""
        middle, low, _ = line.ratio
        return middle if self.certainty == kSimulated and math.isnan(low) else low


@dataclass
class Errors:
    """relMSE by accuracy, at some rays a record."""
    accuracy: float
    relmse: tuple[float, float, float]
    measured: bool              # at these rays; else between or beyond those measured


@dataclass
class Choice:
    """All that the first page needs; `x` are rays a record, or microseconds where no ray's cost is known."""
    in_rays: bool
    x: list[float]
    microseconds_a_ray: tuple[float, float, float]
    threads: list[int]
    planes: list[Plane]
    errors: pd.DataFrame        # rays, accuracy, median, low, high
    scene: str
    notes: list[str] = field(default_factory=list)

    def microseconds(self, x: float) -> float:
        return x * self.microseconds_a_ray[0] if self.in_rays else x

    @property
    def accuracies(self) -> list[float]:
        return sorted({p.accuracy for p in self.planes if p.rendered}, reverse=True)


def tails(setup: Setup) -> tuple[int, dict[str, float]]:
    """The slowest query in a thousand, ns, with more threads than processing units: how many, and by cache the
    geometric mean over the workloads that all caches ran. It tells what the caches do to threads that are put to
    sleep, in which mechanisms of one speed differ.
    """
    rows = cache_rows(setup)
    if "latency_query_p999_ns" not in rows:
        return 0, {}
    rows = rows[rows["oversubscribed"] & (rows["latency_query_p999_ns"] > 0) & (rows["cache"] != "null")]
    if rows.empty:
        return 0, {}
    threads = thread_marks(setup, cache_rows(setup))[1] or int(rows["threads"].max())
    rows = rows[rows["threads"] == threads]
    table = rows.groupby(["panel", "cache"])["latency_query_p999_ns"].median().unstack("cache").dropna()
    return int(threads), dict(np.exp(np.log(table).mean())) if len(table) else {}


def _family(workload: str, *parameters: str) -> str:
    return ":".join(p for p in workload.split(":") if p.split("=")[0] not in parameters)


def _largest_family(rows: pd.DataFrame, *parameters: str) -> pd.DataFrame:
    """The rows of one workload but for these parameters, and one placement: that of most settings."""
    rows = rows.assign(family=rows["workload"].map(lambda w: _family(w, *parameters)))
    settings = rows.groupby(["placement", "family"])["workload"].nunique().sort_index()
    placement, family = settings.idxmax()
    return rows[(rows["placement"] == placement) & (rows["family"] == family)]


def _tables(rows: pd.DataFrame, x: str, time: str) -> tuple[dict, dict]:
    times, redundant = {}, {}
    rows = rows.assign(share=redundant_share(rows))
    for value, part in rows.groupby(x):
        times[float(value)] = part.pivot_table(index=kPairKeys, columns="cache", values=time, aggfunc="first")
        redundant[float(value)] = part.groupby("cache")["share"].median()
    return times, redundant


def _rendered(rows: pd.DataFrame) -> tuple[list[Plane], str]:
    """The planes of the rendered scene with most settings, and its name."""
    rows = rows[(rows["workload_kind"] == "ray_traced") & (rows["rays_per_record"] > 0) & rows["accuracy"].notna()]
    rows = rows.assign(took=rows["seconds_indirect"].fillna(rows["seconds"]))
    rows = rows[(rows["took"] > 0) & (rows["cache"] != "null")]
    if rows.empty:
        return [], ""
    rows = _largest_family(rows, "rays", "a")
    scene = str(rows["scene"].iloc[0] or rows["family"].iloc[0].split(":")[0]).replace("_", " ")
    return [Plane(kMeasured, True, int(threads), float(accuracy), *_tables(part, "rays_per_record", "took"),
                  f"rendering {scene}, a = {accuracy:g}")
            for (threads, accuracy), part in rows.groupby(["threads", "accuracy"])], scene


def _by_cost(rows: pd.DataFrame) -> pd.DataFrame:
    rows = rows[(rows["workload_kind"] == "miss_driven") & rows["record_cost_us"].notna()
                & (rows["items_per_second"] > 0) & (rows["cache"] != "null")]
    rows = rows.assign(took=1 / rows["items_per_second"])
    return rows if rows.empty else _largest_family(rows, "cost")


def _miss_driven(rows: pd.DataFrame, certainty: str) -> list[Plane]:
    made = []
    for threads, part in rows.groupby("threads"):
        plane = Plane(certainty, False, int(threads), math.nan, *_tables(part, "record_cost_us", "took"),
                      "points that miss")
        if certainty == kSimulated:
            known = part.fillna({"validated_to_threads": 0}).groupby("record_cost_us")
            plane.validated_to = {float(x): at.groupby("cache")["validated_to_threads"].min() for x, at in known}
            plane.place = " and ".join(sorted(part["calibrated_on"].unique()))
        made.append(plane)
    return made


def _by_law(rows: pd.DataFrame) -> list[Plane]:
    """Planes past the most threads measured, from laws with refits."""
    found = {key: law for key, law in laws(rows, ["record_cost_us", "cache"]).items()
             if law and len(law.refits)}
    if not found:
        return []
    last = max(law.counts[-1] for law in found.values())
    made = []
    threads = 2 ** math.ceil(math.log2(last + 1))
    while threads <= kFurther * last:
        times: dict[float, dict] = {}
        for (cost, cache), law in found.items():
            gamma, alpha, beta = law.refits.T
            speeds = gamma * threads / (1 + alpha * (threads - 1) + beta * threads * (threads - 1))
            times.setdefault(float(cost), {})[cache] = 1 / speeds
        made.append(Plane(kExtrapolated, False, threads, math.nan, {c: pd.DataFrame(t) for c, t in times.items()},
                          {c: pd.Series(dtype=float) for c in times}, "points that miss", refits=True))
        threads *= 2
    return made


def microseconds_a_ray(planes: list[Plane], rows: pd.DataFrame) -> tuple[float, float, float]:
    """What a ray of a record costs, by what more of them add to the picture's time at the fewest threads; NaN if
    unknown.
    """
    if not planes:
        return math.nan, math.nan, math.nan
    threads = min(p.threads for p in planes)
    counts = rows[rows["threads"] == threads].groupby(["accuracy", "rays_per_record", "cache"])["records"].median()
    samples = []
    for plane in planes:
        if plane.threads != threads or len(plane.times) < 2:
            continue
        few, many = min(plane.times), max(plane.times)
        slower, faster = plane.times[many].align(plane.times[few], join="inner")
        for cache in slower.columns:
            rays = (many * counts.get((plane.accuracy, many, cache), math.nan)
                    - few * counts.get((plane.accuracy, few, cache), math.nan))
            if rays > 0:
                samples += list((slower[cache] - faster[cache]) * threads / rays * 1e6)
    return interval_of([s for s in samples if s > 0])[:3]


def choice(setup: Setup) -> Choice:
    """Raises Omitted where the rows cannot tell anything."""
    rows = cache_rows(setup)
    # Two hardware threads of one core are no two cores.
    rows = rows[~rows["oversubscribed"] & (rows["threads"] <= (setup.cores or math.inf))]
    rendered, scene = _rendered(rows)
    missed = _by_cost(rows)
    planes = rendered + _miss_driven(missed, kMeasured)
    measured = max((p.threads for p in planes), default=0)
    imagined = _by_cost(setup.simulated) if len(setup.simulated) else pd.DataFrame()
    if len(imagined):
        planes += [p for p in _miss_driven(imagined, kSimulated) if p.threads > measured or p.threads == 1]
    if not any(p.certainty == kSimulated and p.threads > 1 for p in planes) and len(missed):
        planes += _by_law(missed)
    if not planes:
        raise Omitted("neither a rendered scene with rays a record nor a miss_driven workload with a record cost was "
                      "measured without oversubscription")
    each = microseconds_a_ray(rendered, rows)
    errors = _errors(rows)
    in_rays = bool(rendered) and (math.isfinite(each[0]) or not len(missed))
    threads = sorted({p.threads for p in planes if not (p.certainty == kSimulated and p.threads <= measured)})
    made = Choice(in_rays, kRays if in_rays else kMicroseconds, each, threads, planes, errors, scene)
    made.notes += _not_simulated(setup, planes, measured)
    if in_rays and not math.isfinite(each[0]):
        made.notes.append("one number of rays alone was rendered, so what a ray costs is not known")
    if not in_rays:
        made.notes.append("no scene was rendered with several numbers of rays a record, so what a ray costs is not "
                          "known: the question is put in microseconds a record")
    return made


def _not_simulated(setup: Setup, planes: list[Plane], measured: int) -> list[str]:
    """What is compared up to the cores of the machine, and not past them."""
    past = [p for p in planes if p.certainty == kSimulated and p.threads > measured]
    if not past:
        return []
    mechanisms = dict(zip(setup.rows["cache"], setup.rows["mechanism"]))
    mechanisms |= dict(zip(setup.simulated["cache"], setup.simulated["mechanism"]))

    def kinds(some: list[Plane]) -> set[str]:
        return {kind_of(mechanisms.get(cache, "unknown")) for p in some for times in p.times.values() for cache in times}
    missing = kinds([p for p in planes if p.certainty == kMeasured]) - kinds(past) - {kAlone}
    said = "" if not missing else f"; not simulated, and so not compared there: {', '.join(sorted(missing))}"
    return [f"past {measured} cores the answers are simulated, whatever the tolerable error{said}"]


def _errors(rows: pd.DataFrame) -> pd.DataFrame:
    """relMSE by rays and accuracy, over all caches and thread counts: neither changes it by more than its scatter."""
    rows = rows[(rows["relmse"] > 0) & (rows["rays_per_record"] > 0) & rows["accuracy"].notna()]
    if rows.empty:
        return pd.DataFrame(columns=["rays_per_record", "accuracy", "median", "low", "high"])
    rows = _largest_family(rows, "rays", "a")
    # A repetition is a seed, and all caches share it: their pictures are no independent samples.
    each = rows.groupby(["rays_per_record", "accuracy", "run", "repetition_index"])["relmse"].median().reset_index()
    return summarise(each, ["rays_per_record", "accuracy"], "relmse")


def errors_at(made: Choice, rays: float) -> list[Errors]:
    """The coarsest accuracy first."""
    found = []
    for accuracy, part in made.errors.groupby("accuracy"):
        part = part.sort_values("rays_per_record")
        known = part["rays_per_record"].to_numpy(float)
        at = [math.exp(np.interp(math.log(rays), np.log(known), np.log(part[name].to_numpy(float))))
              for name in ("median", "low", "high")]
        found.append(Errors(float(accuracy), tuple(at), bool((known == rays).any())))
    return sorted(found, key=lambda e: -e.accuracy)


def _knots(plane: Plane, x: float) -> list[float]:
    """The x that were measured which answer for this one: itself, its neighbours, or the nearest."""
    knots = sorted(plane.times)
    nearest = min(knots, key=lambda k: abs(k - x))
    below, above = [k for k in knots if k < x], [k for k in knots if k > x]
    return [nearest] if abs(nearest - x) <= 1e-9 * max(1.0, x) or not below or not above else [below[-1], above[0]]


def _at(plane: Plane, x: float) -> tuple[pd.DataFrame, pd.Series, str, bool]:
    """Times and redundant shares at x, where they are from, and whether x lies within what was measured."""
    unit = "rays" if plane.rendered else "µs a record"
    low, *rest = _knots(plane, x)
    if not rest:
        inside = abs(low - x) <= 1e-9 * max(1.0, x)
        return plane.times[low], plane.redundant[low], f"{low:g} {unit}{'' if inside else ', the nearest'}", inside
    high, = rest
    share = (x - low) / (high - low)
    first, second = plane.times[low].align(plane.times[high], join="inner")
    few, many = plane.redundant[low].align(plane.redundant[high], join="inner")
    return (first + share * (second - first), few + share * (many - few), f"between {low:g} and {high:g} {unit}", True)


def _intervals(samples: np.ndarray, refits: bool) -> list[tuple[float, float, float]]:
    """(middle, low, high) of each row; NaN samples of a row do not count."""
    if refits:
        return [tuple(row) for row in np.nanpercentile(samples, [50, kTail, 100 - kTail], axis=1).T]
    if np.isfinite(samples).all():
        return [tuple(map(float, row)) for row in zip(*median_intervals(samples))]
    made = []
    for row in samples:
        clean = row[np.isfinite(row)]
        if clean.size:
            made.append(tuple(float(v[0]) for v in median_intervals(clean[None, :])))
        else:
            made.append((math.nan, math.nan, math.nan))
    return made


def _base(made: Choice, plane: Plane) -> Plane | None:
    """That of one thread in the same circumstances."""
    certainty = kSimulated if plane.certainty == kSimulated else kMeasured
    return next((p for p in made.planes if p.threads == 1 and p.rendered == plane.rendered
                 and p.certainty == certainty
                 and (p.accuracy == plane.accuracy or not plane.rendered)), None)


def _validated_to(plane: Plane, x: float, caches) -> int:
    """The least that any of these caches was validated to at what answers for x; 0 too where that is not said."""
    known = [plane.validated_to[k].reindex(caches).fillna(0).min() for k in _knots(plane, x) if k in plane.validated_to]
    return int(min(known, default=0))


def evidence(made: Choice, x: float, threads: int, accuracy: float | None) -> tuple[Plane, float] | None:
    """The best evidence, and where to look in it."""
    here = [p for p in made.planes if p.threads == threads and not (p.certainty == kSimulated and threads == 1)]
    for plane in here:
        if plane.rendered and plane.accuracy == accuracy and min(plane.times) <= x <= max(plane.times):
            return plane, x
    cost = made.microseconds(x)
    order = (kMeasured, kSimulated, kExtrapolated)
    others = sorted((p for p in here if not p.rendered), key=lambda p: order.index(p.certainty))
    if others and math.isfinite(cost):
        return others[0], cost
    rendered = next((p for p in here if p.rendered and p.accuracy == accuracy), None)
    return (rendered, x) if rendered else None


def _by_pairs(times: pd.DataFrame) -> list[str]:
    """The columns, of rising medians, as ratios paired by repetition order them, which are shown: first the one that no
    other is faster than in half of the repetitions or more, if there is one.
    """
    for first in times:
        ratios = times.div(times[first], axis=0).median()
        if (ratios >= 1).all():
            return [first, *ratios.drop(first).sort_values(kind="stable").index]
    return list(times)


def answer(made: Choice, mechanisms: dict[str, str], x: float, threads: int, accuracy: float | None) -> Answer | None:
    """The best evidence's answer; None if there is none. `mechanisms`: of every cache."""
    found = evidence(made, x, threads, accuracy)
    if not found:
        return None
    plane, where = found
    times, redundant, place, inside = _at(plane, where)
    medians = times.median().dropna()
    kinds = {cache: kind_of(mechanisms.get(cache, "unknown")) for cache in medians.index}
    if threads > 1:
        medians = medians[[kinds[c] != kAlone for c in medians.index]]
    if medians.empty:
        return None
    fastest = medians.sort_values(kind="stable").groupby(lambda c: kinds[c], sort=False).head(1)
    caches = _by_pairs(times[list(fastest.index)])
    best = times[caches[0]]
    ratios = _intervals((times[caches].div(best, axis=0)).to_numpy().T, plane.refits)
    losses = [(math.nan, math.nan, math.nan)] * len(caches)
    base = _base(made, plane)
    alone = pd.DataFrame() if base is None else _at(base, where)[0]
    ones = alone.median().dropna()
    validated_to = _validated_to(plane, where, medians.index)
    if len(ones):  # between settings of different files there are no pairs, and so no times
        single = alone[ones.idxmin()]
        validated_to = min(validated_to, _validated_to(base, where, [ones.idxmin()]))
        if plane.refits:
            share = 1 - single.median() / (threads * times[caches])
        else:
            share = 1 - times[caches].rdiv(single, axis=0).dropna(how="all") / threads
        if len(share):
            losses = _intervals(share.to_numpy().T, plane.refits)
    lines = [Line(kinds[cache], cache, ratio, loss, float(redundant.get(cache, math.nan)), float(medians[cache]))
             for cache, ratio, loss in zip(caches, ratios, losses)]
    certainty = plane.certainty
    if not inside and certainty == kMeasured:
        certainty = kExtrapolated
    return Answer(certainty, f"{plane.about}, {place}", plane.rendered, lines,
                  0 if plane.refits else int(times[caches[0]].notna().sum()), validated_to if inside else 0,
                  plane.place, inside)
