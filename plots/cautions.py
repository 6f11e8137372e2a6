"""What a reader has to be warned of before any number is believed."""
from __future__ import annotations

from dataclasses import dataclass

import style
from intervals import kFewRepetitions, kMinRepetitions, kNoisy, summarise
from results import Setup


@dataclass
class Caution:
    grave: bool
    text: str


def _stated(context: dict, *keys):
    """The first of these keys that holds something."""
    return next((context[key] for key in keys if context.get(key) is not None), None)


def _load(context: dict) -> float:
    """The largest of the machine when a run began, or went on: means over a minute; 0 if none is known."""
    resumed = context.get("resumed")
    begun = [context, *(one for one in (resumed if isinstance(resumed, list) else []) if isinstance(one, dict))]
    loads = [one.get("load_avg") for one in begun]
    loads = [load[0] if isinstance(load, list) and load else load for load in loads]
    return max((load for load in loads if isinstance(load, (int, float))), default=0.0)


def _of_machine(context: dict, load: float) -> list[Caution]:
    """What the recorded environment gives reason to doubt. `load`: the largest of all runs."""
    made = []
    virtual = _stated(context, "hypervisor", "virtual_machine", "virtualised")
    if virtual and str(virtual).lower() not in ("none", "no", "false", "unknown", "0"):
        name = f" ({virtual})" if isinstance(virtual, str) else ""
        made.append(Caution(False, f"Measured in a virtual machine{name}: neighbours and the "
                                   "hypervisor's scheduler may move any number."))
    governor = context.get("governor")
    if governor in (None, "", "unknown", "not offered"):
        made.append(Caution(False, "The clock governor is unknown: the clock may have changed during the "
                                   "run."))
    elif str(governor) != "performance":
        made.append(Caution(False, f"The clock governor is {governor}, not performance: clocks may "
                                   "differ between trials."))
    builds = [str(context.get(key, "")).lower() for key in ("build_type", "library_build_type")]
    if "debug" in builds or context.get("assertions") is True:
        made.append(Caution(True, "Built with assertions or without optimisation: timings are not to be "
                                  "published."))
    equal = context.get("equal_speed_pus")
    if equal is False or str(equal).lower() == "no":
        made.append(Caution(False, "The processing units are not equally fast: scaling mixes fast and "
                                   "slow ones."))
    if load > 0.5:
        made.append(Caution(False, "The machine was not idle when a run began or went on (load "
                                   f"{style.number(load, 2)})."))
    if context.get("dirty") is True:
        made.append(Caution(False, "The source tree had changes that are not in the recorded commit."))
    return made


def cautions(setup: Setup) -> list[Caution]:
    """What to keep in mind before any number is believed; the gravest first."""
    rows, made = setup.rows, []
    if setup.complete is False:
        made.append(Caution(True, "The results are incomplete: the run was cut short. What is missing was "
                                  "never measured; go on with the same command and --resume."))
    elif setup.complete is None:
        made.append(Caution(False, "The results do not say whether the run was complete."))
    made += _of_machine(setup.context, max((_load(c) for c in setup.contexts if not c.get("simulated")), default=0.0))
    over = sorted(rows.loc[rows["oversubscribed"], "threads"].unique())
    if over:
        made.append(Caution(False, f"Oversubscribed: {', '.join(map(str, over))} threads are more than the "
                                   "processing units, so they measure how a cache copes with threads that "
                                   "are put to sleep."))
    table = summarise(rows, ["panel", "cache", "threads"], "seconds")
    few = (table["n"] < kMinRepetitions).sum()
    if few:
        made.append(Caution(False, f"{few} of {len(table)} cells have fewer than {kMinRepetitions} "
                                   "repetitions: they carry no interval."))
    weak = ((table["n"] >= kMinRepetitions) & (table["n"] < kFewRepetitions)).sum()
    if weak:
        made.append(Caution(False, f"{weak} of {len(table)} cells have three to five repetitions: a "
                                   "bootstrap interval then reaches no further than the samples and covers "
                                   "less than the nominal 95 %."))
    noisy = table[table["spread"] > kNoisy].sort_values("spread", ascending=False)
    if len(noisy):
        worst = "; ".join(f"{r.cache}, {r.panel}, {style.threads_text(r.threads)}: "
                          f"{style.number(r.spread * 100, 2)} %"
                          for r in noisy.head(3).itertuples())
        made.append(Caution(False, f"Noisy: {len(noisy)} of {len(table)} cells scatter by more than 10 % "
                                   f"(interquartile range over median of the time). Worst: {worst}."))
    made += [Caution(False, style.capital(text) + ".") for text in setup.remarks]
    return sorted(made, key=lambda w: not w.grave)
