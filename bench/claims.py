"""The claims of README.md: bench/artifact measures them again by this file, once everything is built.

bench/claims.json is their one place. Each has its claimed figure as README.md tells it (a median with its 95 %
interval, a range, or a value alone) and its verdict against the target of the row in bench/targets, misses included;
or, where a claim holds or does not, a command that shows it. `seconds` is what it took on the machine of `hardware`.
tests/artifact_test.py holds README.md and ARTIFACT.md to it.
"""
from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import re
import shlex
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


def load_claims() -> tuple[str, list[tuple[str, list[dict]]]]:
    """The hardware that the claims were measured on, and the claims by section."""
    data = json.loads(kClaims.read_text(encoding="utf-8"))
    return data["hardware"], [(section["title"], section["claims"]) for section in data["sections"]]


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


def command_of(claim: dict, out: str) -> str:
    if "row" in claim:
        return f"build/release/bin/targets --seconds {kSecondsOfRow} --rows {claim['row']}"
    return claim["command"].replace("{out}", out)


def time_of(claim: dict) -> str:
    seconds = claim.get("seconds")
    if seconds is None:
        return "not timed"
    return f"{seconds} s" if seconds < 120 else f"{seconds / 60:.0f} min"


def tables(rows: dict[str, tuple[str, str]]) -> str:
    """ARTIFACT.md from its first table on."""
    lines = []
    for title, claims in load_claims()[1]:
        if "row" in claims[0]:
            lines += [f"### {title}", "", "| row | what | target | claimed | verdict | time | quick |",
                      "|---|---|---|---|---|---|---|"]
            for c in claims:
                target, what = rows[c["row"]]
                claimed = c["claimed"] + (f"; another day {c['also']}" if "also" in c else "")
                verdict = {"fail": "**miss**"}.get(c["verdict"], c["verdict"])
                quick = "yes" if c.get("quick") else ""
                lines.append(f"| `{c['row']}` | {what} | {target} | {claimed} | {verdict} | {time_of(c)} | {quick} |")
        else:
            lines += [f"### {title}", ""]
            for c in claims:
                lines += [f"- `{c['check']}`{', quick' if c.get('quick') else ''} ({time_of(c)}): {c['claim']}", "",
                          *(f"      {part}" for part in command_of(c, "results/artifact").split(" && ")), ""]
        if lines[-1]:
            lines.append("")
    return "\n".join(lines).rstrip("\n") + "\n"


def write(out: Path, rows: dict[str, tuple[str, str]]) -> None:
    """Brings ARTIFACT.md's tables up to date, and before that the times of what was measured in `out`."""
    hardware, sections = load_claims()
    measured = kept_in(out)
    lines = ["{", f' "hardware": {json.dumps(hardware)},', ' "sections": [']
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
        result = self._row(claim, deadline - start) if "row" in claim else self._check(claim, command)
        result = {"identity": identity, "command": command, "seconds": round(time.monotonic() - start, 1), **result}
        self.results[name] = result
        self._keep()
        return result

    def _row(self, claim: dict, seconds: float) -> dict:
        answer = self.out / "row.json"
        answer.unlink(missing_ok=True)
        try:
            done = subprocess.run([self.programs / "targets", "--seconds", str(kSecondsOfRow), "--rows", claim["row"],
                                   "--json", answer], capture_output=True, text=True, stdin=subprocess.DEVNULL,
                                  timeout=None if seconds == math.inf else seconds)
        except subprocess.TimeoutExpired:
            raise TimeUp from None
        if done.returncode not in (0, 1):
            raise Refused(f"{claim['row']}: {(done.stderr.strip().splitlines() or [f'status {done.returncode}'])[-1]}")
        row, = json.loads(answer.read_text(encoding="utf-8"))
        answer.unlink()
        return {key: row[key] for key in ("median", "low", "high", "samples", "verdict", "why")}

    def _check(self, claim: dict, command: str) -> dict:
        log = self.out / f"{claim['check']}.log"
        with open(log, "w", encoding="utf-8") as said:
            command = command.replace("build/release/bin", shlex.quote(str(self.programs)))
            status = subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], cwd=kRoot, stdin=subprocess.DEVNULL,
                                    stdout=said, stderr=subprocess.STDOUT).returncode
        text = log.read_text(encoding="utf-8", errors="replace")
        holds = status == 0 and re.search(claim["says"], text) is not None
        return {"verdict": "holds" if holds else "does not hold", "why": "" if holds else f"status {status}; see {log}"}


def judge(claim: dict, result: dict) -> tuple[str, bool]:
    """What the measurement says of the claim, and whether it contradicts it."""
    verdict = result["verdict"]
    if "check" in claim:
        return verdict, verdict != "holds"
    if result["median"] is None:
        return f"skipped: {result['why']}", False
    low, high = interval_of(claim["claimed"])
    within = result["low"] <= high and low <= result["high"]
    other = {verdict, claim["verdict"]} == {"pass", "fail"}
    return ("in" if within else "out") + (f", but {claim['verdict']} became {verdict}" if other else ""), other


def figure(result: dict) -> str:
    if result.get("median") is None:
        return "-"
    return f"{result['median']:.3f} [{result['low']:.3f}, {result['high']:.3f}]"


def run(options: argparse.Namespace) -> int:
    hardware, sections = load_claims()
    claims = [c for _, section in sections for c in section]
    known = {name_of(c): c for c in claims}
    if options.only:
        for name in options.only.split(","):
            if name not in known:
                raise Refused(f"no claim '{name}'; ARTIFACT.md names them all")
        claims = [known[name] for name in options.only.split(",")]
    elif not options.full:
        claims = [c for c in claims if c.get("quick")]
    out = Path(options.out).resolve()
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Refused(f"cannot write to {out}: {error.strerror}; choose another --out") from None
    judged = Judge(out, Path(options.programs))
    print(f"claimed on {hardware}\n\n{'claim':<34} {'target':<16} {'claimed':<24} {'':<10} {'measured':<24} {'':<10} "
          "interval")
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
        said, contradicts = judge(c, result)
        kind = re.split("[,:]", said)[0]
        counts[kind] = counts.get(kind, 0) + 1
        seconds += result["seconds"]
        if contradicts:
            contradicted.append(name_of(c))
        print(f"{name_of(c):<34} {rows[c['row']][0] if 'row' in c else '':<16} {c.get('claimed', 'holds'):<24} "
              f"{c.get('verdict', ''):<10} {figure(result) if 'row' in c else '':<24} {result['verdict']:<10} {said}",
              flush=True)
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
