"""The tables of the report, as HTML: median [low, high] over repetitions."""
from __future__ import annotations

import html

import pandas as pd

import speed_error
import style
from figure import Omitted
from findings import leaders, structures, synchronised
from intervals import summarise
from over_threads import cache_rows, panels_of, thread_marks
from results import Setup

kColumns = 6  # thread counts a table shows


def text(value) -> str:
    """A value as HTML text, safe in attributes too."""
    return html.escape(str(value), quote=True)


def interval(median: float, low: float, high: float, scale: float = 1.0) -> str:
    """median [low, high]; without brackets where there is no interval."""
    shown = style.number(median * scale)
    if pd.notna(low):
        shown += f" <small>[{style.number(low * scale)}, {style.number(high * scale)}]</small>"
    return shown


def table(head: str, rows: list[str], kind: str = "") -> str:
    return f'<table class="{kind}"><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table>'


def note_line(note: str) -> str:
    return f'<p class="note">{text(style.capital(note))}.</p>' if note else ""


def best_mechanisms(setup: Setup) -> str:
    """Per structure: the best mechanism of every workload at all cores and beyond."""
    rows = synchronised(cache_rows(setup))
    made = []
    full, beyond = thread_marks(setup, rows) if not rows.empty else (1, None)
    for structure in structures(setup):
        mine = rows[rows["structure"] == structure]
        titles, note = panels_of(mine)
        best = {}
        for threads in (full, beyond):
            found = leaders(mine[mine["threads"] == threads], "items_per_second")
            if not found.empty:
                best[threads] = found.set_index("panel")
        head = "<th>workload</th>" + "".join(
            f"<th>best at {style.threads_text(threads)}, M operations/s</th>"
            "<th>times the best of the other kind</th>" for threads in best)
        lines = [f"<tr><td>{text(title)}</td>{''.join(_leader(found, title) for found in best.values())}</tr>"
                 for title in titles]
        made.append(f'<h3>Structure: {text(structure)}</h3><div class="scroll">{table(head, lines)}</div>'
                    f"{note_line(note)}")
    if not made:
        return "<p>No structure carries both a lock and something that is none.</p>"
    return ('<p class="note">A lock is compared with the best cache without one, and the reverse, always on '
            "one structure. ≈ marks an undecided ratio: its interval holds 1, or there are too few "
            f'repetitions.</p>{"".join(made)}')


def _leader(found: pd.DataFrame, title: str) -> str:
    """Two cells: the best cache with its throughput, its ratio to the best of the other kind."""
    if title not in found.index:
        return "<td>–</td><td>–</td>"
    line = found.loc[title]
    speed = interval(line["median"], line["low"], line["high"], 1e-6)
    first = f'<td>{text(line["best"])}<span class="under">{speed}</span></td>'
    if not line["rival"]:
        return first + "<td>–</td>"
    ratio = interval(line["ratio"], line["ratio_low"], line["ratio_high"])
    undecided = "" if line["ratio_low"] > 1 else " ≈"
    return f'{first}<td>{ratio}{undecided}<span class="under">{text(line["rival"])}</span></td>'


def _counts_shown(setup: Setup, rows: pd.DataFrame) -> list[int]:
    """At most kColumns thread counts: the ends, all cores, four a core, then the largest others."""
    counts = sorted(rows["threads"].unique())
    full, beyond = thread_marks(setup, rows)
    wanted = [counts[0], counts[-1], full, *([beyond] if beyond else []), *reversed(counts)]
    return sorted(list(dict.fromkeys(wanted))[:kColumns])


