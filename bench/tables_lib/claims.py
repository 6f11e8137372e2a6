"""What the thesis claims, held against what was measured; and the figures that this project wants to reach.

A claim is "seen" when the whole interval of every scene agrees with it, "not seen" when the whole interval of
some scene contradicts it, else "undecided". Each part of a claim names its scene, the figure, and what would
agree.
"""
from __future__ import annotations

from arithmetic import decide, exact, worst
from thesis import (kFarFaster, kFarFasterOn, kIndirectTimes, kMostAgainstIgi, kMostAgainstPath,
                    kReferenceSamples, kSlowestAgainstStatic, kWholeFrameRange)

kWords = {"pass": "seen", "fail": "not seen", "undecided": "undecided"}
kUnchanged = 1.25  # "do not change": within this factor
kMinutes = 60.0  # "takes minutes": seconds a frame at least
kInteractive = 1.0  # "interactive": frames a second at least
kScales = 0.95  # "does not scale": a lock's speed over the wait-free one's at most


def _part(where: str, figure: dict | None, relation: str, target: float, unit: str = "") -> dict:
    return {
        "where": where, "figure": figure, "relation": relation, "target": target, "unit": unit,
        "verdict": decide(figure, relation, target)
    }


def _claim(name: str, says: str, how: str, parts: list[dict], remark: str = "") -> dict:
    return {
        "name": name, "says": says, "how": how, "parts": parts, "remark": remark,
        "verdict": kWords[worst(p["verdict"] for p in parts)]
    }


def _path(tree, *keys):
    for key in keys:
        tree = tree.get(key) if isinstance(tree, dict) else None
    return tree


def _perceived(scene: dict, pair: str) -> dict | None:
    return exact(_path(scene, "quality", pair, "p75"))


def _quotient(a: dict | None, b: dict | None) -> dict | None:
    """Of two figures that were not measured in one round: the widest interval that theirs allow."""
    if not a or not b or not b["median"]:
        return None
    low = a["low"] / b["high"] if a["low"] is not None and b["high"] else None
    high = a["high"] / b["low"] if a["high"] is not None and b["low"] else None
    return {"median": a["median"] / b["median"], "low": low, "high": high, "n": min(a["n"], b["n"])}


def _whole_frames(scenes: dict) -> dict:
    low, high = kWholeFrameRange
    parts = [
        _part(s["title"], _path(s, "time", "whole_over_tic", "igi"), "at_least", low, "×")
        for s in scenes.values() if s["time"]
    ]
    return _claim("whole_frames", f"TIC renders whole frames {low} to {high} times as fast as IGI.",
                  f"Whole-frame time of IGI over that of TIC is at least {low} on every scene.", parts)


def _moving_objects(scenes: dict) -> list[dict]:
    few, many = scenes.get("bunnies_1"), scenes.get("bunnies_9")
    parts, shrinks = [], []
    if few and many and few["time"] and many["time"]:
        for method in ("igi", "ic"):
            change = _quotient(*(_path(s, "time", "methods", method, "seconds_indirect")
                                 for s in (many, few)))
            where = f"{method.upper()}, Bunnies 9 over Bunnies 1"
            parts += [
                _part(where, change, "at_most", kUnchanged, "×"),
                _part(where, change, "at_least", 1 / kUnchanged, "×")
            ]
        shrinks = [
            _part("(IC / TIC on Bunnies 9) over (the same on Bunnies 1)",
                  _quotient(*(_path(s, "time", "indirect_over_tic", "ic") for s in (many, few))), "at_most",
                  1, "×")
        ]
    return [
        _claim(
            "static_methods", "IGI and static IC do not change with the number of moving objects.",
            f"Their indirect time on Bunnies 9 is within a factor of {kUnchanged} of that on Bunnies 1. (The "
            "scenes also "
            "differ in how much geometry they hold.)", parts),
        _claim("shrinking_advantage", "TIC's advantage shrinks towards IC's as more objects move.",
               "Its speed-up over static IC is smaller on Bunnies 9 than on Bunnies 1.", shrinks)
    ]


def _overhead(scenes: dict) -> dict:
    parts = [
        _part(
            s["title"],
            _quotient(_path(s, "time", "whole_over_tic", "igi"), _path(s, "time", "indirect_over_tic",
                                                                       "igi")), "at_most", 1, "×")
        for s in scenes.values() if s["time"]
    ]
    return _claim(
        "shared_overhead",
        "Whole-frame speed-ups are smaller than those of the indirect light alone: primary "
        "rays and direct light cost all methods the same.",
        "IGI / TIC for whole frames over IGI / TIC for the indirect light is below 1.", parts)


def _perception(scenes: dict) -> list[dict]:
    return [
        _claim("no_loss_against_igi",
               f"No perceived loss against IGI: at most {kMostAgainstIgi} % of pixels.",
               "HDR-VDP, P > 75 %, TIC against IGI, last frame.", [
                   _part(s["title"], _perceived(s, "tic_igi"), "at_most", kMostAgainstIgi, "%")
                   for s in scenes.values()
               ]),
        _claim("little_loss_against_path",
               f"Very little against path tracing: at most {kMostAgainstPath} % of pixels.",
               "HDR-VDP, P > 75 %, TIC against path tracing, last frame.", [
                   _part(s["title"], _perceived(s, "tic_path"), "at_most", kMostAgainstPath, "%")
                   for s in scenes.values()
               ], _clean_remark(scenes))
    ]


