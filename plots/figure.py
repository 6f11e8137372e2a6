"""What a figure is, and how it becomes files: SVG for the report, one-column PDF for a paper, data as CSV.

A figure script defines one Figure and calls `main(FIGURE)`; figures.py lists them all.
"""
from __future__ import annotations

import argparse
import io
import math
import sys
import textwrap
from bisect import bisect_left
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable

import style  # first: it checks what is installed

import matplotlib
import matplotlib.backends.backend_svg  # noqa: F401  (or every process that draws would load it anew)
import pandas as pd
from fontTools import subset
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure as Canvas
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

from files import write_whole
from results import InputError, load
from style import Layout, kColumn, kReport


# Of a font a PDF embeds outlines and widths. Tables that only lay text out, or scripts of mathematics, are left out
# before they are read: that took half the time of a PDF.
subset.Options._drop_tables_default = [*subset.Options._drop_tables_default, "GDEF", "GPOS", "GSUB", "MATH"]


# Sizes of texts, in those of the page's font.
kHeading, kSubtitle, kFootnote = 1.06, 0.86, 0.9


class Omitted(Exception):
    """This figure has nothing to show; the message says why."""


@dataclass
class Panel:
    title: str
    draw: Callable[[matplotlib.axes.Axes, Layout], None]
    subtitle: str = ""


@dataclass
class Plate:
    """Panels that share a page, their legend and their axis titles."""
    slug: str
    title: str
    panels: list[Panel]
    handles: Callable[[Layout], list]
    x_label: str
    y_label: str
    footnote: str = ""
    columns: tuple[int, int] = (3, 2)           # panels side by side: report, one-column PDF
    heights: tuple[float, float] = (1.75, 1.05)  # of a panel, inches
    left: tuple[float, float] = (0.36, 0.26)     # room for tick labels, inches


@dataclass
class Built:
    table: pd.DataFrame
    plates: list[Plate]
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Figure:
    name: str
    title: str
    how_to_read: str
    build: Callable  # of a Setup, or of a Correctness, to what is Built; raises Omitted


@dataclass
class Written:
    figure: Figure
    plates: list[tuple[str, Path]]  # title, SVG
    pdf: Path
    csv: Path
    notes: list[str]


def text_width(words: str, size: float, weight: str = "normal") -> float:
    """Inches that a line takes at `size` points."""
    font = FontProperties(size=size, weight=weight)
    return text_to_path.get_text_width_height_descent(words, font, ismath=False)[0] / 72


def wrapped(words: str, inches: float, size: float, weight: str = "normal", most: int | None = None) -> list[str]:
    """The lines of a text, none wider than it may be; of more than `most` the last that is left ends in "…"."""
    def fits(line: str) -> bool:
        return text_width(line, size, weight) <= inches

    lines, line = [], ""
    for word in words.split():
        longer = f"{line} {word}".lstrip()
        if fits(longer):
            line = longer
            continue
        lines += [line] * bool(line)
        while not fits(word) and len(word) > 1:
            cut = max(1, bisect_left(range(1, len(word)), True, key=lambda n: not fits(word[:n])))
            lines, word = [*lines, word[:cut]], word[cut:]
        line = word
    lines += [line] * bool(line)
    if most and len(lines) > most:
        last = lines[most - 1]
        while last and not fits(last + " …"):
            last = last.rpartition(" ")[0] or last[:-1]
        lines = [*lines[:most - 1], f"{last} …".lstrip()]
    return lines


