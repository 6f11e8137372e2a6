"""bench/artifact, once everything is built: measures the claims again, or brings the pages up to date."""
from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pages
from claims import (Refused, command_of, figures_of, interval_of, kRoot, known_rows, load_claims, name_of, options_of,
                    rows_with, store_claims, this_machine)
from tables_lib.folder_lock import Taken, lock_folder
from tables_lib.jobs import identity_of_machine

kQuickMinutes = 30


def say(text: str) -> None:
    print(f"bench/artifact: {text}", file=sys.stderr, flush=True)


class TimeUp(Exception):
    """The quick path's half hour is over."""


def kept_in(out: Path) -> dict:
    """What was measured before, by name."""
    kept = out / "artifact.json"
    try:
        results = json.loads(kept.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise Refused(f"{kept} cannot be read ({error}); move it away") from None
    fields = {"identity", "seconds", "verdict"}
    if not isinstance(results, dict) or not all(isinstance(r, dict) and fields <= r.keys() for r in results.values()):
        raise Refused(f"{kept} holds no measured claims; move it away")
    return results


class Judge:
    """Measures claims, keeps what was measured, and says how it compares."""

    def __init__(self, out: Path, programs: Path):
        self.out, self.programs = out, programs.resolve()
        self.results = kept_in(out)
        built = hashlib.sha256()
        for name in ("targets", "icbench", "icstress"):
            try:
                built.update((programs / name).read_bytes())
            except OSError as error:
                raise Refused(f"cannot read {programs / name}: {error.strerror}; build it: bench/artifact") from None
        built.update(identity_of_machine().encode())  # a folder may be seen by several machines of one kind
        self.built = built.hexdigest()

    def _keep(self) -> None:
        partial = self.out / "artifact.new"
        partial.write_text(json.dumps(self.results, indent=1) + "\n", encoding="utf-8")
        os.replace(partial, self.out / "artifact.json")

    def measured(self, claim: dict, deadline: float = math.inf) -> dict:
        """What the claim's command says, from an earlier run of the same programs and command on this machine if there
        was one; that it was not measured, where bench/targets says so, which costs no other claim.

        Raises TimeUp at the deadline, in terms of time.monotonic().
        """
        name, command = name_of(claim), command_of(claim, shlex.quote(str(self.out)))
        identity = hashlib.sha256(f"{self.built} {command}".encode()).hexdigest()
        kept = self.results.get(name, {})
        if kept.get("identity") == identity and kept["verdict"] != "skipped":  # the machine may be idle now
            return kept
        start = time.monotonic()
        if start >= deadline:
            raise TimeUp
        try:
            results = self._rows(claim, deadline - start) if "row" in claim else \
                {name: self._check(claim, command)}
        except Refused as error:  # not kept: it may go the next time
            self._keep()  # on a full disk the others would be lost as well: it ends the run
            return {"verdict": "not measured", "why": str(error), "seconds": round(time.monotonic() - start, 1)}
        seconds = round((time.monotonic() - start) / len(results), 1)
        for each, result in results.items():
            self.results[each] = {"identity": identity, "command": command, "seconds": seconds, **result}
        self._keep()
        return self.results[name]

    def _rows(self, claim: dict, seconds: float) -> dict[str, dict]:
        answer = self.out / "row.json"
        answer.unlink(missing_ok=True)
        try:
            done = subprocess.run([self.programs / "targets", *options_of(claim), "--json", answer],
                                  capture_output=True, text=True, stdin=subprocess.DEVNULL,
                                  timeout=None if seconds == math.inf else seconds)
        except subprocess.TimeoutExpired:
            raise TimeUp from None
        if done.returncode not in (0, 1):
            said = done.stderr.strip().splitlines() or [f"status {done.returncode}"]
            raise Refused(f"{','.join(rows_with(claim))}: {said[-1]}")
        rows = json.loads(answer.read_text(encoding="utf-8"))
        answer.unlink()
        return {row["name"]: {key: row[key] for key in ("median", "low", "high", "samples", "verdict", "why")}
                for row in rows}

    def _check(self, claim: dict, command: str) -> dict:
        needed = claim.get("needs")
        if needed and not shutil.which(needed):
            return {"verdict": "skipped", "why": f"no {needed} here; install it"}
        log = self.out / f"{claim['check']}.log"
        with open(log, "w", encoding="utf-8") as said:
            command = command.replace("build/release/bin", shlex.quote(str(self.programs)))
            status = subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], cwd=kRoot, stdin=subprocess.DEVNULL,
                                    stdout=said, stderr=subprocess.STDOUT).returncode
        text = log.read_text(encoding="utf-8", errors="replace")
        holds = status == 0 and re.search(claim["says"], text) is not None
        return {"verdict": "holds" if holds else "does not hold", "why": "" if holds else f"status {status}; see {log}"}


