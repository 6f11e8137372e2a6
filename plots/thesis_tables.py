"""The tables of bench/tables, ours beside the thesis's, as grids."""
from __future__ import annotations

from statistics import median

import style
from grid import Cell, Grid
from thesis_results import kMechanisms, kTimed, Measured

kEmpty = Cell("–")
kVerdicts = {
    "pass": "good", "fail": "bad", "undecided": "open", "skipped": "open", "seen": "good", "not seen": "bad"
}
kBounds = {"at_least": "≥ ", "at_most": "≤ ", "mixed": "≈ "}
kRelations = {"at_least": "at least", "at_most": "at most"}


def brackets(figure: dict | None) -> str:
    if not figure or figure["low"] is None or figure["low"] == figure["high"]:
        return ""
    return f"[{style.number(figure['low'])}, {style.number(figure['high'])}]"


def cell(figure: dict | None, unit: str = "", verdict: str = "", under: str = "") -> Cell:
    """A median with its interval."""
    if not figure:
        return kEmpty
    return Cell(
        style.number(figure["median"]) + unit, " ".join(filter(None, (brackets(figure), under))), verdict)


def number(value, unit: str = "", under: str = "") -> Cell:
    return Cell(style.number(value) + unit, under) if value is not None else kEmpty


def percent(value, digits: int = 2) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _beside(measured: Measured, row: str) -> Cell:
    """The thesis's figure, and below it ours over it with the verdict, from the list of targets."""
    found = next((t for t in measured.data["targets"] if t["name"] == row), None)
    if not found:
        return kEmpty
    if found["median"] is None:
        return Cell(f"{found['target']:.2f}")
    return Cell(f"{found['target']:.2f}",
                f"{style.number(found['median'] / found['target'])}, {found['verdict']}",
                kVerdicts[found["verdict"]])


def _vpls(scene: dict) -> Cell:
    vpls = scene["vpls"]
    return Cell(f"{vpls['chosen']:,}" if vpls["chosen"] else "–",
                "" if vpls["levelled_off"] else "not levelled off")


def _last_frames(count: int) -> str:
    return "the last frame" if count == 1 else f"the last {count:,} frames"


def vpl_numbers(measured: Measured) -> Grid:
    grid = Grid(
        "vpls", "Number of virtual point lights per scene",
        "Chosen by quality, on the last frame: the smallest count from which on IGI's visible error against path "
        "tracing stays within a tenth, or 0.1 percentage points, of that at the largest count (a tenth of what it "
        "fell by, if that is less: where the reference's own noise holds all errors up). For this its direct light is "
        "exchanged for that of as many samples as the reference has: the noise of area lights, which all methods "
        "share, would hide what VPLs do. The number decides every ratio of speeds, and is the same for all methods. "
        "Beside it the accuracy of the caches, which extrapolate their records by gradients: per scene, "
        "so coarse that it hardly shows.", [
            "scene", "VPLs", "accuracy", "IGI at that number, P > 75 %", "IGI at the largest", "largest",
            "seconds a frame there"
        ])
    for scene in measured.scenes.values():
        curve = scene["vpls"]["curve"]
        at = next((p for p in curve if p["vpls"] == scene["vpls"]["chosen"]), None)
        grid.rows.append([
            Cell(scene["title"]),
            _vpls(scene),
            Cell(f"{scene['accuracy']:g}"),
            Cell(f"{percent(at['p75'])} %") if at else kEmpty,
            Cell(f"{percent(curve[-1]['p75'])} %") if curve else kEmpty,
            Cell(f"{curve[-1]['vpls']:,}") if curve else kEmpty,
            number(curve[-1]["seconds_indirect"]) if curve else kEmpty
        ])
    return grid


def _sparse(measured: Measured) -> str:
    """Which frames IGI rendered, if not all."""
    every = measured.data["settings"].get("igi_every", 1)
    return "" if every == 1 else f" IGI, in both forms, rendered the first of every {every} frames and the last."


def whole_frames(measured: Measured) -> Grid:
    low, high = measured.data["thesis"]["whole_frames"]
    grid = Grid(
        "whole_frames", "Whole frames per second (Table 6.3 in kind)",
        "Primary rays, direct and indirect light; medians over rounds [interval]. Of the thesis's table the "
        "range of TIC / "
        f"IGI over its scenes is known.{_sparse(measured)}", [
            "scene", "VPLs", *(measured.title(m)
                               for m in kTimed), "TIC / IGI", "TIC / IGI interleaved", "TIC / IC",
            "TIC / hash cells", "TIC / IGI"
        ], groups=[("", 2), ("frames per second", len(kTimed)), ("ours", 4), ("thesis", 1)])
    for scene in measured.animations.values():
        time = scene["time"]
        grid.rows.append([
            Cell(scene["title"]),
            _vpls(scene), *(cell(time["methods"][m]["frames_per_second"]) for m in kTimed),
            *(cell(time["whole_over_tic"][m]) for m in ("igi", "interleaved", "ic", "cells")),
            Cell(f"{low} to {high}")
        ])
    return grid


