"""The claims of README.md and bench/MEASURED.md; bench/artifact measures them again, once everything is built.

bench/claims.json is their one place. Each has its claimed figure as these pages tell it (a median with its 95 %
interval, a range, or a value alone) and its verdict against the target of the row in bench/targets, misses included;
or, where a claim holds or does not, a command that shows it. Figures are of the first of `machines` unless the claim
names its `machine`; `elsewhere` has those of others, by machine. `seconds` is what it took on the last one that told.
`readme` has the words of a figure that the pages tell in another form. `quick` are README's claims, which half an hour
is for; one that takes too long for it says why it is `outside`. A check `needs` a program that not every machine has.
Rows that share their samples name all of them as `together`. Rows whose samples take long are measured by `samples` of
them, six at least, instead of bench/targets' usual eleven.
tests/artifact_test.py holds them and ARTIFACT.md to it.
"""
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

kRoot = Path(__file__).resolve().parent.parent
kClaims = kRoot / "bench/claims.json"
kSecondsOfRow = 10  # given to a row that stays undecided
kQuickMinutes = 30
kNumber = r"-?\d+(?:\.\d+)?"


class Refused(Exception):
    """One line for the user."""


class TimeUp(Exception):
    """The quick path's half hour is over."""


def name_of(claim: dict) -> str:
    return claim.get("row") or claim["check"]


def load_claims() -> tuple[dict[str, dict], list[tuple[str, list[dict]]]]:
    """The machines that claims were measured on, by name, the usual one first; and the claims by section."""
    data = json.loads(kClaims.read_text(encoding="utf-8"))
    return data["machines"], [(section["title"], section["claims"]) for section in data["sections"]]


def this_machine(machines: dict[str, dict], cpuinfo: str = "/proc/cpuinfo") -> str:
    """The machine whose processor this one has, else the first."""
    try:
        first = Path(cpuinfo).read_text(encoding="utf-8").split("\n\n", 1)[0]
    except OSError:
        first = ""
    fields = dict(re.findall(r"^(.*?)\s*: (.*)$", first, re.MULTILINE))
    return next((name for name, m in machines.items() if m["cpu"].items() <= fields.items()), next(iter(machines)))


def figures_of(claim: dict, machines: dict[str, dict]) -> dict[str, dict]:
    """What is claimed of a row, by machine, the verdict, and what another day said: that of the claim itself first."""
    own = {name: claim[name] for name in ("claimed", "verdict", "also") if name in claim}
    return {claim.get("machine", next(iter(machines))): own, **claim.get("elsewhere", {})}


def interval_of(claimed: str) -> tuple[float, float]:
    """The interval of "M [LOW, HIGH]" or "LOW to HIGH"; of "M" alone, all that is rounded to it."""
    numbers = re.findall(kNumber, claimed)
    if len(numbers) == 3 and "[" in claimed:
        return float(numbers[1]), float(numbers[2])
    if len(numbers) == 2 and " to " in claimed:
        return float(numbers[0]), float(numbers[1])
    if len(numbers) == 1:
        half = 0.5 * 10.0 ** -len(numbers[0].partition(".")[2])
        return float(numbers[0]) - half, float(numbers[0]) + half
    raise ValueError(f"no figure: {claimed}")


