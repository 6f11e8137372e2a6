"""What to use if one has x seconds, scene by scene: tables for round numbers of them, and a field for any."""
from __future__ import annotations

import math
from dataclasses import dataclass

import style  # first: it checks what is installed

import pandas as pd

import interactive
from explorer import swatch
from intervals import few_note
from pareto_results import Measured, method_order, on_front, setting_words
from tables import note_line, table, text

# The errors that one can choose by: field, name, what a value is of, field of the reference's own error.
kMetrics = {"relmse": ("relMSE", "", "reference_relmse"), "rmse": ("RMSE", "W/(m² sr)", "reference_rmse"),
            "relmse_irradiance": ("relMSE of irradiance", "", "reference_relmse_irradiance"),
            "rmse_irradiance": ("RMSE of irradiance", "W/m²", "reference_rmse_irradiance"),
            "flip": ("FLIP", "", ""), "hdrvdp_p75": ("HDR-VDP", "% of pixels told apart", "")}
kSteps = (1, 3)  # budgets in every decade
kMost = 7        # columns of a table
kNamed = 2       # methods named beside the best one, of those that the runs do not tell from it
kDigits = 7      # significant ones that the script gets: rounded twice, a number would differ from the table's
kTitle = "If you have x seconds"


@dataclass
class Answer:
    """What a budget buys: the best setting, and those of other methods that its runs do not tell from it."""
    best: pd.Series
    tied: pd.DataFrame


def budgets(seconds: pd.Series) -> list[float]:
    """Round times, from the first that buys something to the first that buys everything."""
    low, high = seconds.min(), seconds.max()
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1
    made = [float(f"{step}e{d}") for d in range(first, last + 1) for step in kSteps]
    made = [b for b in made if low <= b]
    return [b for i, b in enumerate(made) if i == 0 or made[i - 1] < high]


def columns(seconds: pd.Series) -> list[float]:
    """Those that a table has room for: where there are many, powers of ten, and the slowest of these."""
    times = budgets(seconds)
    if len(times) > kMost:
        times = [time for time in times if f"{time:e}".startswith("1.")]
    return times[-kMost:]


def best_of_each(part: pd.DataFrame, seconds: float, error: str) -> pd.DataFrame:
    """Of every method the setting of least error, the fastest of several, that takes no longer; the best first."""
    fast = part[(part["seconds"] <= seconds) & part[error].notna()]
    return fast.sort_values([error, "seconds", "method"], kind="stable").drop_duplicates("method")


def answer(part: pd.DataFrame, seconds: float, error: str) -> Answer | None:
    """None if nothing is that fast. A method is tied with the best where the spreads of their runs overlap."""
    found = best_of_each(part, seconds, error)
    if found.empty:
        return None
    best, others = found.iloc[0], found.iloc[1:]
    return Answer(best, others[others[f"{error}_from"] <= best[f"{error}_to"]])


def own_error(line: pd.Series, error: str) -> bool:
    """Whether the error is no more than what the reference's own may make of it."""
    own = line.get(kMetrics[error][2], math.nan)
    most = 2.0 if error.startswith("relmse") else math.sqrt(2.0)  # of squares, twice as much
    return bool(line[error] < most * own)


def shown(line: pd.Series, error: str) -> str:
    """"1.42 [1.38, 1.47] *": the error, the spread of its runs, and whether the reference is no better."""
    spread = ""
    if pd.notna(line[f"{error}_from"]):
        spread = f' <small>[{style.number(line[f"{error}_from"])}, {style.number(line[f"{error}_to"])}]</small>'
    return style.number(line[error]) + spread + ("&nbsp;*" if own_error(line, error) else "")


def name(line: pd.Series) -> str:
    return str(line["method"]).replace("_", " ")


def _cell(found: Answer | None, error: str) -> str:
    if not found:
        return "–"
    tied = [name(line) for _, line in found.tied.iterrows()]
    more = len(tied) - kNamed
    also = ", ".join(tied[:kNamed]) + (f", {more} more" if more > 0 else "")
    return (f'{swatch(found.best["method"])} <b>{text(name(found.best))}</b>'
            f'<span class="under wrap">{text(setting_words(found.best["setting"]))}</span>'
            f"{shown(found.best, error)}"
            + (f'<span class="under wrap">≈ {text(also)}</span>' if tied else ""))


def about(part: pd.DataFrame) -> str:
    """What a scene's seconds are of."""
    first, said = part.iloc[0], []
    if {"width", "height"} <= set(part) and pd.notna(first["width"]):
        said.append(f"{first['width']:.0f} × {first['height']:.0f} pixels")
    runs = sorted({int(part["n"].min()), int(part["n"].max())})
    return "; ".join([*said, " to ".join(map(str, runs)) + f" run{'s' if runs[-1] > 1 else ''}"])


def _scene(scene: str) -> str:
    return scene.replace("_", " ")


