#!/usr/bin/python3
"""Builds report.html, one self-contained page, and all figures from results files of icbench."""
from __future__ import annotations

import ctypes
import io
import json
import os
import shlex
import signal
import sys
import time
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from string import Template

import style  # first: it checks what is installed, and takes interrupts

import pandas as pd
from PIL import Image

import anatomy_page
import anatomy_results
import breakdown_page
import choice_page
import comparison_page
import correctness
import correctness_page
import explorer
import interactive
import interrupts
import pareto_choice
import pareto_page
import pareto_results
import preemption_page
import preemption_results
import repeatability_page
import repeatability_results
import simulated
import simulated_page
import tables
import timeline_page
import timeline_results
from cautions import cautions
from comparison import comparisons, one_versions, same_changes
from figure import Omitted, Written, folder_of, parser, write
from figures import (ANATOMY_FIGURES, BREAKDOWN_FIGURES, CHANGE_FIGURES, COMPARISON_FIGURES, CORRECTNESS_FIGURES,
                     FIGURES, PARETO_FIGURES, PREEMPTION_FIGURES, REPEATABILITY_FIGURES, SIMULATED_FIGURES,
                     TIMELINE_FIGURES, VERSION_FIGURES)
from files import write_whole
from findings import Finding, findings
from inline import data_uri, drawing, image
from over_threads import cache_rows
from results import InputError, Setup, load
from tables import note_line, text

kTemplate = Path(__file__).resolve().parent / "template.html"
kVerdicts = "correctness.json"
kPareto = "pareto*.json"
kRepeatability = "repeatability*.json"
kAnatomy = "anatomy*.json"
kPreemption = "preempt*.json"
kTimelines = "timeline*.json"
kBreakdowns = "breakdown*.json"
# What may stand beside the results, by option.
kBeside = ("correctness", "pareto", "repeatability", "anatomy", "preemption", "timelines", "breakdowns")
kPicturePixels = 1000    # larger pictures are scaled down to this before they are inlined
kParentDeathSignal = 1   # PR_SET_PDEATHSIG of prctl(2)
kForkPays = 2.0          # seconds of drawing alone
kLongestValue = 600      # characters of an environment value that are shown
kIntroduction = """<h1>Shared irradiance caches, measured</h1>
<p class="lead">An irradiance cache keeps the indirect light that a ray tracer has computed at some points, so
that all its threads can reuse it nearby. This report compares ways to let many threads read and write such a
cache at once.</p>
"""
kHowNumbersAreMade = """<p class="note">Numbers are medians over repetitions; brackets are 95 % bootstrap
intervals. A ratio is the median of ratios paired by repetition, and names its base.</p>
"""


def _card(finding: Finding) -> str:
    value, bracket, rest = finding.value.partition(" [")
    shown = text(value) + (f" <span>[{text(rest)}</span>" if bracket else "")
    return (f'<div class="card"><div class="what">{text(finding.title)}</div><div class="value">{shown}</div>'
            f'<div>{text(finding.text)}</div><div class="base">{text(finding.base)}</div></div>')


def _summary(setup: Setup) -> str:
    """What was measured, on what, and the findings: one screen."""
    rows, context = setup.rows, setup.context
    cached = cache_rows(setup)
    repetitions = rows.groupby(["panel", "cache", "threads"]).size()
    span = " to ".join(str(n) for n in sorted({repetitions.min(), repetitions.max()}))
    kinds = ", ".join(dict.fromkeys(k.replace("_", " ") for k in rows["workload_kind"] if k))
    what = "; ".join((
        f"{style.plural(cached['cache'].nunique(), 'cache')} on "
        f"{style.plural(cached['structure'].nunique(), 'structure')}",
        f"{style.plural(rows['workload'].nunique(), 'workload')} ({kinds})",
        f"threads: {', '.join(style.thread_label(t) for t in sorted(rows['threads'].unique()))}",
        f"repetitions a cell: {span}", f"{style.plural(len(rows), 'trial')} in all"))
    counts = ((setup.packages, "socket"), (setup.cores, "core"), (setup.processing_units, "processing unit"))
    where = [context.get("cpu_model") or context.get("cpu")]
    where += [style.plural(count, word) for count, word in counts if count]
    where.append(context.get("compiler"))
    where.append(f"commit {str(context['commit'])[:12]}" if context.get("commit") else None)
    where += sorted(str(c["date"])[:16] for c in setup.contexts if c.get("date"))[:1]
    place = "; ".join(str(part) for part in where if part) or "the file does not say"
    cards = "".join(map(_card, findings(setup)))
    if not cards:
        cards = ('<div class="card">The rows carry no comparison of a lock with anything else on one '
                 "structure, and no errors beside path tracing, so there is no headline.</div>")
    return (f'<div class="facts"><div><b>What was measured</b>{text(what)}</div>'
            f'<div><b>On what</b>{text(place)}</div></div>'
            f'<div class="cards">{cards}</div>{kHowNumbersAreMade}')