def indirect_time(measured: Measured) -> Grid:
    grid = Grid(
        "indirect", "Seconds a frame for the indirect light (Table 6.4 in kind)",
        "Means over all frames, medians over rounds [interval]; all methods gather by packets of shadow "
        "rays. Below the thesis's ratio: ours over it, which passes when the whole interval of ours reaches "
        "the "
        "thesis's. \"later frames\" leaves out the first, in which TIC has nothing to reuse."
        f"{_sparse(measured)}", [
            "scene", "VPLs", "IGI", "interleaved", "IC", "TIC", "hash cells", "ours", "thesis", "later frames", "ours",
            "thesis", "later frames", "ours", "later frames", "ours", "later frames"
        ], groups=[("", 2), ("seconds", 5), ("IGI / TIC", 3), ("IC / TIC", 3), ("interleaved / TIC", 2),
                   ("hash cells / TIC", 2)])
    for name, scene in measured.animations.items():
        time, theirs = scene["time"], measured.data["thesis"]["indirect_times"].get(name)
        over, later = time["indirect_over_tic"], time["indirect_over_tic_after_first"]

        def seconds(method, theirs=theirs, time=time):
            under = f"thesis {theirs[method]:.2f}" if theirs and method in theirs else ""
            figure = time["methods"][method]["seconds_indirect"]
            return Cell(style.number(figure["median"]), under) if figure else kEmpty

        row = [Cell(scene["title"]), _vpls(scene), *(seconds(m) for m in ("igi", "interleaved", "ic", "tic", "cells"))]
        for method, key in (("igi", "igi_over_tic"), ("ic", "ic_over_tic")):
            row += [cell(over[method]), _beside(measured, f"{key}/{name}"), cell(later[method])]
        grid.rows.append([*row, *(cell(ratio[m]) for m in ("interleaved", "cells") for ratio in (over, later))])
    return grid


def perceived(measured: Measured) -> Grid:
    settings = measured.data["settings"]
    spp = settings["super_spp"]
    plain = ("igi_path", "interleaved_path", "cells_path", "super_path")
    clean = ("tic", "igi", "interleaved", "cells")
    grid = Grid(
        "perceived", "Pixels that a human would tell apart, percent (Table 6.5 in kind)",
        "HDR-VDP of 2005 on the last frame, one sample a pixel, against path tracing with "
        f"{settings['reference_spp']:,} samples. In smaller type: the thesis. For scale, P > 75 % of IGI "
        f"itself, of IGI with {spp} samples a pixel (what is left with less aliasing and noise of direct "
        "light), and of the two halves of the reference against each other (its own error; each half has "
        "half of the samples). Clean: direct light exchanged for that of as many samples as the reference "
        "has, so that the indirect light's error stands "
        "alone.", [
            "scene", "VPLs", *("P > 75 %", "P > 95 %") * 2, "verdict", "IGI", "inter- leaved",
            "hash cells", f"IGI, {spp} spp", "halves", "TIC", "IGI", "inter- leaved", "hash cells"
        ], groups=[("", 2), ("TIC against path tracing", 2), ("TIC against IGI", 3),
                   ("against path tracing", len(plain) + 1), ("the same, clean", len(clean))])
    for name, scene in measured.scenes.items():
        theirs, quality = measured.data["thesis"]["perceived"].get(name), scene["quality"]

        def at(pair, quality=quality):
            return Cell(percent((quality.get(pair) or {}).get("p75")))

        row = [Cell(scene["title"]), _vpls(scene)]
        for pair in ("tic_path", "tic_igi"):
            for level in ("p75", "p95"):
                key = f"{level}_{pair.removeprefix('tic_')}"
                row.append(
                    Cell(percent((quality.get(pair) or {}).get(level)),
                         f"thesis {theirs[key]:.2f}" if theirs else ""))
        found = next((t for t in measured.data["targets"] if t["name"] == f"perceived/{name}"), None)
        row.append(Cell(found["verdict"], "", kVerdicts[found["verdict"]]) if found else kEmpty)
        row += [*map(at, plain), Cell(percent((scene["reference"]["halves"] or {}).get("p75")))]
        grid.rows.append([*row, *(at(f"{method}_path_clean") for method in clean)])
    return grid


