"""The report's part on speed against error: what to use in how much time, the front in numbers, and pictures."""
from __future__ import annotations

import math
from pathlib import Path

import style  # first: it checks what is installed

import pandas as pd

import pareto_choice
from inline import data_uri, image
from pareto_results import Measured, Pictures, points, setting_words
from tables import interval, note_line, table, text

kTitle = "Speed against error, all methods"
kLead = ("<p>Every method that makes indirect light, over its parameters, judged at identical primary hits against "
         "path tracing. Times are those of the indirect light alone; direct light costs the same for all.</p>")
kFront = ("relmse", "rmse", "flip", "hdrvdp_p75")
# Methods that differ in how records are interpolated, each by what it adds.
kLevels = {"irradiance_cache": "split sphere", "irradiance_cache_bounded": "limits on the screen",
           "irradiance_cache_gradients": "gradients", "irradiance_cache_neighbours": "neighbour clamping",
           "irradiance_cache_geometric": "ellipses by the geometric Hessian",
           "irradiance_cache_occlusion": "ellipses by the occlusion Hessian",
           "irradiance_cache_overture": "those, after an overture"}


def budgets(part: pd.DataFrame) -> list[float]:
    """Round times from the fastest setting to the slowest."""
    low, high = part["seconds"].min(), part["seconds"].max()
    return [b for b in pareto_choice.budgets(part["seconds"]) if low <= b <= 1.0001 * high] or [high]


def best_within(part: pd.DataFrame, seconds: float, error: str = "relmse") -> pd.Series | None:
    """The setting of least error that takes no longer; None if none is that fast."""
    found = pareto_choice.best_of_each(part, seconds, error)
    return None if found.empty else found.iloc[0]


def _named(line: pd.Series, value: str = "") -> str:
    under = text(setting_words(line["setting"])) + (f", {value}" if value else "")
    return f'{text(line["method"].replace("_", " "))}<span class="under">{under}</span>'


def choices(part: pd.DataFrame) -> str:
    """For every budget, what to use."""
    others = [e for e in ("flip", "hdrvdp_p75") if e in part]
    names = {"flip": "FLIP", "hdrvdp_p75": "HDR-VDP"}
    head = ('<th>if you have</th><th>use, for the least relMSE</th><th class="n">relMSE</th>'
            '<th class="n">path tracing in that time</th><th class="n">times less</th>'
            + "".join(f"<th>for the least {names[e]}</th>" for e in others))
    lines, path = [], part[part["method"] == "path"]
    for budget in budgets(part):
        best = best_within(part, budget)
        rival = best_within(path, budget)
        known = rival is not None
        cells = [f"<td class=\"key\">{text(style.short_duration(budget))}</td>", f"<td>{_named(best)}</td>",
                 f'<td class="n">{style.number(best["relmse"])}{"&nbsp;*" if best.get("below_reference") else ""}</td>',
                 f'<td class="n">{style.number(rival["relmse"]) if known else "–"}</td>',
                 f'<td class="n">{style.number(rival["relmse"] / best["relmse"]) if known and best["relmse"] > 0 else "–"}</td>']
        for error in others:
            least = best_within(part, budget, error)
            unit = " %" if error.startswith("hdrvdp") else ""
            shown = "–" if least is None else _named(least, style.number(least[error]) + unit)
            cells.append(f"<td>{shown}</td>")
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return table(head, lines, "wide")