def _warnings(setup: Setup) -> str:
    items = "".join(f'<li class="{"grave" if c.grave else ""}">{text(c.text)}</li>' for c in cautions(setup))
    return f'<ul class="warnings">{items}</ul>' if items else "<p>None.</p>"


def _pictures(setup: Setup) -> str:
    """images/*.png beside the results, with what NAME.json says about them."""
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
            made.append(f'<figure>{image(data_uri("image/png", data), about, *picture.size)}'
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
    words = [str(said[key]).replace("_", " ") if key != "cache" else f"cache {said[key]}"
             for key in ("scene", "integrator", "cache") if said.get(key) not in (None, "", "none")]
    if isinstance(said.get("seconds"), (int, float)):
        words.append(style.duration(said["seconds"]))
    return ", ".join(words) or path.stem.replace("_", " ")


def _shown(value) -> str:
    """An environment value as text; long ones (pin maps of many threads) are cut, and say so."""
    if isinstance(value, list) and not any(isinstance(v, (dict, list)) for v in value):
        value = ", ".join(map(str, value))
    elif not isinstance(value, str):
        value = json.dumps(value)
    if len(value) > kLongestValue:
        return f"{value[:kLongestValue]} … ({len(value):,} characters)"
    return value


def _environment(setup: Setup, command: str) -> str:
    out = f"<p>This page was made with</p><pre>{text(command)}</pre>"
    for path, context in zip(setup.paths, setup.contexts):
        ran = context.get("command_line") or "the file does not say"
        ran = shlex.join(map(str, ran)) if isinstance(ran, list) else ran
        lines = "".join(f'<tr><td>{text(key)}</td><td class="raw">{text(_shown(value))}</td></tr>'
                        for key, value in context.items() if key != "command_line")
        made = "Simulated" if context.get("simulated") else "Measured"
        out += (f"<h3>{text(path)}</h3><p>{made} with</p><pre>{text(ran)}</pre>"
                f"<table><tbody>{lines}</tbody></table>")
    return out


def _figure(heading: str, done: Written, prefix: str, out: Path) -> str:
    first, *others = (drawing(path, f"{done.figure.title}, {title}") for title, path in done.plates)
    return (f'<div class="keep"><h3 id="{prefix}{done.figure.name}">{text(heading)}</h3>'
            f'<div class="read"><b>How to read this.</b> {text(done.figure.how_to_read)}</div>{first}</div>'
            f'{"".join(others)}{"".join(map(note_line, done.notes))}'
            f'<p class="note">For a paper: <code>{text(done.pdf.relative_to(out))}</code>; the numbers: '
            f"<code>{text(done.csv.relative_to(out))}</code></p>")


_now: tuple[list, object, Path] = ([], None, Path())  # figures, of what, into which folder: what forks inherit


def _draw_one(number: int) -> Written | Omitted:
    figures, setup, folder = _now
    try:
        return replace(write(figures[number], setup, folder), figure=None)  # it may not be one that can be sent
    except Omitted as why:
        return why


def _end_with(parent: int) -> None:
    """Of a process that draws: it ends when `parent` does, whatever ended that, and not by itself when interrupted."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ctypes.CDLL(None).prctl(kParentDeathSignal, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before
        os._exit(1)


def _outcomes(figures: list, setup, folder: Path) -> Iterator[Written | Omitted]:
    """What became of each of `figures`: drawn one after another, or, once that has taken long, side by side on the
    processors that there are. (A process that forks from this one first takes half a second.)
    """
    global _now
    _now = figures, setup, folder
    start, done = time.monotonic(), 0
    while done < len(figures) and time.monotonic() - start < kForkPays:
        yield _draw_one(done)
        done += 1
    workers = min(len(figures) - done, len(os.sched_getaffinity(0)))
    sys.stdout.flush()  # or forks would say it again
    side_by_side = partial(ProcessPoolExecutor, workers, get_context("fork"), _end_with, (os.getpid(),))
    with side_by_side() if workers > 1 else nullcontext() as pool:
        yield from (pool.map if pool else map)(_draw_one, range(done, len(figures)))


def _draw(figures: list, setup, folder: Path) -> tuple[list[Written], list[str]]:
    """All of `figures`, and a line for each that is left out."""
    drawn, left_out = [], []
    for figure, outcome in zip(figures, _outcomes(figures, setup, folder)):
        if isinstance(outcome, Omitted):
            left_out.append(f"{figure.title}: left out, {outcome}")
            print(f"figure {figure.name}: left out, {outcome}", flush=True)
        else:
            drawn.append(replace(outcome, figure=figure))
            print(f"figure {figure.name}: done", flush=True)
    return drawn, left_out


def _simulated(setup: Setup, folder: Path, out: Path, prefix: str) -> str:
    """What icbench simulate says of this machine with more cores, file by file; "" where no file does."""
    made, found = "", simulated.load(setup.simulated_paths)
    for one in found:
        drawn, left_out = _draw(SIMULATED_FIGURES, one, folder_of(one, found, folder))
        own = prefix if len(found) == 1 else f"{prefix}{one.slug}-"
        file = "" if len(found) == 1 else f": {one.path.name}"
        shown = "".join(_figure(done.figure.title + file, done, own, out) for done in drawn)
        made += simulated_page.about(one) + shown + "".join(map(note_line, left_out)) + simulated_page.compared(one)
    return simulated_page.kLead + made if made else ""


def section(setup: Setup, figures: list, folder: Path, out: Path, command: str, prefix: str,
            further: dict[str, str]) -> str:
    """Everything about one setup; its `figures` are written to `folder`, which lies in `out`. `further`: links to
    the rest of the page, name by anchor.
    """
    drawn, left_out = _draw(figures, setup, folder)
    # One cache is called null, which is a missing number to pandas.
    laws = next((pd.read_csv(done.csv, keep_default_na=False, na_values=[""]) for done in drawn
                 if done.figure.name == "scaling_law"), None)
    shown = "".join(map(note_line, left_out))
    shown += "".join(_figure(f"{number}. {done.figure.title}", done, prefix, out)
                     for number, done in enumerate(drawn, 1))
    numbers = ('<p class="note">Median [low, high] over repetitions; shaded columns are oversubscribed.</p>'
               f"<h3>Speed against error</h3>{tables.errors(setup)}{tables.throughput(setup)}"
               f"{tables.scaling_laws(laws)}")
    parts = [  # anchor, heading, link, starts a printed page, content
        ("warnings", "Before you believe a number", style.plural(len(cautions(setup)), "warning"), False,
         _warnings(setup)),
        ("leaders", "Best mechanism per workload", "Best mechanisms", False, tables.best_mechanisms(setup)),
        ("pictures", "Scenes", "Scenes", False, _pictures(setup)),
        ("explore", "Explore", "Explore", False, explorer.section(setup, prefix)),
        ("figures", "Figures", "Figures", True, shown),
        ("more-cores", simulated_page.kTitle, "Simulated", True, _simulated(setup, folder, out, prefix)),
        ("tables", "Tables", "Tables", True, numbers),
        ("environment", "Environment", "Environment", True, _environment(setup, command))]
    parts = [part for part in parts if part[4]]
    page = f'<h2 id="{prefix}summary">{text(setup.label)}</h2>' if prefix else ""
    links = "".join(f'<a href="#{prefix}{anchor}">{link}</a>' for anchor, _, link, _, _ in parts)
    links += "".join(f'<a href="#{anchor}">{name}</a>' for anchor, name in further.items())
    page += f'<nav>{links}</nav><h2 class="flow first" id="{prefix}choice">{choice_page.kTitle}</h2>'
    page += choice_page.section(setup, prefix)
    page += f'<h2 class="flow">What was measured, and what stands out</h2>{_summary(setup)}'
    for anchor, heading, _, breaks, content in parts:
        kind = "screen" if anchor == "explore" else "" if breaks else "flow"
        page += f'<h2 class="{kind}" id="{prefix}{anchor}">{heading}</h2>{content}'
    return page


def _verdicts_beside(paths: list[Path]) -> list[Path]:
    """The files of icstress in the folders of the results."""
    folders = dict.fromkeys(path.resolve().parent for path in paths)
    return [folder / kVerdicts for folder in folders if (folder / kVerdicts).exists()]


def _beside(paths: list[Path], pattern: str) -> list[Path]:
    """The files of that name in the folders of the results, but for those of an earlier run."""
    folders = dict.fromkeys(path.resolve().parent for path in paths)
    return [path for folder in folders for path in sorted(folder.glob(pattern))
            if not path.name.endswith(".previous.json")]


def _measured(found: list[pareto_results.Measured], figures: list, page, out: Path) -> str:
    """A section by `page` for each machine that another command of icbench ran on."""
    made = ""
    for one in found:
        drawn, left_out = _draw(figures, one, folder_of(one, found, out / "figures"))
        shown = "".join(_figure(done.figure.title, done, f"{one.slug}-", out) for done in drawn)
        made += page.section(one, one.slug, shown + "".join(map(note_line, left_out)))
    return made


def _breakdowns(found: list[Setup], out: Path) -> str:
    """Where time went, machine by machine."""
    made, folder = "", out / "figures" / "breakdown"
    for one in found:
        drawn, left_out = _draw(BREAKDOWN_FIGURES, one, folder_of(one, found, folder))
        anchor = f"breakdown-{one.slug}"
        shown = "".join(_figure(done.figure.title, done, f"{anchor}-", out) for done in drawn)
        made += breakdown_page.section(one, anchor, shown + "".join(map(note_line, left_out)), len(found) > 1)
    return made


def _differences(setups: list[Setup], out: Path) -> str:
    """What differs between the runs: over machines, then pair by pair."""
    made, found = f'<h2 class="flow" id="differences">{comparison_page.kTitle}</h2>', comparisons(setups)
    several = [(one, CHANGE_FIGURES) for one in same_changes(found)]
    several += [(one, VERSION_FIGURES) for one in one_versions(setups)]
    for one, figures in several:
        drawn, left_out = _draw(figures, one, out / "figures" / one.slug)
        made += "".join(_figure(f"{done.figure.title}: {one.label}", done, f"{one.slug}-", out) for done in drawn)
        made += "".join(map(note_line, left_out))
    for one in found:
        drawn, left_out = _draw(COMPARISON_FIGURES, one, out / "figures" / one.slug)
        shown = "".join(_figure(done.figure.title, done, f"{one.slug}-", out) for done in drawn)
        made += comparison_page.section(one, shown + "".join(map(note_line, left_out)))
    return made


def _correctness(found: list[correctness.Correctness], out: Path) -> str:
    """A section for each file of icstress, or how to get one."""
    made = ""
    for one in found:
        drawn, left_out = _draw(CORRECTNESS_FIGURES, one, folder_of(one, found, out / "figures"))
        figures = {done.figure.name: _figure(done.figure.title, done, f"{one.slug}-", out) for done in drawn}
        made += correctness_page.section(one, one.slug, figures, left_out)
    return made or correctness_page.absent()


def build(paths: list[Path], verdicts: list[Path], pareto: list[Path], repeatability: list[Path],
          anatomy: list[Path], out: Path, command: str, preemption: list[Path] = (),
          timelines: list[Path] = (), breakdowns: list[Path] = (), named: Collection[str] = kBeside) -> Path:
    """Writes out/report.html and out/figures; returns the page. Raises InputError or OSError.

    `verdicts` are files of icstress, `pareto` and `repeatability` of the commands of icbench of these names, `anatomy`
    of the program of that name, `preemption` of icbench preempt, `timelines` of icbench sweep --timeline and
    `breakdowns` of icbench sweep --breakdown. Of all of these but the kinds in `named`, files that cannot be read are
    left out, and the page says so.
    """
    left_out: list[str] = []

    def of(kind: str, load_files: Callable, files: list[Path]) -> list:
        if kind in named or not files:
            return load_files(files) if files else []
        made, others = pareto_results.load_what_can_be(load_files, files)
        for why in others:
            print(f"report.py: left out: {why}", file=sys.stderr)
        left_out.extend(others)
        return made

    setups = load(paths)
    checked = of("correctness", correctness.load, verdicts)
    compared = of("pareto", pareto_results.load, pareto)
    for one in compared[:1]:
        one.left_out, left_out = left_out, []
    repeated = of("repeatability", repeatability_results.load, repeatability)
    apart = of("anatomy", anatomy_results.load, anatomy)
    stopped = of("preemption", preemption_results.load, preemption)
    drawn = of("timelines", timeline_results.load, timelines)
    accounted = of("breakdowns", load, breakdowns)
    several = len(setups) > 1
    out.mkdir(parents=True, exist_ok=True)
    body, label = kIntroduction, setups[0].label
    if several:
        label = f"{len(setups)} machines or builds"
        names = "; ".join(s.label for s in setups)
        body += (f'<p class="lead">The files come from {label} ({text(names)}). Each has a part of its own '
                 "below: nothing is merged across them. What differs stands first.</p>")
    cut = [s.label for s in setups if s.complete is False]
    if cut:
        which = f" ({text('; '.join(cut))})" if several else ""
        body += (f'<div class="banner">Incomplete results{which}: the run was cut short, and this page shows '
                 "only what was measured until then.</div>")
    body += "".join(f'<div class="banner">Left out: {text(why)}.</div>' for why in left_out)
    body += "".join(map(correctness_page.alarm, checked))
    if several:
        names = "".join(f'<a href="#{s.slug}-summary">{text(s.label)}</a>' for s in setups)
        body += f"<nav>{names}</nav>{_differences(setups, out)}"
    for setup in setups:
        prefix = f"{setup.slug}-" if several else ""
        further = {"differences": comparison_page.kTitle} if several else {}
        further |= {one.slug: pareto_choice.kTitle for one in compared[:1]}
        further |= {one.slug: "What threads add" for one in repeated[:1]}
        further |= {one.slug: preemption_page.kTitle for one in stopped[:1]}
        further |= {f"breakdown-{one.slug}": breakdown_page.kTitle for one in accounted[:1]}
        further |= {one.slug: timeline_page.kTitle for one in drawn[:1]}
        further |= {one.slug: anatomy_page.kTitle for one in apart[:1]} | {"correctness": "Correctness"}
        # What has a part of its own is not missed here.
        elsewhere = BREAKDOWN_FIGURES if accounted and "time_unexplained" not in setup.rows else []
        figures = [figure for figure in FIGURES if figure not in elsewhere]
        body += section(setup, figures, folder_of(setup, setups, out / "figures"), out, command, prefix, further)
    body += _measured(compared, PARETO_FIGURES, pareto_page, out)
    body += _measured(repeated, REPEATABILITY_FIGURES, repeatability_page, out)
    body += _breakdowns(accounted, out)
    body += _measured(stopped, PREEMPTION_FIGURES, preemption_page, out)
    body += _measured(drawn, TIMELINE_FIGURES, timeline_page, out)
    body += _measured(apart, ANATOMY_FIGURES, anatomy_page, out)
    body += _correctness(checked, out)
    page = out / "report.html"
    template = Template(kTemplate.read_text(encoding="utf-8"))
    write_whole(page, template.substitute(title=text(f"icbench: {label}"), body=body, scripts=interactive.scripts()))
    return page


def main() -> int:
    options = parser(__doc__)
    options.add_argument("--correctness", action="append", metavar="FILE", type=Path,
                         help=f"JSON of icstress (default: {kVerdicts} beside RESULTS, if it is there)")
    options.add_argument("--pareto", action="append", metavar="FILE", type=Path,
                         help=f"results of icbench pareto (default: {kPareto} beside RESULTS)")
    options.add_argument("--repeatability", action="append", metavar="FILE", type=Path,
                         help=f"results of icbench repeatability (default: {kRepeatability} beside RESULTS)")
    options.add_argument("--anatomy", action="append", metavar="FILE", type=Path,
                         help=f"results of anatomy (default: {kAnatomy} beside RESULTS)")
    options.add_argument("--preemption", action="append", metavar="FILE", type=Path,
                         help=f"results of icbench preempt (default: {kPreemption} beside RESULTS)")
    options.add_argument("--timelines", action="append", metavar="FILE", type=Path,
                         help=f"timelines of icbench sweep (default: {kTimelines} beside RESULTS)")
    options.add_argument("--breakdowns", action="append", metavar="FILE", type=Path,
                         help=f"results of icbench sweep --breakdown (default: {kBreakdowns} beside RESULTS)")
    arguments = options.parse_args()
    verdicts = arguments.correctness or _verdicts_beside(arguments.results)
    pareto = arguments.pareto or _beside(arguments.results, kPareto)
    repeatability = arguments.repeatability or _beside(arguments.results, kRepeatability)
    anatomy = arguments.anatomy or _beside(arguments.results, kAnatomy)
    preemption = arguments.preemption or _beside(arguments.results, kPreemption)
    timelines = arguments.timelines or _beside(arguments.results, kTimelines)
    breakdowns = arguments.breakdowns or _beside(arguments.results, kBreakdowns)
    out = arguments.out or arguments.results[0].parent
    interrupts.end_with_a_line()
    try:
        print(build(arguments.results, verdicts, pareto, repeatability, anatomy, out, shlex.join(sys.argv), preemption,
                    timelines, breakdowns, [kind for kind in kBeside if getattr(arguments, kind)]))
    except (InputError, OSError) as error:
        print(f"report.py: {error}", file=sys.stderr)
        return 2
    except BrokenProcessPool:
        print("report.py: a process that draws was killed, perhaps for want of memory; with `taskset -c 0` in front "
              "figures are drawn one after another", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