def throughput(setup: Setup) -> str:
    """Per structure: every cache over thread counts, in blocks of a workload."""
    rows = cache_rows(setup)
    rows = rows[rows["items_per_second"].notna()]
    if rows.empty:
        return "<p>No row has items_per_second.</p>"
    counts = _counts_shown(setup, rows)
    over = set(rows.loc[rows["oversubscribed"], "threads"])
    kind = {count: "n over" if count in over else "n" for count in counts}
    head = "<th>million operations per second</th>" + "".join(
        f'<th class="{kind[count]}">{style.threads_text(count)}</th>' for count in counts)
    made = []
    for structure, mine in rows.groupby("structure"):
        titles, note = panels_of(mine)
        medians = summarise(mine[mine["threads"].isin(counts)], ["panel", "cache", "threads"],
                            "items_per_second")
        cells = {(r.panel, r.cache, r.threads): interval(r.median, r.low, r.high, 1e-6)
                 for r in medians.itertuples()}
        lines = []
        for title in titles:
            lines.append(f'<tr class="head"><td colspan="{len(counts) + 1}">{text(title)}</td></tr>')
            for cache in style.cache_order(mine.loc[mine["panel"] == title, "cache"]):
                values = "".join(f'<td class="{kind[count]}">{cells.get((title, cache, count), "–")}</td>'
                                 for count in counts)
                lines.append(f"<tr><td>{text(cache)}</td>{values}</tr>")
        made.append(f"<h3>Structure: {text(structure)}</h3>{table(head, lines, 'wide')}{note_line(note)}")
    return "".join(made)


def errors(setup: Setup) -> str:
    """The settings on the Pareto front of each scene, and of each placement, at all cores."""
    try:
        points = speed_error.points(setup)
    except Omitted as why:
        return f"<p>Left out: {text(why)}.</p>"
    threads = thread_marks(setup, points)[0]
    lines = []
    several = points["placement"].nunique() > 1
    for (scene, placement), part in points[points["threads"] == threads].groupby(["scene", "placement"]):
        heading = scene.replace("_", " ") + (f", {placement}" if several else "")
        lines.append(f'<tr class="head"><td colspan="4">{text(heading)}</td></tr>')
        for point in speed_error.front(part).to_dict("records"):
            seconds = interval(point["seconds"], point["seconds_low"], point["seconds_high"])
            relmse = interval(point["relmse"], point["relmse_low"], point["relmse_high"])
            lines.append(f'<tr><td>{text(point["series"])}</td><td>{text(_setting(point))}</td>'
                         f'<td class="n">{seconds}</td><td class="n">{relmse}</td></tr>')
    head = ('<th>method</th><th>setting</th><th class="n">seconds for the indirect light</th>'
            '<th class="n">relMSE</th>')
    return (f'<p class="note">At {style.threads_text(threads)}, the settings that no other one beats in both '
            f"time and error, over all structures.</p>{table(head, lines)}")


def scaling_laws(laws: pd.DataFrame | None) -> str:
    """The parameters of the fitted laws; `laws`: the data of that figure, None where there is none."""
    if laws is None or laws.empty:
        return ""
    head = ('<th>cache</th><th class="n">γ, M operations/s</th><th class="n">α</th><th class="n">β</th>'
            '<th class="n">most throughput at, threads</th>')
    lines = []
    for panel, part in laws.groupby("panel", sort=False):
        lines.append(f'<tr class="head"><td colspan="5">{text(panel)}</td></tr>')
        for cache in style.cache_order(part["cache"]):
            line = part[part["cache"] == cache].iloc[0]
            cells = [interval(line[n], line[f"{n}_low"], line[f"{n}_high"], scale)
                     for n, scale in (("gamma", 1e-6), ("alpha", 1), ("beta", 1))]
            cells.append(_peak(line))
            lines.append(f"<tr><td>{text(cache)}</td>{''.join(f'<td class=n>{c}</td>' for c in cells)}</tr>")
    last = " to ".join(f"{count:g}" for count in sorted({laws["largest_count"].min(), laws["largest_count"].max()}))
    return ("<h3>Scaling laws</h3><details><summary>Parameters of the fitted laws</summary>"
            f'<p class="note">Fitted to at most {last} threads without oversubscription; a peak past them, *, is an '
            f"extrapolation. ∞: the fitted law never falls.</p>{table(head, lines)}</details>")


def _peak(line: pd.Series) -> str:
    """The thread count of most throughput."""
    def number(value: float) -> str:
        return "∞" if value == float("inf") else style.number(value)
    shown = number(line["peak_threads"])
    if pd.notna(line["peak_low"]):
        shown += f" <small>[{number(line['peak_low'])}, {number(line['peak_high'])}]</small>"
    return shown + (" *" if line["peak_threads"] > line["largest_count"] else "")


def _setting(point: dict) -> str:
    forms = {"spp": "{:g} samples a pixel", "rays_per_record": "{:g} rays", "accuracy": "a = {:g}"}
    return ", ".join(form.format(point[key]) for key, form in forms.items() if pd.notna(point[key]))