def numeric_errors(measured: Measured) -> Grid:
    grid = Grid(
        "errors", "Numeric errors of the last frame",
        "Against path tracing unless said otherwise. RMSE in W/(m² sr); FLIP from 0 (equal) to 1; mean "
        "ratio below 1: darker than the reference. The reference's own RMSE is half of that between its "
        "halves.",
        ["scene", *("RMSE", "FLIP", "mean ratio") * 2, "RMSE", "FLIP", "RMSE"],
        groups=[("", 1), ("TIC", 3), ("IGI", 3), ("TIC against IGI", 2), ("reference", 1)])
    for scene in measured.scenes.values():
        row = [Cell(scene["title"])]
        for pair, keys in (("tic_path", ("rmse", "flip", "mean_ratio")),
                           ("igi_path", ("rmse", "flip", "mean_ratio")), ("tic_igi", ("rmse", "flip"))):
            row += [number((scene["quality"].get(pair) or {}).get(key)) for key in keys]
        halves = (scene["reference"]["halves"] or {}).get("rmse")
        grid.rows.append([*row, number(halves / 2 if halves is not None else None)])
    return grid


def over_frames(measured: Measured) -> Grid:
    keys = ("rmse", "flip", "p75", "flicker")
    methods = ("tic", "ic", "interleaved", "cells")
    grid = Grid(
        "over_frames", "Error over all frames, against IGI with the same lights",
        "Means over the frames. Flicker: root mean square of the change from frame to frame of what "
        f"differs, W/(m² sr).{_sparse(measured)}",
        ["scene", *("RMSE", "FLIP", "P > 75 %, %", "flicker") * len(methods)],
        groups=[("", 1), *((measured.title(m), len(keys)) for m in methods)])
    for scene in measured.animations.values():
        row = [Cell(scene["title"])]
        for method in methods:
            errors = scene["over_frames"].get(method) or {}
            row += [Cell(percent(errors.get(k))) if k == "p75" else number(errors.get(k)) for k in keys]
        grid.rows.append(row)
    return grid


def equal_error(measured: Measured) -> Grid:
    s = measured.data["settings"]
    grid = Grid(
        "equal_error", "Speed-up at equal error",
        f"TIC as in the tables, against IGI with {s['converged_vpls']:,} VPLs on "
        f"{_last_frames(s['converged_frames'])}. A rival's seconds for TIC's error are "
        "interpolated between its settings (logarithm of time over logarithm of error, along those that no "
        "other beats in both); ≤ and ≥ mark bounds, in some of the frames at least: that error lies outside what "
        "was measured, and nothing is extrapolated; ≈ has bounds of both kinds. Ratios of steady frames, without "
        "TIC's first.",
        ["scene", "VPLs", "RMSE of TIC", "flicker", "seconds", "IGI / TIC", "interleaved / TIC", "IC / TIC",
         "hash cells / TIC"])
    for scene in measured.animations.values():
        found = scene["equal_error"] or {}
        target, ups = found.get("target"), found.get("speedups", {})
        if not target:
            grid.rows.append([Cell(scene["title"]), _vpls(scene), *[kEmpty] * 7])
            continue
        row = [
            Cell(scene["title"]),
            _vpls(scene),
            number(target["rmse"]),
            number(target["flicker"]),
            number(median(target["seconds"]))
        ]
        for method in ("igi", "interleaved", "ic", "cells"):
            up = ups.get(method)
            shown = cell(up["ratio"]) if up else kEmpty
            row.append(Cell(kBounds.get(up["bound"], "") + shown.value, shown.under) if up else kEmpty)
        grid.rows.append(row)
    return grid


def mechanisms(measured: Measured, what: str, title: str) -> Grid:
    """Chapter 7 at every thread count of one kind of picture."""
    counts = measured.data["settings"]["threads"]
    units = measured.data["machine"]["units"]
    titles = [style.threads_text(n) + (" (over)" if n > units else "") for n in counts]
    grid = Grid(
        f"mechanisms_{what}", title, "", ["scene", "base, frames/s", "mechanism", *3 * titles],
        groups=[("", 3), ("speed-up over the base", len(counts)),
                ("lock waiting, of all threads' time in the indirect pass", len(counts)),
                ("records beyond those of one thread", len(counts))], left=1)
    for scene in measured.scenes.values():
        table = scene["mechanisms"].get(what)
        if not table:
            continue
        for index, (name, cache) in enumerate(kMechanisms.items()):
            rows = {r["threads"]: r for r in table["rows"] if r["mechanism"] == name}
            over_counts = [rows.get(n, {}) for n in counts]
            first = index == 0
            grid.rows.append([
                Cell(scene["title"] if first else ""),
                cell(table["base"]["frames_per_second"]) if first else Cell(""),
                Cell(measured.title(name)),
                *(cell(row.get("speedup")) for row in over_counts),
                *(_share(row.get("lock_wait_share")) for row in over_counts),
                *(_share(row.get("redundant_share")) for row in over_counts)
            ])
    return grid


