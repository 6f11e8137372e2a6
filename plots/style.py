"""How everything looks: one colour, marker and line per cache, and the two page formats.

Colours are Okabe and Ito's palette (safe for colour-blind readers) without its yellow, which vanishes on
white paper, plus a grey. A mechanism keeps its colour and marker on every structure; the packed structure has
hollow markers.
"""
from __future__ import annotations

import importlib.util
import logging
import math
import sys
import zlib
from dataclasses import dataclass
from pathlib import Path

import interrupts

if Path(sys.argv[0]).resolve().parent == Path(__file__).resolve().parent:  # a script of this folder has begun
    interrupts.end_with_a_line()  # before the rest, which takes a second to import

for _module in ("matplotlib", "numpy", "pandas", "PIL"):
    if importlib.util.find_spec(_module) is None:
        print(f"{sys.executable}: no module {_module}; apt-get install python3-{_module.lower()} and run the "
              "script with /usr/bin/python3", file=sys.stderr)
        sys.exit(2)

import matplotlib  # noqa: E402  (the check above has a better message)

matplotlib.use("Agg")
from matplotlib import font_manager, ticker  # noqa: E402  (the backend has to be chosen first)

logging.getLogger("matplotlib").setLevel(logging.ERROR)

kBlack, kGrey, kOrange, kSky = "#000000", "#7f7f7f", "#E69F00", "#56B4E9"
kGreen, kBlue, kVermilion, kPurple = "#009E73", "#0072B2", "#D55E00", "#CC79A7"
kSolid, kDashed, kDotted, kDashDot = "-", (0, (4, 1.5)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5))


@dataclass(frozen=True)
class CacheStyle:
    colour: str
    marker: str
    line: object
    hollow: bool = False


kCacheStyles = {
    "null": CacheStyle(kGrey, ".", kDotted),
    "path": CacheStyle(kBlack, "p", kDashed),
    "brute_force": CacheStyle(kBlack, "x", kDotted),
    "sequential": CacheStyle(kBlack, "*", kSolid),
    "frozen": CacheStyle(kGrey, "^", kDashed),
    "global_mutex": CacheStyle(kVermilion, "v", kSolid),
    "global_spin": CacheStyle(kOrange, "D", kSolid),
    "queuing_mutex": CacheStyle(kOrange, "<", kDashed),
    "shared_mutex": CacheStyle(kPurple, "P", kSolid),
    "spin_rw_mutex": CacheStyle(kPurple, "X", kDashed),
    "distributed_rw": CacheStyle(kPurple, "d", kDashDot),
    "node_lock": CacheStyle(kVermilion, ">", kDashed),
    "local_write": CacheStyle(kGreen, "^", kSolid),
    "wait_free": CacheStyle(kBlue, "o", kSolid),
    "wait_free_snapshot": CacheStyle(kSky, "s", kSolid),
    "tbb_hash_grid": CacheStyle(kGreen, "s", kDashed),
    "append_log": CacheStyle(kSky, "D", kDashed),
}
# Methods of icbench pareto; path is among the caches above, beside which sweeps draw it.
kMethodStyles = {
    "instant_gi": CacheStyle(kVermilion, "s", kSolid),
    "instant_gi_interleaved": CacheStyle(kOrange, "D", kSolid),
    "irradiance_cache": CacheStyle(kPurple, "X", kSolid),
    "irradiance_cache_bounded": CacheStyle(kPurple, "<", kDotted),
    "irradiance_cache_gradients": CacheStyle(kPurple, "P", kDashed),
    "irradiance_cache_neighbours": CacheStyle(kPurple, "d", kDashDot, hollow=True),
    "irradiance_cache_geometric": CacheStyle(kGrey, "v", kDashed),
    "irradiance_cache_occlusion": CacheStyle(kGrey, "*", kSolid),
    "irradiance_cache_overture": CacheStyle(kGrey, "*", kDashed, hollow=True),
    "instant_caching": CacheStyle(kGreen, "^", kSolid),
    "instant_caching_gradients": CacheStyle(kGreen, "^", kDashed, hollow=True),
    "temporal_instant_caching": CacheStyle(kBlue, "o", kSolid),
    "temporal_instant_caching_gradients": CacheStyle(kBlue, "o", kDashed, hollow=True),
    "hash_cells": CacheStyle(kBlack, "h", kDotted),
}
# What a cell of the contention map has room for.
kShortNames = {"global_mutex": "mutex", "global_spin": "spin", "queuing_mutex": "queue",
               "shared_mutex": "shared",
               "spin_rw_mutex": "spin rw", "distributed_rw": "dist rw", "node_lock": "node"}


