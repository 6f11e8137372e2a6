#!/usr/bin/python3
"""Verdicts of icstress: loading its JSON, and what they add up to.

As a program it prints what is wrong with the caches, or that nothing is: status 0 nothing, 1 something, 2 no
such file.
"""
from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field
from pathlib import Path

import style  # first: it checks what is installed

import pandas as pd

from figure import OneLineParser
from results import InputError, read_json

kHeld, kBroken, kViolated, kUnseen = "held", "BROKEN", "violated", "not seen"
kNumber, kMaybeNumber, kBound = (int, float), (int, float, type(None)), (int, float, str, type(None))
# What an entry of each section has to hold. Older files lack all but the first two.
kSections = {
    "checks": {"cache": str, "check": str, "verdict": str, "promised": bool, "operations": kNumber,
               "concurrent_pairs": kNumber, "violations": kNumber, "witness": str},
    "controls": {"control": str, "fault": str, "check": str, "seen": bool, "required": bool,
                 "rounds": kNumber, "rounds_violated": kNumber, "operations": kNumber, "witness": str},
    "schedules": {"cache": str, "scenario": str, "threads": kNumber, "preemptions": kMaybeNumber,
                  "schedules": kNumber, "complete": bool, "check": str, "verdict": str, "promised": bool,
                  "replay": str, "witness": str},
    "explored_controls": {"control": str, "fault": str, "check": str, "caught": bool, "schedules": kNumber,
                          "replay": str, "witness": str},
    "progress": {"cache": str, "operation": str, "declared": str, "bound": kBound,
                 "most_steps": kNumber, "steps_by_interference": list, "positions": kNumber,
                 "blocked_positions": kNumber, "verdict": str, "note": str},
    "progress_controls": {"control": str, "fault": str, "operation": str, "must": str, "seen": bool,
                          "note": str}}
kRequired = ("checks", "controls")
kVerdicts = ("holds", "violated")


@dataclass
class Cell:
    """One cache and one condition. `histories` and `schedules`: violated there, None where not examined."""
    cache: str
    check: str
    promised: bool
    histories: bool | None
    schedules: bool | None

    @property
    def state(self) -> str:
        violated = bool(self.histories or self.schedules)
        return (kBroken if violated else kHeld) if self.promised else (kViolated if violated else kUnseen)


@dataclass
class Caught:
    """A broken cache, with its entries among the controls of histories and schedules; None: it has none."""
    control: str
    fault: str
    histories: dict | None
    explored: dict | None

    @property
    def is_caught(self) -> bool:
        return bool(self.histories and self.histories["seen"] or self.explored and self.explored["caught"])

    @property
    def is_excused(self) -> bool:
        """Whether histories need not see it, and nothing else was tried."""
        return self.explored is None and self.histories is not None and not self.histories["required"]