def sentence(scene: str, part: pd.DataFrame) -> str:
    """The middle budget in words."""
    times = budgets(part)
    budget = times[len(times) // 2]
    best = best_within(part, budget)
    said = (f"With {style.short_duration(budget)} for the indirect light of {scene.replace('_', ' ')}, use "
            f"{best['method'].replace('_', ' ')} ({setting_words(best['setting'])}): relMSE "
            f"{style.number(best['relmse'])}")
    rival = best_within(part[part["method"] == "path"], budget)
    if rival is not None and best["method"] != "path":
        said += f", where path tracing has {style.number(rival['relmse'])} by then"
    return f"<p><b>{text(said)}.</b></p>"


def _bias(line: pd.Series) -> str:
    """The bias; where it is less than twice its standard error, what it is below by that."""
    squared, error = line.get("bias_squared", math.nan), line.get("bias_squared_error", math.nan)
    if not squared < 2 * error:  # or not told
        return style.number(line["bias"])
    return f"&lt;&nbsp;{style.number(math.sqrt(max(squared, 0) + 2 * error))}"


def front_table(part: pd.DataFrame) -> str:
    """All points that are on a front, by rising time."""
    shown = [e for e in kFront if e in part]
    mine = part[part[[f"front_{e}" for e in shown]].any(axis=1)].sort_values("seconds")
    has = [n for n in ("bias", "deviation", "mean_ratio", "full_relmse") if n in part]
    names = {"relmse": "relMSE", "rmse": "RMSE", "flip": "FLIP", "hdrvdp_p75": "HDR-VDP, %", "bias": "bias",
             "deviation": "deviation", "mean_ratio": "mean", "full_relmse": "relMSE of the whole picture"}
    head = '<th>on a front</th><th class="n">seconds</th>' + "".join(
        f'<th class="n">{names[n]}</th>' for n in (*shown, *has))
    lines = []
    for _, line in mine.iterrows():
        seconds = interval(line["seconds"], line["seconds_low"], line["seconds_high"])
        cells = [f"<td>{_named(line)}</td>", f'<td class="n">{seconds}</td>']
        for error in shown:
            value = interval(line[error], line[f"{error}_low"], line[f"{error}_high"])
            star = "&nbsp;*" if error == "relmse" and line.get("below_reference") else ""
            cells.append(f'<td class="n{" good" if line[f"front_{error}"] else ""}">{value}{star}</td>')
        for n in has:
            value = (_bias(line) if n == "bias" else
                     interval(line[n], line[f"{n}_low"], line[f"{n}_high"]) if f"{n}_low" in line
                     else style.number(line[n]))
            cells.append(f'<td class="n">{value}</td>')
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return table(head, lines, "wide")


def levels(part: pd.DataFrame) -> str:
    """What each level of interpolation makes of the same accuracies, at the most rays a record that all had; nothing
    where fewer than two were measured."""
    error = "rmse_irradiance" if "rmse_irradiance" in part else "relmse"
    mine = part[part["method"].isin(list(kLevels))].copy()
    for key, name in (("accuracy", "a"), ("rays_per_record", "rays")):
        mine[name] = pd.to_numeric(mine["setting"].str.extract(rf"\b{key}:([^/]+)")[0], errors="coerce")
    mine = mine.dropna(subset=["a", "rays"])
    shown = [m for m in kLevels if (mine["method"] == m).any()]
    by = mine.groupby(["rays", "a"])["method"].nunique()
    shared = by[by == len(shown)].index
    if len(shown) < 2 or shared.empty:
        return ""
    rays = max(n for n, _ in shared)
    accuracies = sorted((a for n, a in shared if n == rays), reverse=True)
    cells = mine[mine["rays"] == rays].set_index(["method", "a"])
    has_records = "records" in mine
    what = ([("records", "records")] if has_records else []) + [
        (error, "RMSE of E" if error == "rmse_irradiance" else "relMSE"), ("seconds", "seconds")]
    head = "<th>interpolation</th>" + "".join(
        f'<th class="n">{name},<br>a = {a:g}</th>' for a in accuracies for _, name in what)
    lines = []
    for method in shown:
        line = f"<td>{text(kLevels[method])}</td>"
        for a in accuracies:
            row = cells.loc[(method, a)]
            line += "".join('<td class="n">' + (f"{row[column]:,.0f}" if column == "records" else
                                                style.number(row[column])) + "</td>" for column, _ in what)
        lines.append(f"<tr>{line}</tr>")
    own = f"reference_{error}"
    about = (f"E: irradiance, W/m². Errors include the reference's own, {style.number(part[own].iloc[0])}"
             if own in part else "E: irradiance, W/m²")
    return (f"<h4>What each level of interpolation is worth, at {int(rays):,} rays a record</h4>"
            + table(head, lines, "wide") + note_line(about))


def _legend(part: pd.DataFrame) -> str:
    said = "Green: on the front of that error. "
    if "reference_relmse" in part:
        said += (f"The reference's own relMSE is {style.number(part['reference_relmse'].iloc[0])}; * marks what is no "
                 "farther from the truth than that. ")
    runs = int(part["bias_runs"].max()) if "bias_runs" in part and part["bias_runs"].notna().any() else 0
    if runs:
        said += (f"Bias is what {style.plural(runs, 'independent run')} have in common, deviation what sets them "
                 "apart, both W/(m² sr), by bias² = MSE - variance less the reference's. "
                 + ("<: not to be told from noise, which would hide one of that size (twice the standard error of "
                    "bias², over blocks of pixels). " if "bias_squared_error" in part
                    else "How sure it is, these results do not say. "))
    said += ("The mean is over the reference's mean. The whole picture has one sample through the centre of each "
             "pixel, its reference samples all over it: edges count there, and for all methods alike")
    return said


def _picture(folder: Path, entry: dict) -> str:
    name = str(entry.get("method", "")).replace("_", " ")
    if "image" not in entry:
        return f"<figure><figcaption><b>{text(name)}</b>: no setting is that fast</figcaption></figure>"
    try:
        made, error = (data_uri("image/png", (folder / entry[key]).read_bytes()) for key in ("image", "map"))
        about = (f"{setting_words(str(entry['setting']))}; {style.duration(entry['seconds'])}, FLIP "
                 f"{style.number(entry['flip'])}")
    except (OSError, TypeError, KeyError):
        return f"<figure><figcaption><b>{text(name)}</b>: the picture cannot be read</figcaption></figure>"
    return (f'<figure>{image(made, name)}{image(error, f"error of {name}")}'
            f"<figcaption><b>{text(name)}</b><br>{text(about)}</figcaption></figure>")


def gallery(pictures: Pictures) -> str:
    """For each budget all methods side by side, their error maps below."""
    index, made = pictures.index, ""
    for budget in index["budgets"]:
        shown = "".join(_picture(pictures.folder, entry) for entry in budget["pictures"])
        try:
            truth = data_uri("image/png", (pictures.folder / index["reference"]).read_bytes())
            shown = (f'<figure>{image(truth, "reference")}<figcaption><b>reference</b></figcaption></figure>'
                     + shown)
        except (OSError, TypeError, KeyError):
            pass
        made += (f"<h4>In the time of path tracing with {int(budget['spp'])} samples: "
                 f"{text(style.duration(budget['seconds']))}</h4>"
                 f'<div class="pictures small">{shown}</div>')
    return made


def section(measured: Measured, anchor: str, figure: str) -> str:
    """The page. `figure`: HTML of the figure."""
    everything = points(measured)
    made = f'<h2 id="{anchor}">{text(kTitle)}</h2>{kLead}'
    if measured.cut_short:
        made += ('<div class="banner">Incomplete: this part shows what was measured until the run was cut short '
                 f'({text(", ".join(measured.cut_short))}).</div>')
    made += "".join(f'<div class="banner">Left out: {text(why)}.</div>' for why in measured.left_out)
    made += pareto_choice.section(measured, everything) + figure
    several = everything["scene"].nunique() > 1
    for scene, part in everything.groupby("scene"):
        words = text(scene.replace("_", " "))
        made += (f'<details class="plain" open><summary>{words}: beside path tracing, fronts, and pictures'
                 "</summary>" if several else "")
        made += f"<h3>{words}</h3>{sentence(scene, part)}{choices(part)}{front_table(part)}"
        made += note_line(_legend(part)) + levels(part)
        for pictures in measured.pictures:
            if pictures.index.get("scene") == scene:
                made += gallery(pictures)
                made += note_line("of each method the setting of least relMSE that is no slower; all pictures have "
                                  "the reference's direct light. Below each is its error as FLIP, where black is "
                                  "none")
        made += "</details>" if several else ""
    names = ", ".join(path.name for path in measured.paths)
    return made + f'<p class="note">From <code>{text(names)}</code>, measured on {text(measured.label)}.</p>'