def cache_style(name: str) -> CacheStyle:
    """The look of a cache or method; an unknown name gets one that depends on the name alone."""
    for styles in (kCacheStyles, kMethodStyles):
        if name in styles:
            return styles[name]
    stem = name.removeprefix("packed_")
    if stem != name and stem in kCacheStyles:
        known = kCacheStyles[stem]
        return CacheStyle(known.colour, known.marker, known.line, hollow=True)
    colours = (kBlue, kVermilion, kGreen, kPurple, kOrange, kSky, kBlack, kGrey)
    number = zlib.crc32(name.encode())
    return CacheStyle(colours[number % 8], "oDs^v<>PXdhp"[number // 8 % 12], kDashDot,
                      hollow=bool(number // 96 % 2))


def short_name(name: str) -> str:
    stem = name.removeprefix("packed_")
    return kShortNames.get(stem, stem.replace("_", " "))


def cache_order(names) -> list[str]:
    """Caches and methods in the order of their styles, unknown ones behind; a legend is the same everywhere."""
    known = [*kCacheStyles, *kMethodStyles]

    def key(name):
        stem = name.removeprefix("packed_")
        return (known.index(stem) if stem in known else len(known), name)
    return sorted(set(names), key=key)


def line_options(name: str, layout: "Layout") -> dict:
    """Options for plot and errorbar that draw a cache."""
    style = cache_style(name)
    big = 1.45 if style.marker in "*.dPX" else 1.0
    return dict(color=style.colour, marker=style.marker, linestyle=style.line, markersize=layout.marker * big,
                markerfacecolor="white" if style.hollow else style.colour, markeredgecolor=style.colour,
                markeredgewidth=0.8, linewidth=layout.line, label=name)


@dataclass(frozen=True)
class Layout:
    """A page format; lengths in inches, sizes in points."""
    name: str
    width: float
    font: float
    line: float
    marker: float
    max_height: float  # a plate with more panels goes on to another page
    small: bool


kReport = Layout("report", 8.8, 8.5, 1.3, 4.2, math.inf, small=False)
kColumn = Layout("column", 3.3, 6.2, 0.9, 2.8, 8.8, small=True)


def _font() -> str:
    present = {font.name for font in font_manager.fontManager.ttflist}
    return next((f for f in ("Liberation Sans", "Arial", "Helvetica") if f in present), "DejaVu Sans")


def settings(layout: Layout) -> dict:
    """matplotlib settings of a page format; TrueType fonts in PDF, outlines in SVG."""
    size = layout.font
    return {
        "pdf.fonttype": 42, "svg.fonttype": "path", "svg.hashsalt": "icbench", "font.family": [_font(), "DejaVu Sans"],
        "text.parse_math": False,  # names of files may hold any sign
        "font.size": size, "axes.titlesize": size, "axes.labelsize": size, "xtick.labelsize": size * 0.92,
        "ytick.labelsize": size * 0.92, "legend.fontsize": size * 0.96, "figure.titlesize": size * 1.08,
        "axes.spines.top": False, "axes.spines.right": False, "axes.linewidth": 0.6,
        "axes.edgecolor": "#444444",
        "axes.titlelocation": "left", "axes.titlepad": 4, "axes.grid": True, "axes.axisbelow": True,
        "grid.color": "#e3e3e3", "grid.linewidth": 0.5, "xtick.major.width": 0.6, "ytick.major.width": 0.6,
        "xtick.major.size": 2.5, "ytick.major.size": 2.5, "xtick.color": "#333333", "ytick.color": "#333333",
        "xtick.major.pad": 2, "ytick.major.pad": 2, "legend.frameon": False,
        "errorbar.capsize": 0, "lines.dash_capstyle": "butt", "hatch.linewidth": 0.4,
    }


def number(value: float, digits: int = 3) -> str:
    """Three significant digits without an exponent for what people meet; "-" for what is not a number."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    magnitude = math.floor(math.log10(abs(value)))
    if magnitude < -3 or magnitude > 8:
        return f"{value:.{digits - 1}e}"
    text = f"{value:,.{max(0, digits - 1 - magnitude)}f}"
    return text


def interval(median: float, low: float, high: float, unit: str = "", scale: float = 1.0) -> str:
    """"1.42 [1.38, 1.47] unit"; without brackets where there is no interval."""
    unit = unit if unit in ("", "×", "%") else " " + unit
    text = f"{number(median * scale)}{unit}"
    if low is not None and math.isfinite(low):
        text += f" [{number(low * scale)}, {number(high * scale)}]"
    return text


def duration(seconds: float) -> str:
    """A time with the unit that suits it."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if abs(seconds) >= size * 0.9995:
            return f"{number(seconds / size)} {unit}"
    return f"{number(seconds * 1e9)} ns"


def short_duration(seconds: float) -> str:
    """A time for a tick label: "500 ns", "2 µs"."""
    amount, unit = duration(seconds).split(" ")
    return f"{float(amount.replace(',', '')):g} {unit}"


def plural(count: int, word: str) -> str:
    """"1 cache", "8 caches"."""
    return f"{count:,} {word}{'' if count == 1 else 's'}"


def capital(words: str) -> str:
    """With a capital at the beginning, but for a first word that has one within it, such as relMSE."""
    first, *_ = words.split(" ")
    return words if first[1:] != first[1:].lower() else words[:1].upper() + words[1:]


def threads_text(threads: int) -> str:
    return plural(threads, "thread")


def thread_label(threads: float) -> str:
    """8192 as "8k" where it is a power of two, else in full."""
    threads = int(round(threads))
    return f"{threads // 1024}k" if threads >= 1024 and threads % 1024 == 0 else str(threads)


def log_axis(axis, values, text=None, most: int = 6) -> None:
    """A logarithmic axis with plain numbers at 1, 2, 5 (or powers of ten) and no more than `most` of them."""
    values = [v for v in values if math.isfinite(v) and v > 0]
    text = text or number_tick
    low, high = min(values), max(values)
    if high / low < 1.6:  # keep a flat line flat: never zoom into noise
        middle = math.sqrt(low * high)
        low, high = middle / 1.6, middle * 1.6
    else:
        low, high = low / 1.18, high * 1.18
    ticks: list[float] = []
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    plans = [((1, 1.5, 2, 3, 4, 5, 6, 8), 1), ((1, 2, 5), 1), ((1, 3), 1),
             ((1,), 1)] + [((1,), s) for s in range(2, 40)]
    for steps, stride in plans:
        ticks = [s * 10.0**d for d in range(first, last + 1) if d % stride == 0 for s in steps]
        ticks = [t for t in ticks if low <= t <= high]
        if len(ticks) <= most:
            break
    if not ticks:
        ticks = [math.sqrt(low * high)]
    getattr(axis.axes, f"set_{axis.axis_name}scale")("log")
    getattr(axis.axes, f"set_{axis.axis_name}lim")(low, high)
    axis.set_major_locator(ticker.FixedLocator(ticks))
    axis.set_minor_locator(ticker.NullLocator())
    axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: text(value)))


def number_tick(value: float) -> str:
    """A tick label as short as it can be."""
    if value and not 1.5e-4 < abs(value) < 1e5:
        exponent = math.floor(math.log10(abs(value)) + 1e-9)
        factor = value / 10.0**exponent
        power = "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        return power if abs(factor - 1) < 1e-6 else f"{factor:g}·{power}"
    return f"{value:g}"


def linear_axis(axis, values, most: int = 5) -> None:
    """A linear axis that starts at zero and ends a little above the largest value."""
    values = [v for v in values if math.isfinite(v)]
    top = max([v for v in values if v > 0], default=1.0)
    getattr(axis.axes, f"set_{axis.axis_name}lim")(min([0.0, *values]) * 1.06, top * 1.08)
    axis.set_major_locator(ticker.MaxNLocator(most, steps=[1, 2, 2.5, 5, 10]))
    axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
