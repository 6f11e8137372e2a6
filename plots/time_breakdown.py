#!/usr/bin/python3
"""Where the threads' time goes: a stacked bar per cache and thread count."""
import sys
from functools import partial

import style  # first: it checks what is installed

import pandas as pd
from matplotlib import ticker
from matplotlib.patches import Patch

from figure import Built, Figure, Omitted, Panel, Plate, main
from intervals import summarise
from over_threads import cache_rows, groups_of, kGroupKeys, panels_of
from results import Setup

# Field without time_ and _share: name, colour, hatch; in the order of the stack.
kParts = {
    "work": ("computing records", style.kGreen, None),
    "redundant": ("computing redundant records", style.kGreen, "////"),
    "query": ("in queries", style.kBlue, None),
    "insert": ("in inserts", style.kSky, None),
    "merge": ("merging", style.kPurple, None),
    "lock_wait": ("waiting for a lock, spinning", style.kVermilion, None),
    "descheduled_wanting": ("off the processor, wanting a lock", style.kOrange, None),
    "descheduled_holding": ("off the processor in an operation", style.kOrange, "////"),
    "descheduled_between": ("off the processor otherwise", style.kGrey, "////"),
    "barrier": ("idle at barriers", "#bdbdbd", None),
    "other": ("other, stamps among it", "#e8e2d4", None),
}
kPanels = 4   # workloads drawn
kCounts = 4   # thread counts drawn
kUnexplained = 0.03


def field(part: str) -> str:
    return f"time_{part}_share"


def _counts(rows: pd.DataFrame) -> list[int]:
    """At most kCounts: the ends, and what lies between as evenly as it can."""
    counts = sorted(rows["threads"].unique())
    if len(counts) <= kCounts:
        return counts
    return sorted({counts[round(i * (len(counts) - 1) / (kCounts - 1))] for i in range(kCounts)})


def _draw(axes, layout: style.Layout, part: pd.DataFrame, bars: list[tuple[str, int]]) -> None:
    place, labels, y = {}, [], 0.0
    for i, (cache, threads) in enumerate(bars):
        is_first = i == 0 or bars[i - 1][0] != cache
        y += 1.45 if is_first and i else 1.0
        place[cache, threads] = y
        labels.append(f"{style.short_name(cache)}  {threads}" if is_first else f"{threads}")
    for (cache, threads), y in place.items():
        line = part[(part["cache"] == cache) & (part["threads"] == threads)].set_index("part")["mean"]
        left = 0.0
        for name, (_, colour, hatch) in kParts.items():
            width = 100 * line.get(name, 0.0)
            if width > 0.05:
                axes.barh(y, width, 0.86, left, color="white" if hatch else colour,
                          edgecolor=colour if hatch else "none", hatch=hatch, linewidth=0.5 if hatch else 0, zorder=2)
                left += width
    axes.set_yticks(list(place.values()), labels)
    axes.set_ylim(max(place.values()) + 0.7, 0.3)
    axes.set_xlim(0, 100)
    axes.xaxis.set_major_locator(ticker.FixedLocator([0, 25, 50, 75, 100]))
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)


def _handles(names: list[str], _: style.Layout) -> list:
    return [Patch(facecolor="white" if kParts[n][2] else kParts[n][1], edgecolor=kParts[n][1], hatch=kParts[n][2],
                  linewidth=0.5, label=kParts[n][0]) for n in names]


def _unexplained(rows: pd.DataFrame, cells: pd.DataFrame) -> list[str]:
    """Trials whose parts do not add up: a cell's median does not tell of one among several."""
    left = pd.to_numeric(rows["time_unexplained"])
    off = left[left.abs() > kUnexplained]
    if off.empty:
        return []
    worst = rows.loc[off.abs().idxmax()]
    return [f"in {len(off)} of {style.plural(len(rows), 'trial')} more than {100 * kUnexplained:g} % of the time is "
            f"not explained, by the median in {(cells['median'].abs() > kUnexplained).sum()} of "
            f"{style.plural(len(cells), 'cell')}; the worst: {style.number(100 * left[worst.name], 2)} % in "
            f"{worst['cache']}, {worst['panel']}, {style.threads_text(worst['threads'])}, repetition "
            f"{worst['repetition_index']}"]


def build(setup: Setup) -> Built:
    rows = cache_rows(setup)
    present = [p for p in kParts if field(p) in rows]
    if "time_unexplained" not in rows or not present or rows["time_unexplained"].isna().all():
        raise Omitted("no row tells where the time went (icbench sweep --breakdown)")
    rows = rows[pd.to_numeric(rows["time_unexplained"], errors="coerce").notna()]
    keys = [*kGroupKeys]
    tables = []
    for name in [*present, None]:
        value = field(name) if name else "time_unexplained"
        mine = rows.assign(**{value: pd.to_numeric(rows[value], errors="coerce")})
        table = summarise(mine, keys, value).drop(columns="spread")
        # Means add up to the whole, medians do not.
        table = table.merge(mine.groupby(keys)[value].mean().rename("mean").reset_index(), on=keys)
        tables.append(table.assign(part=name or "unexplained"))
    table = pd.concat(tables, ignore_index=True)
    counts, notes, plates = _counts(rows), [], []
    for group in groups_of(setup, rows, across=False):
        mine = table[table["cache"].isin(group.caches) & table["threads"].isin(counts)]
        titles, note = panels_of(mine, kPanels)
        if note and note not in notes:
            notes.append(note)
        mine = mine[mine["panel"].isin(titles)]
        if mine.empty:
            continue
        there = set(zip(mine["cache"], mine["threads"]))
        bars = [(c, t) for c in style.cache_order(mine["cache"]) for t in counts if (c, t) in there]
        panels = [Panel(t, partial(_draw, part=mine[mine["panel"] == t], bars=bars)) for t in titles]
        names = [p for p in present if (mine.loc[mine["part"] == p, "mean"] > 0.0005).any()]
        height = 0.145 * len(bars) + 0.07 * len(group.caches) + 0.15
        plates.append(Plate(group.slug, group.title, panels, partial(_handles, names), "% of wall time × threads", "",
                            "Numbers beside the bars: threads. Means over repetitions. What is white at the end of a "
                            "bar is not explained by any part.", (2, 1), (height, 0.85 * height), (1.15, 0.95)))
    notes += _unexplained(rows, table[table["part"] == "unexplained"])
    if len(counts) < rows["threads"].nunique():
        notes.append(f"drawn at {', '.join(map(str, counts))} threads; the CSV has every thread count")
    return Built(table, plates, notes)


FIGURE = Figure(
    "time_breakdown", "Where the time goes",
    "Every bar is the whole time of all threads, wall time × threads. Green and blue are what a renderer pays for; "
    "hatched green is work that another thread had done already. Red and orange are what sharing costs: time before "
    "locks, and time off the processor while a lock is wanted or an operation is under way. Grey is idle. The parts "
    "are measured each by itself, and add up to the whole within the few percent that stay white.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE))