def compose(plate: Plate, layout: Layout) -> list[Canvas]:
    """The pages of a plate; all measures in inches so that pages of one format look alike."""
    which = 1 if layout.small else 0
    point = layout.font / 72
    columns = max(1, min(len(plate.panels), plate.columns[which]))
    outer_left, gap_x, right = point * 1.7, point * 0.9, point * 0.9
    cell_width = (layout.width - outer_left - right) / (columns if layout.small else plate.columns[which])
    width = layout.width if layout.small else max(outer_left + right + columns * cell_width, 4.6)
    cell_width = (width - outer_left - right) / columns
    room = cell_width - plate.left[which] - point * 0.1
    titles = [wrapped(p.title, room, layout.font, most=2) or [""] for p in plate.panels]
    subtitles = [wrapped(p.subtitle, room, layout.font * kSubtitle, most=2) for p in plate.panels]
    under = point * 1.12 * max(len(s) for s in subtitles)
    title_height = point * (0.9 + 1.2 * max(len(t) for t in titles)) + under
    height = plate.heights[which]
    if layout.small and len(plate.panels) <= columns:
        height *= 1.35
    cell_height = title_height + height + point * 1.9
    handles = plate.handles(layout)
    # In sizes of the font a handle is 2.4 long and 0.5 from its label, and columns are 1.2 apart.
    entry = max([text_width(h.get_label(), layout.font * 0.96) for h in handles], default=0) + point * 4.2
    legend_columns = max(1, min(len(handles), int(width / entry))) if handles else 1
    legend_height = math.ceil(len(handles) / legend_columns) * point * 1.45 + point * 0.6 if handles else 0.0
    room = width - outer_left * 0.4 - point * 0.4
    foot = wrapped(plate.footnote, room, layout.font * kFootnote)
    heading = wrapped(plate.title, room, layout.font * kHeading, "bold")
    x_label = wrapped(plate.x_label, room, layout.font) or [""]
    below = point * (0.6 + 1.2 * len(x_label))
    top, bottom = point * (0.6 + 1.3 * len(heading)), below + legend_height + len(foot) * point * 1.25
    # Under the middle of the panels, as far as that leaves all of it in the figure.
    half = max(text_width(line, layout.font) for line in x_label) / 2 + point * 0.2
    x_middle = min(max((outer_left + plate.left[which] + width - right) / 2, half), width - half)
    fit = len(plate.panels)  # rows a page holds
    if math.isfinite(layout.max_height):
        fit = max(1, int((layout.max_height - top - bottom) / cell_height))
    pages = []
    for start in range(0, len(plate.panels), fit * columns):
        chosen = list(zip(plate.panels, titles, subtitles))[start:start + fit * columns]
        rows = math.ceil(len(chosen) / columns)
        total = top + rows * cell_height + bottom
        canvas = Canvas(figsize=(width, total))
        canvas.text(outer_left * 0.4 / width, 1 - point * 0.4 / total, "\n".join(heading), va="top", fontweight="bold",
                    fontsize=layout.font * kHeading, linespacing=1.15)
        for index, (panel, title, subtitle) in enumerate(chosen):
            row, column = divmod(index, columns)
            x = outer_left + column * cell_width + plate.left[which]
            y = total - top - row * cell_height - title_height - height
            axes = canvas.add_axes([x / width, y / total,
                                    (cell_width - plate.left[which] - gap_x) / width, height / total])
            panel.draw(axes, layout)
            axes.set_title("\n".join(title), linespacing=1.1, pad=(under + point * 0.45) * 72)
            axes.text(0, 1 + point * 0.35 / height, "\n".join(subtitle), transform=axes.transAxes,
                      va="bottom", fontsize=layout.font * kSubtitle, color="#666666", linespacing=1.15)
        middle = (total - top - rows * cell_height + total - top) / 2 / total
        canvas.text(point * 0.35 / width, middle, plate.y_label, rotation=90, va="center", ha="left")
        canvas.text(x_middle / width, (bottom - below + point * 0.4) / total, "\n".join(x_label), va="bottom",
                    ha="center", linespacing=1.2)
        if handles:
            canvas.legend(handles=handles, loc="lower center", ncol=legend_columns, columnspacing=1.2,
                          bbox_to_anchor=(0.5, len(foot) * point * 1.25 / total), handlelength=2.4,
                          handletextpad=0.5, borderaxespad=0.2, labelspacing=0.4)
        if foot:
            canvas.text(outer_left * 0.4 / width, point * 0.2 / total, "\n".join(foot), va="bottom",
                        fontsize=layout.font * kFootnote, color="#555555", linespacing=1.2)
        pages.append(canvas)
    return pages


