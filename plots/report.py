#!/usr/bin/env python3
"""Builds report.html, one self-contained page, and all figures from results files of icbench."""
from __future__ import annotations

import base64
import html
import io
import json
import re
import shlex
import sys
from pathlib import Path
from string import Template

import style  # first: it chooses matplotlib's backend

import pandas as pd
from PIL import Image

import speed_error
from figure import Omitted, Written, folder_of, parser, write
from figures import FIGURES
from findings import findings, leaders, structures, synchronised, warnings
from over_threads import cache_rows, panels_of, thread_marks
from results import InputError, Setup, load, summarise

kTemplate = Path(__file__).resolve().parent / "template.html"
kTableColumns = 6        # thread counts a table shows
kPixelsPerPoint = 1.72   # a figure of full width fills the page on a laptop
kPicturePixels = 1000    # larger pictures are scaled down to this before they are inlined


def text(value) -> str:
    return html.escape(str(value), quote=True)


def _data_uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def _svg(path: Path) -> bytes:
    """The drawing made small: no document type or metadata (they name addresses elsewhere), no needless digits,
    and each style spelled out once."""
    drawing = path.read_text(encoding="utf-8")
    drawing = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", drawing[drawing.index("<svg"):], flags=re.S)
    drawing = re.sub(r'<g id="[A-Za-z0-9]+_\d+">', "<g>", drawing)
    drawing = re.sub(r"(scale\([^)]*\))|(\d\.\d\d)\d+", lambda m: m[1] or m[2], drawing)
    styles: dict[str, str] = {}
    drawing = re.sub(r'(?<= )style="([^"]*)"', lambda m: f'class="{styles.setdefault(m[1], f"s{len(styles)}")}"', drawing)
    sheet = "".join(f".{name}{{{rule}}}" for rule, name in styles.items())
    drawing = drawing.replace("<defs>", f"<style>{sheet}</style><defs>", 1)
    return re.sub(r"\s+", " ", drawing).replace("> <", "><").encode()


def _mean_interval(median: float, low: float, high: float, scale: float = 1.0) -> str:
    out = style.number(median * scale)
    if pd.notna(low):
        out += f" <small>[{style.number(low * scale)}, {style.number(high * scale)}]</small>"
    return out


def _summary(setup: Setup) -> str:
    rows, context = setup.rows, setup.context
    cached = cache_rows(setup)
    counts = sorted(rows["threads"].unique())
    repetitions = summarise(rows, ["panel", "cache", "threads"], "seconds")["n"]
    span = f"{repetitions.min()}" if repetitions.min() == repetitions.max() else \
        f"{repetitions.min()} to {repetitions.max()}"
    kinds = ", ".join(dict.fromkeys(k.replace("_", " ") for k in rows["workload_kind"] if k))
    what = (f"{style.plural(cached['cache'].nunique(), 'cache')} on "
            f"{style.plural(cached['structure'].nunique(), 'structure')}; "
            f"{style.plural(rows['workload'].nunique(), 'workload')} ({kinds}); threads: "
            f"{', '.join(style.thread_label(t) for t in counts)}; repetitions a cell: {span}; "
            f"{style.plural(len(rows), 'trial')} in all")
    parts = [context.get("cpu") or context.get("cpu_model")]
    for key, name in (("packages", "socket"), ("cores", "core"), ("num_cpus", "processing unit")):
        if context.get(key) is not None:
            parts.append(f"{context[key]} {name}{'' if str(context[key]) == '1' else 's'}")
    parts += [context.get("compiler"), f"commit {str(context['commit'])[:12]}" if context.get("commit") else None]
    where = "; ".join(text(p) for p in parts if p)
    dates = sorted(str(c["date"]) for c in setup.contexts if c.get("date"))
    cards = []
    for finding in findings(setup):
        value, bracket, rest = finding.value.partition(" [")
        shown = text(value) + (f" <span>[{text(rest)}</span>" if bracket else "")
        cards.append(f'<div class="card"><div class="what">{text(finding.title)}</div><div class="value">{shown}</div>'
                     f'<div>{text(finding.text)}</div><div class="base">{text(finding.base)}</div></div>')
    if not cards:
        cards.append('<div class="card"><div>The rows carry no comparison of a lock with anything else on one '
                     'structure, and no errors beside path tracing, so there is no headline.</div></div>')
    return (f'<div class="facts"><div><b>What was measured</b>{text(what)}</div>'
            f'<div><b>On what</b>{where or "the file does not say"}{"; " + text(dates[0][:16]) if dates else ""}</div></div>'
            f'<div class="cards">{"".join(cards)}</div>'
            '<p class="note">Numbers are medians over repetitions; brackets are 95 % bootstrap intervals. A ratio is '
            'the median of ratios paired by repetition, and names its base.</p>')