def _clean_remark(scenes: dict) -> str:
    clean = [_path(s, "quality", "tic_path_clean", "p75") for s in scenes.values()]
    clean = [value for value in clean if value is not None]
    return (
        "This counts the noise of direct light and the aliasing that RT has too. With converged direct "
        "light it is at "
        f"most {max(clean):.2f} %.") if clean else ""


def _minutes(scenes: dict) -> dict:
    parts = []
    for scene in scenes.values():
        if not scene["time"]:
            continue
        seconds, spp = _path(scene, "reference", "seconds"), _path(scene, "reference", "spp")
        whole = exact(seconds * kReferenceSamples / spp) if seconds and spp else None
        parts += [
            _part(f"{scene['title']}, path tracing, {kReferenceSamples:,} samples", whole, "at_least",
                  kMinutes, "s"),
            _part(f"{scene['title']}, TIC", _path(scene, "time", "methods", "tic", "frames_per_second"),
                  "at_least", kInteractive, "frames/s")
        ]
    return _claim(
        "minutes", "Path tracing takes minutes where TIC is interactive.",
        f"A path-traced frame of {kReferenceSamples:,} samples a pixel takes {kMinutes:g} s or more, and TIC "
        "makes "
        f"{kInteractive:g} frame a second or more, at the size of this run. The path tracer is timed once.", parts,
        "" if all(_path(s, "reference", "spp") == kReferenceSamples for s in scenes.values()) else
        "The references have fewer samples; their time is scaled in proportion.")


def _mechanism_rows(scenes: dict):
    for scene in scenes.values():
        for what, table in scene["mechanisms"].items():
            rows = table["rows"]
            if rows:
                most = max(row["threads"] for row in rows)
                yield (f"{scene['title']}, {'still' if what == 'still' else what.upper()}, {most} threads",
                       {row["mechanism"]: row
                        for row in rows if row["threads"] == most})


def _mechanisms(scenes: dict) -> list[dict]:
    locks = [
        _part(where, _path(rows, "lck", "over_wait_free"), "at_most", kScales, "×")
        for where, rows in _mechanism_rows(scenes)
    ]
    locals_ = [
        _part(where, _path(rows, "lw", "redundant_share"), "at_least",
              max(0.01,
                  _path(rows, "wf", "redundant_share", "high") or 0.0), "")
        for where, rows in _mechanism_rows(scenes)
    ]
    return [
        _claim(
            "locks_do_not_scale",
            "A lock around the cache does not scale to many threads: accesses serialise and contend.",
            f"At the largest thread count the lock's speed is at most {kScales} of the wait-free cache's. "
            "(The more a record "
            "costs, and the fewer cores there are, the less a lock matters.)", locks),
        _claim(
            "local_copies_repeat", "Local copies repeat work that sharing saves.",
            "At the largest thread count local-write makes at least 1 % more records than one thread needs, "
            "and more than "
            "the wait-free cache.", locals_)
    ]


def claims(scenes: dict) -> list[dict]:
    """`scenes` as in tables.json."""
    return [
        _whole_frames(scenes), *_moving_objects(scenes),
        _overhead(scenes), *_perception(scenes),
        _minutes(scenes), *_mechanisms(scenes)
    ]


def _target(name: str, what: str, relation: str, target: float, figure: dict | None, why: str = "") -> dict:
    """A row in the form that bench/targets writes."""
    verdict = decide(figure, relation, target) if figure else "skipped"
    figure = figure or {"median": None, "low": None, "high": None, "n": 0}
    if not why and verdict == "skipped":
        why = "not measured"
    elif not why and verdict == "undecided":
        why = "fewer than three rounds" if figure["low"] is None else "the interval holds the target"
    return {
        "name": name, "what": what, "relation": relation, "target": target, "median": figure["median"],
        "low": figure["low"], "high": figure["high"], "samples": figure["n"], "verdict": verdict, "why": why
    }


def targets(scenes: dict) -> list[dict]:
    """The figures to reach, a row for every scene that they concern."""
    rows = []
    for name, scene in scenes.items():
        title = scene["title"]
        theirs, over = kIndirectTimes.get(name), _path(scene, "time", "indirect_over_tic") or {}
        if theirs:
            rows.append(
                _target(f"igi_over_tic/{name}", f"{title}: indirect time, IGI / TIC; the thesis's ratio",
                        "at_least", theirs.igi_over_tic, over.get("igi")))
            if name in kFarFasterOn:
                rows.append(
                    _target(f"igi_over_tic_far/{name}",
                            f"{title}: indirect time, IGI / TIC; this project's aim", "at_least", kFarFaster,
                            over.get("igi")))
            rows.append(
                _target(f"ic_over_tic/{name}", f"{title}: indirect time, IC / TIC; the thesis's ratio",
                        "at_least", theirs.ic_over_tic, over.get("ic")))
        if name == "bunnies_9":
            rows.append(
                _target(f"tic_over_ic/{name}", f"{title}: indirect time, TIC / static IC", "at_most",
                        kSlowestAgainstStatic, _path(scene, "time", "tic_over_ic")))
        rows.append(
            _target(f"perceived/{name}", f"{title}: HDR-VDP, P > 75 %, TIC against IGI, percent of pixels",
                    "at_most", kMostAgainstIgi, _perceived(scene, "tic_igi")))
        if scene["kind"] == "animation":
            rows.append(
                _target(f"memory/{name}",
                        f"{title}: TIC's bytes a record beside the cache's and gradients, over VPLs / 8 + 64", "at_most",
                        1.0, _path(scene, "memory", "share_of_allowed")))
    return rows