def write(figure: Figure, setup, folder: Path) -> Written:
    """Writes NAME.pdf (a page a plate, long plates on several), NAME.csv and NAME[-PLATE].svg to `folder`. Raises
    Omitted where there is no plate.

    Each file takes the place of an earlier one when it is whole. What an earlier run left there under other such names
    is removed, and all of it when the figure is Omitted.
    """
    try:
        built = figure.build(setup)
        if not built.plates:
            raise Omitted("nothing of it can be compared")
    except Omitted:
        _remove(figure, folder, {})
        raise
    csv, pdf = folder / f"{figure.name}.csv", folder / f"{figure.name}.pdf"
    made = {csv: built.table.to_csv(index=False, float_format="%.10g"), pdf: _pdf(figure, built.plates)}
    images = []
    with matplotlib.rc_context(style.settings(kReport)):
        for plate in built.plates:
            path = folder / (f"{figure.name}.svg" if len(built.plates) == 1
                             else f"{figure.name}-{plate.slug}.svg")
            drawing = io.BytesIO()
            compose(plate, kReport)[0].savefig(drawing, format="svg", metadata={"Date": None})
            made[path] = drawing.getvalue()
            images.append((plate.title, path))
    folder.mkdir(parents=True, exist_ok=True)
    for path, content in made.items():
        write_whole(path, content)
    _remove(figure, folder, made)
    return Written(figure, images, pdf, csv, built.notes)


def _pdf(figure: Figure, plates: list[Plate]) -> bytes:
    made = io.BytesIO()
    with matplotlib.rc_context(style.settings(kColumn)):
        with PdfPages(made, metadata={"Title": figure.title, "CreationDate": None}) as pages:
            for plate in plates:
                for canvas in compose(plate, kColumn):
                    pages.savefig(canvas)
    return made.getvalue()


def _remove(figure: Figure, folder: Path, kept) -> None:
    """Files of an earlier run but for those `kept`."""
    for pattern in ("{}.csv", "{}.pdf", "{}.svg", "{}-*.svg"):
        for stale in set(folder.glob(pattern.format(figure.name))).difference(kept):
            stale.unlink()


class OneLineParser(argparse.ArgumentParser):
    """Bad usage is one line on standard error and exit status 2, like every other error."""

    def error(self, message):
        self.exit(2, f"{self.prog}: {message}; see --help\n")


kResultsFiles = ("results.json of icbench; files of one machine and build are pooled, others get a set of "
                 "figures of their own")


def parser(description: str, files: str = kResultsFiles) -> OneLineParser:
    made = OneLineParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("results", nargs="+", metavar="RESULTS", type=Path, help=files)
    made.add_argument("--out", type=Path, metavar="DIR",
                      help="where the files go (default: beside the first RESULTS)")
    return made


def folder_of(setup, setups: list, out: Path) -> Path:
    """Several setups are kept apart by a folder each."""
    return out if len(setups) == 1 else out / setup.slug


def main(figure: Figure, read: Callable = load, files: str = kResultsFiles) -> int:
    """The command line of one figure script; returns the exit status. `read` makes setups of files."""
    end = "" if figure.title.endswith("?") else "."
    description = f"{figure.title}{end}\n\n" + textwrap.fill(figure.how_to_read, 100)
    arguments = parser(description, files).parse_args()
    out = arguments.out or arguments.results[0].parent
    try:
        setups = read(arguments.results)
        for setup in setups:
            try:
                done = write(figure, setup, folder_of(setup, setups, out))
            except Omitted as why:
                print(f"{figure.name}: left out for {setup.label}: {why}")
                continue
            for path in [done.csv, done.pdf, *(image for _, image in done.plates)]:
                print(path)
            for note in done.notes:
                print(f"note: {note}")
    except (InputError, OSError) as error:
        print(f"{Path(sys.argv[0]).name}: {error}", file=sys.stderr)
        return 2
    return 0
