"""The command line of bench/tables and what it decides: sizes, samples, counts. Python's standard library
only.

As a program it checks its arguments and does nothing else: status 0, or 2 and one line. So bench/tables
refuses wrong options before it installs, builds or measures anything; names of scenes, too, where there is a
program to ask.
"""
from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

kMaxSide = 16384
kMaxThreads = 8192
kMostChosenVpls = 32768  # half of what the program takes: converged IGI has twice as many


class BadUsage(Exception):
    """What is wrong, where, and how to mend it, in one line."""


@dataclass(frozen=True)
class Scale:
    """How much is rendered and how often it is timed."""
    size: tuple[int, int]  # pixels
    frames: int  # of an animation
    rounds: int  # in each of which every method is timed once
    reference_spp: int  # path tracing, both halves together
    vpl_counts: tuple[int, ...]  # among which a scene's number of VPLs is chosen
    vpl_seeds: int  # sets of VPLs that each count is judged by
    super_spp: int  # of supersampled IGI
    converged_vpls: int  # of the IGI that stands for the limit of many VPLs
    converged_frames: int  # the last ones, on which errors against it are measured
    few_vpls: tuple[int, ...]  # what the curve of error against time adds below vpl_counts
    neighbour_vpls: bool  # whether it has the caches at a quarter and four times the chosen number too
    accuracies: tuple[float, ...]  # of the caches, on that curve
    cell_paths: int  # of hash cells, from each visible point, in every table
    curve_paths: tuple[int, ...]  # on that curve
    mechanism_frames: int  # of an animation on which mechanisms are compared
    animated_stills: bool  # whether they are compared on the first frame of an animation, too, as a still
    preview_side: int  # largest side of an animated preview, pixels


kScales = {
    "default": Scale(
        (512, 384), frames=100, rounds=3, reference_spp=2500,
        vpl_counts=(64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384), vpl_seeds=3, super_spp=16,
        converged_vpls=32768, converged_frames=4, few_vpls=(4, 8, 16, 32), neighbour_vpls=True,
        accuracies=(0.4, 0.2, 0.1, 0.05), cell_paths=16, curve_paths=(1, 4, 16, 64), mechanism_frames=20,
        animated_stills=True, preview_side=320), "quick": Scale(
            (160, 120), frames=8, rounds=3, reference_spp=128, vpl_counts=(64, 128, 256, 512), vpl_seeds=1,
            super_spp=4, converged_vpls=4096, converged_frames=1, few_vpls=(16, ), neighbour_vpls=False,
            accuracies=(0.4, 0.2, 0.1), cell_paths=16, curve_paths=(1, 4, 16, 64), mechanism_frames=4,
            animated_stills=False, preview_side=160)
}


@dataclass(frozen=True)
class Settings:
    mode: str
    scale: Scale
    out: Path
    references: Path
    scenes: tuple[str, ...]  # asked for; empty: the thesis's
    threads: tuple[int, ...]  # on which mechanisms are compared
    accuracy: float | None  # of the caches, in every table; none: each scene's own
    igi_every: int  # of an animation's frames IGI, in both forms, renders every so many, and the last
    seed: int
    resume: bool
    only_vpls: bool  # nothing but the choice of each scene's number of VPLs
    keep_png: bool
    icbench: Path
    builds: bool  # the program is the release build's, made anew


class _Parser(argparse.ArgumentParser):
    def error(self, message):
        raise BadUsage(message)


def units() -> int:
    """Processing units that this process may use."""
    return len(os.sched_getaffinity(0))


def default_threads(count: int, mode: str) -> tuple[int, ...]:
    """1, 2, 4, ... up to all units, and four threads a unit; quickly, the last two alone."""
    if mode == "quick":
        return count, min(4 * count, kMaxThreads)
    doubled = [1 << i for i in range(count.bit_length()) if 1 << i < count]
    return tuple(dict.fromkeys([*doubled, count, min(4 * count, kMaxThreads)]))


def _whole(option: str, text: str, low: int, high: int) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", text) or not low <= int(text) <= high:
        raise BadUsage(f"{option} '{text}' is not a whole number from {low} to {high}")
    return int(text)


def _items(option: str, text: str) -> list[str]:
    items = text.split(",")
    if not all(items):
        raise BadUsage(f"{option} '{text}' has an empty item")
    if len(set(items)) != len(items):
        raise BadUsage(f"{option} '{text}' names an item twice")
    return items


def _size(text: str) -> tuple[int, int]:
    sides = text.split("x")
    if len(sides) != 2:
        raise BadUsage(f"--size '{text}' is not of the form WIDTHxHEIGHT")
    width, height = (_whole(f"--size '{text}':", side, 1, kMaxSide) for side in sides)
    return width, height