@dataclass
class Correctness:
    """One file of icstress. A section that the file does not have is None."""
    path: Path
    checks: list[dict]
    controls: list[dict]
    schedules: list[dict] | None = None
    explored_controls: list[dict] | None = None
    progress: list[dict] | None = None
    progress_controls: list[dict] | None = None
    not_examined: list[str] | None = None
    slug: str = "correctness"
    cells: list[Cell] = field(init=False)

    def __post_init__(self):
        made: dict[tuple, Cell] = {}
        for kind, entries in (("histories", self.checks), ("schedules", self.schedules or [])):
            for entry in entries:
                key = entry["cache"], entry["check"]
                cell = made.setdefault(key, Cell(*key, entry["promised"], None, None))
                cell.promised |= entry["promised"]
                setattr(cell, kind, bool(getattr(cell, kind)) or entry["verdict"] == "violated")
        self.cells = list(made.values())

    @property
    def label(self) -> str:
        return str(self.path)

    @property
    def caches(self) -> list[str]:
        return list(dict.fromkeys(cell.cache for cell in self.cells))

    @property
    def conditions(self) -> list[str]:
        return list(dict.fromkeys(cell.check for cell in self.cells))

    @property
    def broken_caches(self) -> list[Caught]:
        """The caches broken on purpose."""
        real = self.caches
        seen = {c["control"]: c for c in self.controls if c["control"] not in real}
        explored = {c["control"]: c for c in self.explored_controls or [] if c["control"] not in real}
        return [Caught(name, (seen.get(name) or explored[name])["fault"], seen.get(name), explored.get(name))
                for name in dict.fromkeys([*seen, *explored])]

    @property
    def overstated(self) -> list[dict]:
        """Correct caches that were held to more than they promise, and had to fail."""
        return [c for c in [*self.controls, *(self.explored_controls or [])] if c["control"] in self.caches]

    def table(self) -> pd.DataFrame:
        """One line per cache and condition."""
        histories = {(c["cache"], c["check"]): c for c in self.checks}
        lines = []
        for cell in self.cells:
            judged = histories.get((cell.cache, cell.check), {})
            explored = [s["schedules"] for s in self.schedules or []
                        if (s["cache"], s["check"]) == (cell.cache, cell.check)]
            lines.append({"cache": cell.cache, "check": cell.check, "promised": cell.promised,
                          "state": cell.state, "violated_in_histories": cell.histories,
                          "violated_in_schedules": cell.schedules,
                          **{k: judged.get(k) for k in ("operations", "concurrent_pairs", "violations")},
                          "schedules": sum(explored) if explored else None})
        return pd.DataFrame(lines)

    def broken_promises(self) -> list[str]:
        """A line for each promise that a cache did not keep."""
        made = []
        for cell in self.cells:
            if cell.state == kBroken:
                where = [kind for kind in ("histories", "schedules") if getattr(cell, kind)]
                made.append(f"{cell.cache} promises {words(cell.check)} and broke it ({', '.join(where)})")
        made += [f"{p['cache']} promises a {words(p['declared'])} {p['operation']} and broke that"
                 for p in self.progress or [] if p["verdict"] == "violated"]
        return made

    def weaknesses(self) -> list[str]:
        """A line for each thing that had to be seen failing and was not: then the rest proves little."""
        made = [f"{c['control']} was not seen violating {words(c['check'])} in {c['rounds']} rounds"
                for c in self.controls if c["required"] and not c["seen"]]
        made += [f"{c['control']} was not seen violating {words(c['check'])} in {c['schedules']} schedules"
                 for c in self.overstated if "caught" in c and not c["caught"]]
        named = {c["control"] for c in self.controls if c["required"]}
        made += [f"{c.control} was caught neither by histories nor by schedules" for c in self.broken_caches
                 if not c.is_caught and not c.is_excused and c.control not in named]
        made += [f"{c['control']} was not seen to {c['must']} by the check of progress"
                 for c in self.progress_controls or [] if not c["seen"]]
        return made


def words(name: str) -> str:
    """A name of the file for people: "per-record linearizable"."""
    return name.replace("per_record", "per-record").replace("wait_free", "wait-free").replace(
        "lock_free", "lock-free").replace("_", " ")


def bound_of(progress: dict) -> tuple[float | None, str]:
    """A documented bound as a number of steps and in words, each if it is given."""
    bound, steps = progress["bound"], progress.get("bound_steps")
    if isinstance(bound, kNumber):
        return bound, ""
    return (steps or None) if isinstance(steps, kNumber) else None, bound or ""


def _check(path: Path, section: str, index: int, entry) -> None:
    where = f"{path}: {section}[{index}]"
    if not isinstance(entry, dict):
        raise InputError(f"{where} is no object; a file of `icstress --json` is expected")
    for key, kind in kSections[section].items():
        value = entry.get(key, "" if key in ("witness", "replay", "note") else None)
        entry.setdefault(key, value)
        if value is None and key in ("witness", "replay", "note"):
            value = entry[key] = ""
        if not isinstance(value, kind) or isinstance(value, bool) and kind is not bool:
            raise InputError(f"{where} has no proper \"{key}\"; a file of `icstress --json` is expected")
    if section in ("checks", "schedules") and entry["verdict"] not in kVerdicts:
        raise InputError(f"{where} has the verdict '{entry['verdict']}'; known are {', '.join(kVerdicts)}")
    for point in entry.get("steps_by_interference", []):
        if not (isinstance(point, list) and len(point) == 2
                and all(isinstance(v, kNumber) and not isinstance(v, bool) for v in point)):
            raise InputError(f"{where} has steps_by_interference that are no pairs of numbers")