def known_rows(targets: Path) -> dict[str, tuple[str, str]]:
    """Target and meaning of every row of bench/targets."""
    try:
        listed = subprocess.run([targets, "--list"], capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        raise Refused(f"cannot list the rows of {targets}: {error}; build it: bench/targets") from None
    rows = {}
    for line in listed.splitlines():
        name, at, bound, value, what = line.split(None, 4)
        rows[name] = (f"{at} {bound} {value}", what)
    return rows


def kept_in(out: Path) -> dict:
    """What was measured before, by name."""
    kept = out / "artifact.json"
    try:
        return json.loads(kept.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise Refused(f"{kept} cannot be read ({error}); move it away") from None


def rows_with(claim: dict) -> list[str]:
    """The rows that are measured when this one is: itself, and those that share its samples."""
    return claim.get("together", [claim["row"]])


def options_of(claim: dict) -> list[str]:
    """What bench/targets is asked for the claim's row."""
    fewer = ["--samples", str(claim["samples"])] if "samples" in claim else []
    return ["--seconds", str(kSecondsOfRow), *fewer, "--rows", ",".join(rows_with(claim))]


def command_of(claim: dict, out: str) -> str:
    if "row" in claim:
        return shlex.join(["build/release/bin/targets", *options_of(claim)])
    return claim["command"].replace("{out}", out)


def time_of(claim: dict) -> str:
    seconds = claim.get("seconds")
    fewer = f" (`--samples {claim['samples']}`)" if "samples" in claim else ""
    if seconds is None:
        return "not timed" + fewer
    return (f"{seconds} s" if seconds < 120 else f"{seconds / 60:.0f} min") + fewer


def path_of(claim: dict) -> str:
    """Whether the claim is on the quick path, and why not where it should be."""
    return "yes" if claim.get("quick") else f"no: {claim['outside']}" if "outside" in claim else ""


def misses(rows: dict[str, tuple[str, str]]) -> list[str]:
    """The rows that pass not everywhere, with the machines on which they miss or stay undecided."""
    machines, sections = load_claims()
    claims = [c for _, section in sections for c in section if "row" in c]
    short = []
    for c in claims:
        on = {verdict: [name for name, told in figures_of(c, machines).items() if told["verdict"] == verdict]
              for verdict in ("fail", "undecided", "pass")}
        if on["fail"] or on["undecided"]:
            short.append(f"| `{c['row']}` | {rows[c['row']][0]} | "
                         f"{' | '.join(', '.join(names) for names in on.values())} |")
    return ["### Which figures are not reached", "",
            f"Of {len(claims)} rows {len(claims) - len(short)} reach their targets on every machine on which they were "
            f"measured, and {len(short)} do not:", "",
            "| row | target | missed on | undecided on | reached on |", "|---|---|---|---|---|", *short, ""]


def tables(rows: dict[str, tuple[str, str]]) -> str:
    """ARTIFACT.md from its first table on."""
    machines, sections = load_claims()
    lines = misses(rows)
    usual = next(iter(machines))
    for title, claims in sections:
        if "row" in claims[0]:
            lines += [f"### {title}", "", "| row | what | target | claimed | verdict | time | quick |",
                      "|---|---|---|---|---|---|---|"]
            for c in claims:
                target, what = rows[c["row"]]
                claimed, verdicts = [], []
                for machine, told in figures_of(c, machines).items():
                    where = "" if machine == usual else f"{machine}: "
                    also = f"; another day {told['also']}" if "also" in told else ""
                    claimed.append(f"{where}{told['claimed']}{also}")
                    verdicts.append(where + {"fail": "**miss**"}.get(told["verdict"], told["verdict"]))
                claimed, verdict = "; ".join(claimed), "; ".join(verdicts)
                cells = (f"`{c['row']}`", what, target, claimed, verdict, time_of(c), path_of(c))
                lines.append(f"| {' | '.join(cells)} |")
        else:
            lines += [f"### {title}", ""]
            for c in claims:
                lines += [f"- `{c['check']}` (quick: {path_of(c)}; {time_of(c)}): {c['claim']}", "",
                          *(f"      {part}" for part in command_of(c, "results/artifact").split(" && ")), ""]
        if lines[-1]:
            lines.append("")
    return "\n".join(lines).rstrip("\n") + "\n"


def write(out: Path, rows: dict[str, tuple[str, str]]) -> None:
    """Brings ARTIFACT.md's tables up to date, and before that the times of what was measured in `out`."""
    machines, sections = load_claims()
    measured = kept_in(out)
    one_a_line = ",\n".join(f"  {json.dumps(name)}: {json.dumps(m)}" for name, m in machines.items())
    lines = ["{", f' "machines": {{\n{one_a_line}\n }},', ' "sections": [']
    for title, claims in sections:
        for c in claims:
            if name_of(c) in measured:
                c["seconds"] = max(1, round(measured[name_of(c)]["seconds"]))
        one_a_line = ",\n".join(f"   {json.dumps(c, ensure_ascii=False)}" for c in claims)
        lines.append(f'  {{"title": {json.dumps(title)}, "claims": [\n{one_a_line}\n  ]}},')
    lines[-1] = lines[-1].rstrip(",")
    kClaims.write_text("\n".join([*lines, " ]", "}"]) + "\n", encoding="utf-8")
    page = kRoot / "ARTIFACT.md"
    text = page.read_text(encoding="utf-8")
    page.write_text(text[:text.index("\n### ") + 1] + tables(rows), encoding="utf-8")


# --- Measuring --------------------------------------------------------------------------------------------------------

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
        self.built = built.hexdigest()

    def _keep(self) -> None:
        partial = self.out / "artifact.new"
        partial.write_text(json.dumps(self.results, indent=1) + "\n", encoding="utf-8")
        os.replace(partial, self.out / "artifact.json")

    def measured(self, claim: dict, deadline: float = math.inf) -> dict:
        """What the claim's command says, from an earlier run of the same programs and command if there was one.

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
        results = self._rows(claim, deadline - start) if "row" in claim else \
            {name: self._check(claim, command)}
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
    if "check" in claim:
        return verdict, verdict != "holds"
    low, high = interval_of(told["claimed"])
    within = result["low"] <= high and low <= result["high"]
    other = {verdict, told["verdict"]} == {"pass", "fail"}
    return ("in" if within else "out") + (f", but {told['verdict']} became {verdict}" if other else ""), other


def figure(result: dict) -> str:
    if result.get("median") is None:
        return "-"
    return f"{result['median']:.3f} [{result['low']:.3f}, {result['high']:.3f}]"


def run(options: argparse.Namespace) -> int:
    machines, sections = load_claims()
    if options.machine and options.machine not in machines:
        raise Refused(f"no machine '{options.machine}'; there are {', '.join(machines)}")
    machine = options.machine or this_machine(machines)
    claims = [c for _, section in sections for c in section]
    known = {name_of(c): c for c in claims}
    if options.only:
        for name in options.only.split(","):
            if name not in known:
                raise Refused(f"no claim '{name}'; ARTIFACT.md names them all")
        claims = [known[name] for name in options.only.split(",")]
    else:
        claims.sort(key=lambda c: not c.get("quick"))
        if not options.full:
            claims = [c for c in claims if c.get("quick")]
    out = Path(options.out).resolve()
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Refused(f"cannot write to {out}: {error.strerror}; choose another --out") from None
    judged = Judge(out, Path(options.programs))
    print(f"claimed on {machines[machine]['hardware']}; where another machine is named, on that\n\n"
          f"{'claim':<34} {'target':<16} {'claimed':<24} {'':<10} {'measured':<24} {'':<10} interval")
    rows = known_rows(Path(options.programs) / "targets")
    contradicted, seconds, counts = [], 0.0, {}
    is_quick = not options.full and not options.only
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
        kind = re.split("[,:(]", said)[0].rstrip()
        counts[kind] = counts.get(kind, 0) + 1
        seconds += result["seconds"]
        if contradicts:
            contradicted.append(name_of(c))
        target, measured = (rows[c["row"]][0], figure(result)) if "row" in c else ("", "")
        print(f"{name_of(c):<34} {target:<16} {told.get('claimed', 'holds'):<24} {told.get('verdict', ''):<10} "
              f"{measured:<24} {result['verdict']:<10} {said}", flush=True)
    told = ", ".join(f"{n} {what}" for what, n in counts.items())
    print(f"\n{len(claims)} claims in {seconds / 60:.1f} minutes: {told}; "
          f"contradicted: {', '.join(contradicted) or 'none'}")
    return 1 if contradicted else 0


def main() -> int:
    parser = argparse.ArgumentParser(prog="bench/artifact", allow_abbrev=False)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--only", default="")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--machine", default="")
    parser.add_argument("--out", default=str(kRoot / "results/artifact"))
    parser.add_argument("--programs", default=str(kRoot / "build/release/bin"))
    try:
        options, rest = parser.parse_known_args()
        if rest:
            raise Refused(f"unknown option '{rest[0]}'; see --help")
        if options.write:
            write(Path(options.out), known_rows(Path(options.programs) / "targets"))
            return 0
        return run(options)
    except Refused as error:
        print(f"bench/artifact: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
