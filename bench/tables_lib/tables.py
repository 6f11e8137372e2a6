"""What the finished jobs of a scene say: the numbers of every table, as they go to tables.json.

A number that a failed job was to bring is None; nothing is guessed in its place.
"""
from __future__ import annotations

from pathlib import Path
from statistics import median

from arithmetic import exact, interval_of, level_off, mean, ratios, seconds_at_error
from jobs import Job, Store
from options import Settings
from plan import kIntegrators, kMechanisms, kTitles, Plan
from thesis import kTitles as kSceneTitles

kRivals = ("igi", "interleaved", "ic", "cells")


def _get(result: dict | None, *path):
    """A number by its path, None where it is not there."""
    for key in path:
        result = result.get(key) if isinstance(result, dict) else None
    return result if isinstance(result, (int, float)) and not isinstance(result, bool) else None


def _frames(result: dict | None) -> list[dict]:
    frames = result.get("frames") if result else None
    return [f for f in frames if isinstance(f, dict)] if isinstance(frames, list) else []


def _per_frame(result: dict | None, key: str, start: int = 0) -> float | None:
    """The mean of a figure over frames, from `start` on."""
    values = [_get(frame, key) for frame in _frames(result)[start:]]
    return mean(values) if values and None not in values else None


def _errors(store: Store, job: Job | None) -> dict | None:
    """What a comparison found."""
    result = store.result(job) if job else None
    if result is None:
        return None
    return {
        "p75": _get(result, "hdrvdp", "p75"), "p95": _get(result, "hdrvdp", "p95"),
        "rmse": _get(result, "rmse"), "relmse": _get(result, "relmse"), "flip": _get(result, "flip"),
        "mean_ratio": _get(result, "mean_ratio"), "flicker": _get(result, "flicker")
    }


def vpl_curve(store: Store, plan: Plan) -> list[dict]:
    """IGI's error against path tracing over VPL counts, with converged direct light: medians over sets of
    VPLs. Counts without a figure are left out.
    """
    points = []
    for count in sorted({count for count, _ in plan.sweep}):
        seeds = [seed for c, seed in plan.sweep if c == count]
        errors = [
            e for e in (_errors(store, plan.sweep_errors[count, seed]) for seed in seeds)
            if e and e["p75"] is not None
        ]
        if not errors:
            continue
        point = {
            key: median(e[key] for e in errors) if all(e[key] is not None for e in errors) else None
            for key in ("p75", "p95", "rmse")
        }
        times = [_get(store.result(plan.sweep[count, seed]), "seconds_indirect") for seed in seeds]
        points.append({
            "vpls": count, **point, "p75_low": min(e["p75"] for e in errors),
            "p75_high": max(e["p75"] for e in errors), "seconds_indirect": mean(times), "sets": len(errors)
        })
    return points


def choose_vpls(store: Store, plan: Plan) -> tuple[int, bool] | None:
    """The scene's number of VPLs, and whether levelling off was seen below the largest; None if nothing could
    be compared.
    """
    curve = [(point["vpls"], point["p75"]) for point in vpl_curve(store, plan)]
    return level_off(curve) if curve else None


def _times(store: Store, plan: Plan, rounds: int, frames: int) -> dict | None:
    if not plan.timing:
        return None
    results = {m: [store.result(plan.timing[m, r]) for r in range(rounds)] for m in kIntegrators}
    indirect = {m: [_per_frame(r, "seconds_indirect") for r in rs] for m, rs in results.items()}
    later = {m: [_per_frame(r, "seconds_indirect", 1) for r in rs] for m, rs in results.items()}
    whole = {m: [_per_frame(r, "seconds") for r in rs] for m, rs in results.items()}
    series = {}
    for m, rs in results.items():
        found = [{f.get("frame"): _get(f, "seconds_indirect") for f in _frames(r)} for r in rs if r]
        columns = [[seconds.get(frame) for seconds in found] for frame in range(frames)]
        series[m] = [median(c) if c and None not in c else None for c in columns]
    return {
        "methods": {
            m: {
                "frames_per_second": interval_of(1 / s for s in whole[m] if s),
                "seconds_indirect": interval_of(indirect[m]),
                "seconds_indirect_after_first": interval_of(later[m])
            }
            for m in kIntegrators
        }, "whole_over_tic": {m: ratios(whole[m], whole["tic"])
                              for m in kRivals},
        "indirect_over_tic": {m: ratios(indirect[m], indirect["tic"])
                              for m in kRivals},
        "indirect_over_tic_after_first": {m: ratios(later[m], later["tic"])
                                          for m in kRivals},
        "tic_over_ic": ratios(indirect["tic"], indirect["ic"]), "indirect_per_frame": series
    }