def _warnings(setup: Setup) -> str:
    found = warnings(setup)
    if not found:
        return "<p>None.</p>"
    return '<ul class="warnings">' + "".join(
        f'<li{" class=grave" if w.grave else ""}>{text(w.text)}</li>' for w in found) + "</ul>"


def _leader_tables(setup: Setup) -> str:
    """Per structure: the best mechanism of every workload at all cores and beyond."""
    rows = synchronised(cache_rows(setup))
    made = []
    full, beyond = thread_marks(setup, rows) if not rows.empty else (1, None)
    marks = [m for m in (full, beyond) if m]
    for structure in structures(setup):
        mine = rows[rows["structure"] == structure]
        titles, note = panels_of(mine)
        tables = {m: leaders(mine[mine["threads"] == m], "items_per_second") for m in marks}
        tables = {m: t.set_index("panel") for m, t in tables.items() if not t.empty}
        head = "".join(f'<th>best at {style.threads_text(m)}, M operations/s</th><th>times the best of the other kind</th>'
                       for m in tables)
        body = ""
        for title in titles:
            cells = ""
            for table in tables.values():
                if title not in table.index:
                    cells += "<td>–</td><td>–</td>"
                    continue
                line = table.loc[title]
                sure = "" if line["ratio_low"] > 1 else " ≈"
                ratio = (f'{_mean_interval(line["ratio"], line["ratio_low"], line["ratio_high"])}{sure}'
                         f'<span class="under">{text(line["rival"])}</span>' if line["rival"] else "–")
                cells += (f'<td>{text(line["best"])}<span class="under">'
                          f'{_mean_interval(line["median"], line["low"], line["high"], 1e-6)}</span></td><td>{ratio}</td>')
            body += f"<tr><td>{text(title)}</td>{cells}</tr>"
        made.append(f"<h3>Structure: {text(structure)}</h3><table><thead><tr><th>workload</th>{head}</tr></thead>"
                    f"<tbody>{body}</tbody></table>" + (f'<p class="note">{text(note)}</p>' if note else ""))
    if not made:
        return "<p>No structure carries both a lock and something that is none.</p>"
    return ('<p class="note">A lock is compared with the best cache without one, and the reverse, always on one '
            "structure. ≈ marks an undecided ratio: its interval holds 1, or there are too few repetitions.</p>"
            + "".join(made))


def _throughput_tables(setup: Setup) -> str:
    rows = cache_rows(setup)
    rows = rows[rows["items_per_second"].notna()]
    if rows.empty:
        return "<p>No row has items_per_second.</p>"
    counts = sorted(rows["threads"].unique())
    if len(counts) > kTableColumns:
        full, beyond = thread_marks(setup, rows)
        keep = {counts[0], counts[-1], full, *([beyond] if beyond else [])}
        keep |= set([c for c in counts if c not in keep][::-1][:kTableColumns - len(keep)])
        counts = sorted(keep)
    over = set(rows.loc[rows["oversubscribed"], "threads"])
    made = []
    for structure, mine in rows.groupby("structure"):
        titles, note = panels_of(mine)
        table = summarise(mine[mine["threads"].isin(counts)], ["panel", "cache", "threads"], "items_per_second")
        cells = {(r.panel, r.cache, r.threads): _mean_interval(r.median, r.low, r.high, 1e-6)
                 for r in table.itertuples()}
        shade = {c: ' class="n over"' if c in over else ' class="n"' for c in counts}
        head = "".join(f"<th{shade[c]}>{style.threads_text(c)}</th>" for c in counts)
        body = ""
        for title in titles:
            body += f'<tr class="head"><td colspan="{len(counts) + 1}">{text(title)}</td></tr>'
            for cache in style.cache_order(mine.loc[mine["panel"] == title, "cache"]):
                body += f"<tr><td>{text(cache)}</td>" + "".join(
                    f"<td{shade[c]}>{cells.get((title, cache, c), '–')}</td>" for c in counts) + "</tr>"
        made.append(f'<h3>Structure: {text(structure)}</h3><table class="wide"><thead><tr><th>million operations per '
                    f"second</th>{head}</tr></thead><tbody>{body}</tbody></table>"
                    + (f'<p class="note">{text(note)}</p>' if note else ""))
    return "".join(made)