def _accuracy(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.002 <= value <= 1:
        raise BadUsage(f"--accuracy '{text}' is not a number from 0.002 to 1")
    return value


def _writable(option: str, name: str) -> Path:
    """The folder's full path. Throws if it cannot be made or written; makes nothing."""
    if not name:
        raise BadUsage(f"{option} names no folder")
    folder = Path(os.path.abspath(name))
    try:
        str(folder).encode("utf-8")
    except UnicodeEncodeError:
        raise BadUsage(f"{option}: the folder's name is no UTF-8 text; choose another folder") from None
    above = folder
    while not above.exists() and above != above.parent:
        above = above.parent
    if not above.is_dir() or not os.access(above, os.W_OK | os.X_OK):
        raise BadUsage(f"{option}: cannot write to '{folder}'; choose another folder")
    return folder


def parse(arguments: list[str]) -> Settings:
    """Raises BadUsage."""
    root = Path(__file__).resolve().parents[2]
    parser = _Parser(prog="bench/tables", add_help=False, allow_abbrev=False)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--choose-vpls", action="store_true")
    parser.add_argument("--vpls")
    parser.add_argument("--reference-spp")
    parser.add_argument("--out", default=str(root / "results" / "tables"))
    parser.add_argument("--references")
    parser.add_argument("--scenes")
    parser.add_argument("--size")
    parser.add_argument("--frames")
    parser.add_argument("--rounds")
    parser.add_argument("--threads")
    parser.add_argument("--accuracy")
    parser.add_argument("--igi-every", default="1")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--keep-frames", choices=["png"])
    parser.add_argument("--icbench")
    given = parser.parse_args(arguments)

    mode = "quick" if given.quick else "default"
    changes: dict = {}
    if given.size is not None:
        changes["size"] = _size(given.size)
    if given.frames is not None:
        changes["frames"] = _whole("--frames", given.frames, 2, 100000)
    if given.rounds is not None:
        changes["rounds"] = _whole("--rounds", given.rounds, 1, 1000)
    if given.vpls is not None:
        counts = sorted({_whole("--vpls", item, 1, kMostChosenVpls) for item in _items("--vpls", given.vpls)})
        changes["vpl_counts"] = tuple(counts)
        changes["converged_vpls"] = max(kScales[mode].converged_vpls, 2 * counts[-1])
    if given.reference_spp is not None:
        changes["reference_spp"] = _whole("--reference-spp", given.reference_spp, 2, 10**6)
        if changes["reference_spp"] % 2:  # two halves tell the reference's own error
            raise BadUsage(f"--reference-spp '{given.reference_spp}' is odd; give an even number")
    scale = Scale(**{**kScales[mode].__dict__, **changes})
    # The first frame, in which temporal instant caching has nothing to keep, is no converged one.
    few = {"converged_frames": min(scale.converged_frames, scale.frames - 1),
           "mechanism_frames": min(scale.mechanism_frames, scale.frames)}
    scale = Scale(**{**scale.__dict__, **few})
    threads = default_threads(units(), mode)
    if given.threads is not None:
        threads = tuple(
            sorted(_whole("--threads", item, 1, kMaxThreads) for item in _items("--threads", given.threads)))
    out = _writable("--out", given.out)
    references = out / "references"
    if given.references is not None:
        references = _writable("--references", given.references)
    return Settings(mode, scale, out, references,
                    tuple(_items("--scenes", given.scenes)) if given.scenes is not None else (), threads,
                    _accuracy(given.accuracy) if given.accuracy is not None else None,
                    _whole("--igi-every", given.igi_every, 1, 100000),
                    _whole("--seed", given.seed, 0, 10**9 - 1), given.resume, given.choose_vpls,
                    given.keep_frames == "png",
                    Path(os.path.abspath(given.icbench or root / "build" / "release" / "bin" / "icbench")),
                    given.icbench is None)


def known_scenes(icbench: Path) -> dict[str, dict]:
    """What the program lists of each, by name. Raises BadUsage if it cannot tell."""
    command = [str(icbench), "list", "scenes", "--json"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL)
        entries = json.loads(done.stdout)
        return {e["name"]: e for e in entries if not e.get("analytic")}
    except OSError as error:
        raise BadUsage(f"{icbench}: {error.strerror}; build it, or name another with --icbench") from None
    except (ValueError, TypeError, KeyError, AttributeError):
        raise BadUsage(f"{shlex.join(command)} lists no scenes; build it, or name another with --icbench") from None


def require_scenes(settings: Settings, known: dict[str, dict]) -> None:
    """Raises BadUsage if a scene that was asked for is neither known nor a file."""
    for name in settings.scenes:
        if name not in known and not Path(name).is_file():
            raise BadUsage(f"--scenes: there is no scene and no file '{name}'; the scenes of {settings.icbench} are "
                           f"{', '.join(known)}")


def refuse_unknown_scenes(settings: Settings) -> None:
    """Raises BadUsage before anything is built, if there is a program that knows better. One that is built anew and
    cannot tell its scenes is not asked.
    """
    try:
        known = known_scenes(settings.icbench)
    except BadUsage:
        if settings.builds:
            return
        raise
    require_scenes(settings, known)


def main() -> int:
    try:
        settings = parse(sys.argv[1:])
        refuse_unknown_scenes(settings)
    except BadUsage as error:
        print(f"bench/tables: {error}; see --help", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