def judge(claim: dict, told: dict, result: dict) -> tuple[str, bool]:
    """What the measurement says of the claim, told as by figures_of, and whether it contradicts it."""
    verdict = result["verdict"]
    if verdict == "skipped":
        return f"skipped: {result['why']}", False
    if verdict == "not measured":
        return verdict, False
    if "check" in claim:
        return verdict, verdict != "holds"
    low, high = interval_of(told["claimed"])
    has_figure = result["low"] is not None
    within = has_figure and result["low"] <= high and low <= result["high"]
    other = {verdict, told["verdict"]} == {"pass", "fail"}
    said = ("in" if within else "out") + (f", but {told['verdict']} became {verdict}" if other else "")
    return said if has_figure else f"{said}: {result['why']}", other


def figure(result: dict) -> str:
    if result.get("median") is None:
        return "-"
    return f"{result['median']:.3f} [{result['low']:.3f}, {result['high']:.3f}]"


def write(out: Path, programs: Path) -> None:
    """Brings the pages' tables up to date, and before that the times of what was measured in `out`."""
    machines, sections = load_claims()
    measured = kept_in(out)
    for claim in (c for _, section in sections for c in section if name_of(c) in measured):
        claim["seconds"] = max(1, round(measured[name_of(claim)]["seconds"]))
    store_claims(machines, sections)
    pages.write(known_rows(programs / "targets"))


def run(options: argparse.Namespace) -> int:
    machines, sections = load_claims()
    if options.machine and options.machine not in machines:
        raise Refused(f"no machine '{options.machine}'; there are {', '.join(machines)}")
    machine = options.machine or this_machine(machines)
    claims = [c for _, section in sections for c in section]
    known = {name_of(c): c for c in claims}
    if options.only is not None:
        names = options.only.split(",")
        for name in names:
            if name not in known:
                raise Refused(f"no claim '{name}'; ARTIFACT.md names them all")
            if names.count(name) > 1:
                raise Refused(f"--only names '{name}' twice")
        claims = [known[name] for name in names]
    else:
        claims.sort(key=lambda c: not c.get("quick"))
        if not options.full:
            claims = [c for c in claims if c.get("quick")]
    if options.check:
        return 0
    out = Path(options.out).resolve()
    try:
        out.mkdir(parents=True, exist_ok=True)
        lock_folder(out, "--out")  # until this process ends
    except OSError as error:
        raise Refused(f"cannot write to {out}: {error.strerror}; choose another --out") from None
    judged = Judge(out, Path(options.programs))
    print(f"claimed on {machines[machine]['hardware']}; where another machine is named, on that\n\n"
          f"{'claim':<34} {'target':<16} {'claimed':<24} {'':<10} {'measured':<24} {'':<10} interval")
    rows = known_rows(Path(options.programs) / "targets")
    contradicted, seconds, counts = [], 0.0, {}
    is_quick = not options.full and options.only is None
    deadline = time.monotonic() + 60 * kQuickMinutes if is_quick else math.inf
    for number, c in enumerate(claims):
        try:
            result = judged.measured(c, deadline)
        except TimeUp:
            left = [name_of(c) for c in claims[number:]]
            print(f"\n{kQuickMinutes} minutes are over; start again to go on with {', '.join(left)}")
            claims = claims[:number]
            break
        figures = figures_of(c, machines) if "row" in c else {}
        where = machine if machine in figures else next(iter(figures), machine)
        told = figures.get(where, {})
        said, contradicts = judge(c, told, result)
        if where != machine:
            said += f" ({where})"
        if "note" in told:
            said += f" (claimed with {told['note']})"
        kind = re.split("[,:(]", said)[0].rstrip()
        counts[kind] = counts.get(kind, 0) + 1
        seconds += result["seconds"]
        if contradicts:
            contradicted.append(name_of(c))
        if result["verdict"] == "not measured":
            say(result["why"])
        target, measured = (rows[c["row"]][0], figure(result)) if "row" in c else ("", "")
        print(f"{name_of(c):<34} {target:<16} {told.get('claimed', 'holds'):<24} {told.get('verdict', ''):<10} "
              f"{measured:<24} {result['verdict']:<10} {said}", flush=True)
    told = ", ".join(f"{n} {what}" for what, n in counts.items())
    print(f"\n{len(claims)} claims in {seconds / 60:.1f} minutes: {told}; "
          f"contradicted: {', '.join(contradicted) or 'none'}")
    return 1 if contradicted else 2 if "not measured" in counts else 0


def main() -> int:
    parser = argparse.ArgumentParser(prog="bench/artifact", allow_abbrev=False)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--only")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--check", action="store_true")  # that the options are right, and no more
    parser.add_argument("--machine", default="")
    parser.add_argument("--out", default=str(kRoot / "results/artifact"))
    parser.add_argument("--programs", default=str(kRoot / "build/release/bin"))
    try:
        options, rest = parser.parse_known_args()
        if rest:
            raise Refused(f"unknown option '{rest[0]}'; see --help")
        if options.quick + options.full + options.write + (options.only is not None) > 1:
            raise Refused("--quick, --full, --only and --write are four things to do; choose one")
        if options.write and not options.check:
            write(Path(options.out), Path(options.programs))
            return 0
        return run(options)
    except (Refused, Taken) as error:
        say(str(error))
    except OSError as error:
        say(f"{error.filename or 'input or output'}: {error.strerror}; mend it and start again to go on")
    return 2


if __name__ == "__main__":
    sys.exit(main())