def _error_table(setup: Setup) -> str:
    """The settings on the Pareto front of each scene at all cores."""
    try:
        table = speed_error.points(setup)
    except Omitted as why:
        return f"<p>Left out: {text(why)}.</p>"
    threads = thread_marks(setup, table)[0]
    body = ""
    for scene, part in table[table["threads"] == threads].groupby("scene"):
        body += f'<tr class="head"><td colspan="4">{text(scene.replace("_", " "))}</td></tr>'
        for line in speed_error.front(part).to_dict("records"):
            setting = [f"{line[key]:g} {word}" for key, word in (("spp", "samples a pixel"), ("rays_per_record", "rays"))
                       if pd.notna(line[key])]
            setting += [f"a = {line['accuracy']:g}"] if pd.notna(line["accuracy"]) else []
            body += (f"<tr><td>{text(line['series'])}</td><td>{text(', '.join(setting))}</td><td class=n>"
                     f"{_mean_interval(line['seconds'], line['seconds_low'], line['seconds_high'])}</td><td class=n>"
                     f"{_mean_interval(line['relmse'], line['relmse_low'], line['relmse_high'])}</td></tr>")
    return (f"<p class=note>At {style.threads_text(threads)}, the settings that no other one beats in both time and "
            'error, over all structures.</p><table><thead><tr><th>method</th><th>setting</th><th class="n">seconds for '
            f'the indirect light</th><th class="n">relMSE</th></tr></thead><tbody>{body}</tbody></table>')


def _pictures(setup: Setup) -> str:
    made = []
    for folder in dict.fromkeys(path.resolve().parent / "images" for path in setup.paths):
        for path in sorted(folder.glob("*.png")):
            try:
                picture = Image.open(path)
                picture.load()
            except (OSError, SyntaxError, Image.DecompressionBombError):
                made.append(f'<p class="note">{text(path.name)} is not a picture that can be read.</p>')
                continue
            data = path.read_bytes()
            if max(picture.size) > kPicturePixels:
                picture.thumbnail((kPicturePixels, kPicturePixels))
                buffer = io.BytesIO()
                picture.save(buffer, "PNG", optimize=True)
                data = buffer.getvalue()
            about = _about_picture(path)
            made.append(f'<figure><img src="{_data_uri("image/png", data)}" alt="{text(about)}">'
                        f"<figcaption>{text(about)}</figcaption></figure>")
    return f'<div class="pictures">{"".join(made)}</div>' if made else ""


def _about_picture(path: Path) -> str:
    """The caption from NAME.json, or the name."""
    try:
        said = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        said = None
    if not isinstance(said, dict):
        return path.stem.replace("_", " ")
    words = [str(said[key]).replace("_", " ") if key in ("scene", "integrator") else f"cache {said[key]}"
             for key in ("scene", "integrator", "cache") if said.get(key) not in (None, "", "none")]
    if isinstance(said.get("seconds"), (int, float)):
        words.append(style.duration(said["seconds"]))
    return ", ".join(words) or path.stem.replace("_", " ")


def _environment(setup: Setup, command: str) -> str:
    out = ""
    for path, context in zip(setup.paths, setup.contexts):
        lines = ""
        for key, value in context.items():
            if key == "command_line":
                continue
            shown = ", ".join(map(str, value)) if isinstance(value, list) and not any(
                isinstance(v, (dict, list)) for v in value) else value if isinstance(value, (str, int, float)) \
                else json.dumps(value)
            lines += f'<tr><td>{text(key)}</td><td class="raw">{text(shown)}</td></tr>'
        ran = context.get("command_line")
        ran = shlex.join(map(str, ran)) if isinstance(ran, list) else ran
        out += (f"<h3>{text(path)}</h3><p>Measured with</p><pre>{text(ran or 'the file does not say')}</pre>"
                f"<table><tbody>{lines}</tbody></table>")
    return f"<p>This page was made with</p><pre>{text(command)}</pre>" + out


