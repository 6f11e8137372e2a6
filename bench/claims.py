"""The claims of README.md and bench/MEASURED.md, as bench/claims.json has them.

That file is their one place. Each has its claimed figure as these pages tell it (a median with its 95 % interval, a
range, or a value alone) and its verdict against the target of the row in bench/targets, misses included; or, where a
claim holds or does not, a command that shows it. Figures are of the first of `machines` unless the claim names its
`machine`; `elsewhere` has those of others, by machine. `seconds` is what it took on the last one that told. `readme`
has the words of a figure that the pages tell in another form, `also` what another day said, `note` with what it was
measured, where the row takes something else now or the words above a table do. `quick` are README's claims, which half
an hour is for; one that takes too long for it says why it is `outside`. A check `needs` a program that not every
machine has. Rows that share their samples name all of them as `together`. Rows are measured by `samples` of them, six
at least, where that is not bench/targets' usual eleven: fewer where samples take long, more where those left it
undecided.

bench/pages.py makes tables of them, bench/artifact.py measures them again; tests/artifact_test.py holds pages and rows
to them.
"""
from __future__ import annotations

import json
import re
import shlex
import subprocess
from pathlib import Path

kRoot = Path(__file__).resolve().parent.parent
kClaims = kRoot / "bench/claims.json"
kSecondsOfRow = 10  # given to a row that stays undecided
kNumber = r"-?\d+(?:\.\d+)?"


class Refused(Exception):
    """One line for the user."""


def name_of(claim: dict) -> str:
    return claim.get("row") or claim["check"]


def load_claims() -> tuple[dict[str, dict], list[tuple[str, list[dict]]]]:
    """The machines that claims were measured on, by name, the usual one first; and the claims by section."""
    data = json.loads(kClaims.read_text(encoding="utf-8"))
    return data["machines"], [(section["title"], section["claims"]) for section in data["sections"]]


def store_claims(machines: dict[str, dict], sections: list[tuple[str, list[dict]]]) -> None:
    """As load_claims read them, a claim a line."""
    one_a_line = ",\n".join(f"  {json.dumps(name)}: {json.dumps(m)}" for name, m in machines.items())
    lines = ["{", f' "machines": {{\n{one_a_line}\n }},', ' "sections": [']
    for title, section in sections:
        one_a_line = ",\n".join(f"   {json.dumps(c, ensure_ascii=False)}" for c in section)
        lines.append(f'  {{"title": {json.dumps(title)}, "claims": [\n{one_a_line}\n  ]}},')
    lines[-1] = lines[-1].rstrip(",")
    kClaims.write_text("\n".join([*lines, " ]", "}"]) + "\n", encoding="utf-8")


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
    own = {name: claim[name] for name in ("claimed", "verdict", "note", "also") if name in claim}
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