def read(path: Path) -> Correctness:
    """One file. Raises InputError, one line, if it is none of icstress."""
    data = read_json(path, "icstress --json FILE", "a file of `icstress --json`")
    sections = {}
    for section in kSections:
        entries = data.get(section) if isinstance(data, dict) else None
        if entries is None and section not in kRequired:
            continue
        if not isinstance(entries, list):
            raise InputError(f"{path}: no \"{section}\" list; a file of `icstress --json` is expected")
        for index, entry in enumerate(entries):
            _check(path, section, index, entry)
        sections[section] = entries
    said = data.get("not_examined")
    if said is not None and not (isinstance(said, list) and all(isinstance(s, str) for s in said)):
        raise InputError(f"{path}: \"not_examined\" is no list of strings")
    if not sections["checks"]:
        raise InputError(f"{path}: no checks; run icstress again with at least one cache and one check")
    return Correctness(path, **sections, not_examined=said)


def load(paths) -> list[Correctness]:
    """The files, each once, under names of their own. Raises InputError."""
    made = [read(path) for path in {Path(p).resolve(): Path(p) for p in reversed(paths)}.values()][::-1]
    for number, one in enumerate(made[1:], 2):
        one.slug = f"correctness-{number}"
    return made


@dataclass(frozen=True)
class Step:
    """One operation of a witness. Stamps count from the first call of the epoch; `end` None: never."""
    thread: int
    begin: int
    end: int | None
    what: str
    reason: str  # why it has to precede the next; empty where the witness is no cycle


def steps_of(witness: str) -> list[Step]:
    """The operations of a witness, in its order; empty if its form is not known."""
    made = []
    for line in witness.splitlines()[1:]:
        found = re.fullmatch(r"\s+thread (\d+) \[(\d+), (\d+|never)\] (.+)", line)
        if found:
            end = None if found[3] == "never" else int(found[3])
            made.append(Step(int(found[1]), int(found[2]), end, found[4], ""))
        elif made and line.strip():
            last = made.pop()
            made.append(Step(last.thread, last.begin, last.end, last.what, line.strip()))
    return made


def cycle_of(c: Correctness) -> tuple[str, str, list[Step]] | None:
    """(cache, witness, steps) of the cycle that teaches most, None if there is none.

    That is `wait_free` held to linearizability, which it never promised; else the shortest one.
    """
    rows = [(r.get("cache") or r["control"], r["witness"]) for r in [*c.checks, *c.controls] if r["witness"]]
    cycles = [(name, text, steps_of(text)) for name, text in rows]
    cycles = [cycle for cycle in cycles if len(cycle[2]) > 1 and all(step.reason for step in cycle[2])]
    return min(cycles, key=lambda cycle: (cycle[0] != "wait_free", len(cycle[2])), default=None)


def main() -> int:
    parser = OneLineParser(description=__doc__)
    parser.add_argument("file", type=Path, metavar="FILE", help="JSON of icstress")
    try:
        found = read(parser.parse_args().file)
    except InputError as error:
        print(f"{Path(sys.argv[0]).name}: {error}", file=sys.stderr)
        return 2
    broken, weak = found.broken_promises(), found.weaknesses()
    for line in broken:
        print(f"broken promise: {line}")
    for line in weak:
        print(f"too weak: {line}")
    if not broken and not weak:
        print(f"{style.plural(len(found.caches), 'cache')}: every promise held, and every control that had to be "
              "seen failing was")
    return 1 if broken or weak else 0


if __name__ == "__main__":
    sys.exit(main())