def _figure(number: int, done: Written) -> str:
    plates = []
    for title, path in done.plates:
        drawing = _svg(path)
        width = float(re.search(rb'width="([0-9.]+)pt"', drawing)[1]) * kPixelsPerPoint
        plates.append(f'<figure><img src="{_data_uri("image/svg+xml", drawing)}" style="width:{width:.0f}px" '
                      f'alt="{text(done.figure.title)}, {text(title)}"></figure>')
    notes = "".join(f'<p class="note">{text(note[0].upper() + note[1:])}.</p>' for note in done.notes)
    folder = done.pdf.parent.name
    first, *others = plates
    return (f'<div class="keep"><h3 id="{done.figure.name}">{number}. {text(done.figure.title)}</h3><div class="read"><b>'
            f"How to read this.</b> {text(done.figure.how_to_read)}</div>{first}</div>{''.join(others)}{notes}"
            f'<p class="note">For a paper: <code>{text(folder)}/{text(done.pdf.name)}</code>; the numbers: '
            f"<code>{text(folder)}/{text(done.csv.name)}</code></p>")


def section(setup: Setup, folder: Path, command: str, prefix: str, several: bool) -> str:
    """Everything about one setup; figures are written to `folder`."""
    drawn, left_out = [], []
    for figure in FIGURES:
        print(f"figure {figure.name}: ", end="", flush=True)
        try:
            drawn.append(write(figure, setup, folder))
            print("done")
        except Omitted as why:
            left_out.append(f"{figure.title}: left out, {why}.")
            print(f"left out, {why}")
    name = f": {setup.label}" if several else ""
    anchors = ("summary", "warnings", "leaders", "pictures", "figures", "tables", "environment")
    ids = {a: f"{prefix}{a}" for a in anchors}
    pictures = _pictures(setup)
    count = len(warnings(setup))
    links = [("warnings", style.plural(count, "warning")), ("leaders", "Best mechanisms"),
             ("figures", "Figures"), ("tables", "Tables"), ("environment", "Environment")]
    links += [("pictures", "Scenes")] if pictures else []
    nav = "".join(f'<a href="#{ids[a]}">{label}</a>' for a, label in links)
    banner = ('<div class="banner">Incomplete results: the run was cut short, and what follows shows only what was '
              "measured until then.</div>" if setup.complete is False else "")
    figures = "".join(_figure(i, done) for i, done in enumerate(drawn, 1))
    figures = figures.replace(' id="', f' id="{prefix}')
    omitted = "".join(f'<p class="note">{text(line)}</p>' for line in left_out)
    head = f'<h2 id="{ids["summary"]}">Machine{text(name)}</h2>' if several else ""
    return (f'{head}{banner}<nav>{nav}</nav>{_summary(setup)}'
            f'<h2 class="flow" id="{ids["warnings"]}">Before you believe a number</h2>{_warnings(setup)}'
            f'<h2 class="flow" id="{ids["leaders"]}">Best mechanism per workload</h2>{_leader_tables(setup)}'
            + (f'<h2 class="flow" id="{ids["pictures"]}">Scenes</h2>{pictures}' if pictures else "")
            + f'<h2 id="{ids["figures"]}">Figures</h2>{omitted}{figures}'
            f'<h2 id="{ids["tables"]}">Tables</h2><p class="note">Median [low, high] over repetitions; shaded columns '
            f"are oversubscribed.</p><h3>Speed against error</h3>{_error_table(setup)}{_throughput_tables(setup)}"
            f'<h2 id="{ids["environment"]}">Environment</h2>{_environment(setup, command)}')


def build(paths: list[Path], out: Path, command: str) -> Path:
    """Writes out/report.html and out/figures; returns the page. Raises InputError or OSError."""
    setups = load(paths)
    several = len(setups) > 1
    out.mkdir(parents=True, exist_ok=True)
    body = ('<h1>Shared irradiance caches, measured</h1><p class="lead">An irradiance cache keeps the indirect light that '
            "a ray tracer has computed at some points, so that all its threads can reuse it nearby. This report "
            "compares ways to let many threads read and write such a cache at once.</p>")
    if several:
        names = "; ".join(s.label for s in setups)
        body += (f'<p class="lead">The files come from {len(setups)} machines or builds ({text(names)}). Each has a part '
                 "of its own below: nothing is merged or compared across them.</p>")
    for index, setup in enumerate(setups):
        prefix = f"{setup.slug}-" if several else ""
        body += section(setup, folder_of(setup, setups, out / "figures"), command, prefix, several)
    page = out / "report.html"
    label = setups[0].label if not several else f"{len(setups)} setups"
    page.write_text(Template(kTemplate.read_text(encoding="utf-8")).substitute(
        title=text(f"icbench: {label}"), body=body), encoding="utf-8")
    return page


def main() -> int:
    arguments = parser(__doc__).parse_args()
    try:
        print(build(arguments.results, arguments.out or arguments.results[0].parent, shlex.join(sys.argv)))
    except (InputError, OSError) as error:
        print(f"report.py: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