def _equal_error(store: Store, plan: Plan) -> dict | None:
    """Error against converged IGI over seconds, and what rivals need for TIC's error, frame by frame."""
    points = []
    for (method, count, accuracy), made in plan.curve.items():
        errors = store.result(plan.curve_errors[method, count, accuracy])
        if isinstance(made, list):
            seconds = [_get(store.result(job), "seconds_indirect") for job in made]
        else:
            frames = _frames(store.result(made))[-len(plan.converged):]
            seconds = [_get(frame, "seconds_indirect") for frame in frames]
        if _get(errors, "rmse") is None or not seconds or None in seconds:
            continue
        points.append({
            "method": method, "vpls": count if method != "cells" else None,
            "paths": count if method == "cells" else None, "accuracy": accuracy if method in ("ic", "tic") else None,
            "seconds": seconds, "rmse": _get(errors, "rmse"), "relmse": _get(errors, "relmse"),
            "flicker": _get(errors, "flicker")
        })
    ours = next((p for p in points
                 if p["method"] == "tic" and p["vpls"] == plan.vpls and p["accuracy"] == plan.accuracy),
                None)
    if ours is None:
        return {"points": points, "target": None, "speedups": {}} if points else None
    return {
        "points": points, "target": ours, "speedups": {m: at_equal_error(points, m, ours)
                                                       for m in kRivals}
    }


def at_equal_error(points: list[dict], method: str, ours: dict) -> dict | None:
    """How many times longer a method takes than `ours` for the error of `ours`: over the measured frames, and
    whether that is a value or a bound.
    """
    theirs = [p for p in points if p["method"] == method]
    found = []
    for frame, seconds in enumerate(ours["seconds"]):
        at = seconds_at_error([(p["seconds"][frame], p["rmse"]) for p in theirs], ours["rmse"])
        if at is not None and seconds > 0:
            found.append((at[0] / seconds, at[1]))
    if not found:
        return None
    # A bound in one frame makes the median one, as far as it goes.
    bounds = {bound for _, bound in found} - {"is"}
    bound = "is" if not bounds else bounds.pop() if len(bounds) == 1 else "mixed"
    return {"ratio": interval_of(ratio for ratio, _ in found), "bound": bound}


def _mechanisms(store: Store, plan: Plan, settings: Settings) -> dict:
    """Chapter 7 on one scene: per kind of picture the base and a row for every mechanism and thread count."""
    out = {}
    rounds = range(settings.scale.rounds)
    for what in dict.fromkeys(key[0] for key in plan.mechanisms):

        def speeds(name, threads, what=what):
            results = [store.result(plan.mechanisms[what, name, threads, r]) for r in rounds]
            seconds = [_get(r, "seconds") if what == "still" else _per_frame(r, "seconds") for r in results]
            return results, [1 / s if s else None for s in seconds]

        base_results, base = speeds("sequential", 1)
        needed = [_get(r, "records") for r in base_results]
        rows = []
        for threads in settings.threads:
            fastest = speeds("wf", threads)[1]
            for name, cache in kMechanisms.items():
                results, speed = speeds(name, threads)
                records = [_get(r, "records") for r in results]
                rows.append({
                    "mechanism": name, "cache": cache, "threads": threads,
                    "frames_per_second": interval_of(speed), "speedup": ratios(speed, base),
                    "over_wait_free": ratios(speed, fastest),
                    "lock_wait_share": interval_of(_get(r, "lock_wait_share") for r in results),
                    "redundant_share": interval_of(n / m - 1 for n, m in zip(records, needed)
                                                   if n is not None and m)
                })
        out[what] = {
            "base": {
                "cache": "sequential", "threads": 1, "frames_per_second": interval_of(base),
                "records": interval_of(needed)
            }, "rows": rows
        }
    return out