def _share(figure: dict | None) -> Cell:
    return Cell(f"{100 * figure['median']:.1f} %") if figure else kEmpty


def memory(measured: Measured) -> Grid:
    grid = Grid(
        "memory", "TIC's memory and the work it saves",
        "Beside the cache's own memory, and gradients, which IC keeps as well, TIC may take one bit for each record "
        "and VPL and 64 bytes a record. "
        "Of the records that a frame finds, those are kept that motion left valid, updated where "
        "visibilities were traced anew, and "
        "dropped on surfaces that moved. All frames but the first: sums, and of shadow rays means of those that "
        "each method rendered.", [
            "scene", "VPLs", "records", "bytes a record", "allowed", "verdict", "kept", "updated", "dropped",
            "light paths retraced", "shadow rays, TIC / IC", "TIC / IGI"
        ], groups=[("", 3), ("beside the cache", 3), ("records", 3), ("work", 3)])
    for name, scene in measured.animations.items():
        m = scene["memory"]
        if not m:
            continue
        work, rays = m["work_after_first"], m["shadow_rays_per_frame_after_first"]
        total = sum(work[k] for k in ("records_kept", "records_updated", "records_dropped"))
        found = next((t for t in measured.data["targets"] if t["name"] == f"memory/{name}"), None)
        grid.rows.append([
            Cell(scene["title"]),
            _vpls(scene),
            Cell(f"{m['records']:,}") if m["records"] is not None else kEmpty,
            number(m["bytes_per_record"]),
            number(m["allowed_bytes_per_record"]),
            Cell(found["verdict"], "", kVerdicts[found["verdict"]]) if found else kEmpty,
            *(Cell(f"{100 * work[k] / total:.1f} %") if total else kEmpty
              for k in ("records_kept", "records_updated", "records_dropped")),
            Cell(f"{100 * work['light_paths_retraced'] / work['light_paths']:.1f} %") if work["light_paths"]
            else kEmpty, *(number(rays["tic"] / rays[m_]) if rays["tic"] is not None and rays[m_] else kEmpty
                           for m_ in ("ic", "igi"))
        ])
    return grid


def targets(measured: Measured) -> Grid:
    grid = Grid(
        "targets", "Ratios of this run beside their targets",
        "A row passes when its whole interval keeps the relation, and fails when its whole interval breaks "
        "it. (That shadow rays run at 0.85 of bare Embree's speed is a row of bench/targets.)",
        ["figure", "target", "measured", "measured / target", "verdict"], left=2)
    for row in measured.data["targets"]:
        figure = row if row["median"] is not None else None
        share = style.number(row["median"] / row["target"]) if figure else "–"
        grid.rows.append([
            Cell(row["what"]),
            Cell(f"{kRelations[row['relation']]} {style.number(row['target'])}"),
            cell(figure),
            Cell(share),
            Cell(row["verdict"], row["why"], kVerdicts[row["verdict"]])
        ])
    return grid


def claims(measured: Measured) -> Grid:
    grid = Grid(
        "claims", "What the thesis claims, and what was seen here",
        "\"Seen\": the whole interval of every part agrees; \"not seen\": the whole interval of some part "
        "contradicts; else undecided. Each of the thesis's figures is of its own scenes and hardware.",
        ["claim", "how it was judged", "parts that agree", "measured", "verdict"], left=2)
    for claim in measured.data["claims"]:
        parts = claim["parts"]
        agree = sum(p["verdict"] == "pass" for p in parts)
        against = [p for p in parts if p["verdict"] == "fail"]
        open_ = [p for p in parts if p["verdict"] == "undecided"]
        told = "; ".join(f"{p['where']}: {_figure(p)}" for p in (against or open_)[:3])
        grid.rows.append([
            Cell(claim["says"]),
            Cell(" ".join(filter(None, (claim["how"], claim["remark"])))),
            Cell(f"{agree} of {len(parts)}"),
            Cell(_range(parts), told),
            Cell(claim["verdict"], "", kVerdicts[claim["verdict"]])
        ])
    return grid


def _figure(part: dict) -> str:
    figure = part["figure"]
    if not figure:
        return "not measured"
    unit = f" {part['unit']}" if part["unit"] else ""
    return " ".join(filter(None, (style.number(figure["median"]) + unit, brackets(figure))))


def _range(parts: list[dict]) -> str:
    """From the smallest to the largest median, per unit and relation."""
    out = []
    for unit in dict.fromkeys(p["unit"] for p in parts):
        values = [p["figure"]["median"] for p in parts if p["unit"] == unit and p["figure"]]
        if values:
            low, high = style.number(min(values)), style.number(max(values))
            out.append((low if low == high else f"{low} to {high}") + (f" {unit}" if unit else ""))
    return "; ".join(out) or "not measured"