def budget_table(everything: pd.DataFrame, error: str) -> str:
    """A line for each scene, a column for each budget; one cell where the answer stays the same."""
    times = columns(everything["seconds"])
    head = "<th>scene</th>" + "".join(f"<th>{time:g} s</th>" for time in times)
    lines = []
    for scene, part in everything.groupby("scene"):
        cells: list[list] = []  # HTML, columns
        for time in times:
            made = _cell(answer(part, time, error), error)
            if cells and cells[-1][0] == made:
                cells[-1][1] += 1
            else:
                cells.append([made, 1])
        spans = "".join(f'<td{f" colspan={chr(34)}{n}{chr(34)}" if n > 1 else ""}>{made}</td>' for made, n in cells)
        lines.append(f'<tr><td class="key"><b>{text(_scene(scene))}</b><span class="under wrap">{text(about(part))}'
                     f"</span></td>{spans}</tr>")
    return f'<div class="scroll">{table(head, lines, "wide seconds")}</div>'


def present(everything: pd.DataFrame) -> list[str]:
    return [error for error in kMetrics if error in everything and everything[error].notna().any()]


def _three(line: pd.Series, column: str) -> list:
    return [interactive.short(line[f"{column}{side}"], kDigits) for side in ("", "_from", "_to")]


def collected(everything: pd.DataFrame) -> dict:
    """What the script chooses from: of each method the settings that none of its own beats, by any error."""
    errors, methods = present(everything), method_order(everything["method"])
    scenes = []
    for scene, part in everything.groupby("scene"):
        kept = set()
        for _, mine in part.groupby("method"):
            for error in errors:
                known = mine[mine[error].notna()]
                kept |= set(known.index[on_front(known["seconds"], known[error])])
        points = []
        for _, line in part.loc[sorted(kept)].iterrows():
            points.append([methods.index(line["method"]), setting_words(line["setting"]), *_three(line, "seconds"),
                           [[*_three(line, error), int(own_error(line, error))] for error in errors]])
        scenes.append({"name": _scene(scene), "about": about(part), "slowest": interactive.short(part["seconds"].max()),
                       "points": points})
    return {"methods": [m.replace("_", " ") for m in methods], "scenes": scenes,
            "metrics": [{"error": e, "words": kMetrics[e][0], "unit": kMetrics[e][1]} for e in errors]}


def _first(everything: pd.DataFrame) -> float:
    """The middle one of the budgets, in which every scene has an answer where there is such a one."""
    times = columns(everything["seconds"])
    slowest = everything.groupby("scene")["seconds"].min().max()
    enough = [time for time in times if time >= slowest] or times[-1:]
    return max(enough[0], times[len(times) // 2])


def _notes(everything: pd.DataFrame) -> str:
    single = int((everything["n"] < 2).sum())
    two = int((everything["n"] == 2).sum())
    how = ["brackets: the 95 % bootstrap interval of the median of the runs"]
    if few := few_note(everything["n"]):
        how.append(few[0].lower() + few[1:].rstrip("."))
    if two:
        how.append("of two runs, both")
    if single:
        how.append(f"{style.plural(single, 'setting')} ran once, so that nobody knows how sure they are")
    if "relmse_scale" in everything and everything["relmse_scale"].notna().all():
        scaled = ("for relMSE both pictures are scaled by 1 / mean luminance of the reference, so that dark scenes are "
                  "judged like bright ones")
    else:
        scaled = ("some file has the relMSE of pictures as bright as they are: where the light is far below "
                  "1 W/(m² sr) it is but a squared error. Measure again for one that does not depend on brightness")
    return "".join(map(note_line, (
        "in each cell the setting of least error whose median time is within the budget. ≈ names methods whose own "
        "best within it the runs do not tell from that: their intervals overlap. * marks what is no farther from the "
        "truth than the reference itself", "; ".join(how),
        "seconds are those of the indirect light, on the machine named below, at the size under the scene's name",
        scaled)))


def another() -> str:
    """How to ask for what was not measured."""
    return ('<p class="note">For another scene, size or machine: <code>icbench pareto --scene NAME --size 640x480 '
            "--out pareto.json</code> (or a scene file in place of the name), then <code>plots/report.py</code> with "
            "the file.</p>")


def section(measured: Measured, everything: pd.DataFrame) -> str:
    """The form, hidden until a script shows it, and the tables: one by one on the screen, all on paper."""
    errors = present(everything)
    identity = f"{measured.slug}-seconds-data"
    select = "".join(f'<option value="{i}">{text(kMetrics[e][0])}</option>' for i, e in enumerate(errors))
    form = (f'<form class="question" hidden><label>Seconds for the indirect light <input name="seconds" type="number" '
            f'min="0" step="any" value="{_first(everything):g}" required></label>'
            f'<label>judged by <select name="metric">{select}</select></label></form>'
            '<div class="answer" role="status" aria-live="polite"></div>')
    tables = ""
    for error in errors:
        words, unit, _ = kMetrics[error]
        heading = text(f"{kTitle}: what has the least {words}" + (f", {unit}" if unit else ""))
        tables += f'<div class="by" data-error="{error}"><h3>{heading}</h3>{budget_table(everything, error)}</div>'
    return (f'<div class="budget" data-from="{identity}">{form}{tables}</div>{_notes(everything)}{another()}'
            f"{interactive.data(identity, collected(everything))}")