def _over_frames(store: Store, plan: Plan, every: int) -> dict:
    """Errors against IGI, of the frames that it rendered; flicker only if these are all, one after the other."""
    found = {name: _errors(store, job) for name, job in plan.over_frames.items()}
    return found if every == 1 else {name: e and e | {"flicker": None} for name, e in found.items()}


def _memory(store: Store, plan: Plan, rounds: int) -> dict | None:
    """TIC's memory beside the cache's and beside gradients, which IC keeps as well; and the work that it saved after
    the first frame.
    """
    results = [r for r in (store.result(plan.timing["tic", n]) for n in range(rounds))
               if r] if plan.timing else []
    if not results:
        return None
    result = results[0]
    later = _frames(result)[1:]
    # Memory is of the most records there were: what fewer leave is kept for more.
    counts = [n for n in (_get(f, "records") for f in _frames(result)) if n is not None]
    records, beside = max(counts, default=_get(result, "records")), _get(result, "bytes_beside_cache")
    details = _get(result, "bytes_of_details") or 0
    extra = beside - details if beside is not None else None
    allowed = (_get(result, "vpls_in_use") or plan.vpls) / 8 + 64
    sums = {
        key: sum(_get(f, key) or 0 for f in later)
        for key in ("records_kept", "records_updated", "records_dropped", "light_paths",
                    "light_paths_retraced", "shadow_rays")
    }
    # IGI may have rendered only some of the frames.
    rays = {"tic": result, **{m: store.result(plan.timing[m, 0]) for m in ("ic", "igi")}}
    rays = {m: _per_frame(r, "shadow_rays", 1) for m, r in rays.items()}
    return {
        "records": records, "bytes_beside_cache": beside, "bytes_of_details": details, "vpls": plan.vpls,
        "bytes_per_record": extra / records if records and extra is not None else None,
        "allowed_bytes_per_record": allowed,
        "share_of_allowed": exact(extra / records / allowed if records and extra is not None else None),
        "work_after_first": sums, "shadow_rays_per_frame_after_first": rays
    }


def _title(scene: str) -> str:
    """The thesis's name of a scene; of others one made of their name or file."""
    return kSceneTitles.get(scene) or Path(scene).stem.replace("_", " ").capitalize()


def _mean_seconds(jobs: list[Job], store: Store) -> float | None:
    """Seconds of a reference, both halves together; None if another program or machine made it."""
    seconds = [store.seconds(job) for job in jobs]
    return sum(seconds) if None not in seconds else None


def scene_tables(store: Store, plan: Plan, settings: Settings, description: str) -> dict:
    """Everything measured on one scene."""
    chosen = choose_vpls(store, plan)
    rounds = settings.scale.rounds
    return {
        "title": _title(plan.scene), "description": description,
        "kind": "animation" if plan.is_animation else "still", "vpls": {
            "chosen": chosen[0] if chosen else None, "levelled_off": bool(chosen and chosen[1]),
            "curve": vpl_curve(store, plan)
        }, "accuracy": plan.accuracy, "reference": {
            "spp": settings.scale.reference_spp, "seconds": _mean_seconds(plan.halves, store),
            "halves": _errors(store, plan.reference_error)
        }, "time": _times(store, plan, rounds, settings.scale.frames),
        "quality": {name: _errors(store, job)
                    for name, job in plan.quality.items()
                    }, "over_frames": _over_frames(store, plan, settings.igi_every),
        "equal_error": _equal_error(store, plan), "mechanisms": _mechanisms(store, plan, settings),
        "memory": _memory(store, plan, rounds)
    }


def method_titles() -> dict[str, str]:
    return dict(kTitles)
