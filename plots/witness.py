#!/usr/bin/python3
"""A violation drawn: operations that contradict each other, as bars over time."""
import sys
import textwrap

import style  # first: it checks what is installed

import pandas as pd

from correctness import Correctness, cycle_of, load
from figure import Built, Figure, Omitted, Panel, Plate, main

kInsert, kQuery, kContradiction = style.kBlue, style.kOrange, "#b3261e"


def build(c: Correctness) -> Built:
    found = cycle_of(c)
    if not found:
        raise Omitted("no witness is a cycle of operations")
    cache, _, steps = found
    # Order is all that the stamps tell, so they are spaced evenly.
    stamps = sorted({s.begin for s in steps} | {s.end for s in steps if s.end is not None})
    place = {stamp: i for i, stamp in enumerate(stamps)}
    bars = [(place[s.begin], place.get(s.end, len(stamps))) for s in steps]

    def draw(axes, layout):
        axes.grid(False)
        axes.set_xlim(-0.4, len(stamps) + 0.9)
        axes.set_ylim(len(steps) - 0.55, -0.45)
        axes.spines["left"].set_visible(False)
        axes.tick_params(axis="y", length=0)
        axes.set_yticks(range(len(steps)), [_caption(step) for step in steps], linespacing=1.05)
        crowded = layout.small and stamps[-1] > 999
        ends = (stamps[0], stamps[-1])
        axes.set_xticks(range(len(stamps)),
                        [f"{stamp:,}" if stamp in ends or not crowded else "" for stamp in stamps])
        for i, (step, (begin, end)) in enumerate(zip(steps, bars)):
            colour = kInsert if step.what.startswith("insert") else kQuery
            axes.plot([begin, end], [i, i], color=colour, linewidth=layout.line * 5, solid_capstyle="butt",
                      zorder=3)
            for x in (begin, end):
                axes.plot([x, x], [i - 0.15, i + 0.15], color=colour, linewidth=layout.line, zorder=3)
        for i, step in enumerate(steps[:-1]):
            _arrow_down(axes, layout, bars, i, step.reason)
        _arrow_back(axes, layout, bars, len(stamps) + 0.35, steps[-1].reason)

    table = pd.DataFrame([{"cache": cache, "position": i, "thread": s.thread, "call": s.begin,
                           "return": s.end, "operation": s.what, "reason": s.reason}
                          for i, s in enumerate(steps, 1)])
    plate = Plate("cycle", f"{cache}: {len(steps)} operations that no order explains", [Panel("", draw)],
                  lambda layout: [], "stamps, in their order", "",
                  "Arrows: has to come before, and why. Stamps are spaced evenly: only their order counts.",
                  (1, 1), (0.6 * len(steps), 0.36 * len(steps)), (1.6, 1.0))
    return Built(table, [plate])


def _caption(step) -> str:
    return f"thread {step.thread}:\n" + step.what.replace(", ", "\n", 1)


def _arrow_down(axes, layout, bars: list[tuple], i: int, reason: str) -> None:
    """From operation i to the next."""
    (begin, end), (next_begin, next_end) = bars[i], bars[i + 1]
    # An operation that overlaps the next points at the middle of what both share.
    x = (max(begin, next_begin) + min(end, next_end)) / 2 if next_begin <= end else next_begin
    start = end if next_begin > end else x
    axes.annotate("", xy=(x, i + 0.82), xytext=(start, i + 0.18), zorder=4,
                  arrowprops={"arrowstyle": "-|>", "color": "#333333", "linewidth": layout.line * 0.8,
                              "shrinkA": 0, "shrinkB": 0, "mutation_scale": layout.font})
    shown = "\n".join(textwrap.wrap(reason, 19)) if layout.small else reason
    axes.text((start + x) / 2 + 0.22, i + 0.5, shown, va="center", fontsize=layout.font * 0.92, zorder=5,
              color="#333333", linespacing=1.05)


def _arrow_back(axes, layout, bars: list[tuple], rail: float, reason: str) -> None:
    """From the last operation back to the first, round the right side."""
    last = len(bars) - 1
    axes.plot([bars[last][1] + 0.06, rail, rail], [last, last, 0], color=kContradiction, zorder=2,
              linewidth=layout.line * 0.8, solid_joinstyle="round")
    axes.annotate("", xy=(bars[0][1] + 0.06, 0), xytext=(rail, 0), zorder=2,
                  arrowprops={"arrowstyle": "-|>", "color": kContradiction, "linewidth": layout.line * 0.8,
                              "shrinkA": 0, "shrinkB": 0, "mutation_scale": layout.font})
    axes.text(rail + 0.12, last / 2, reason, rotation=270, va="center", ha="left", color=kContradiction,
              fontsize=layout.font * 0.92)


FIGURE = Figure(
    "witness", "One violation, drawn",
    "Each bar is one operation, from its call to its return; time runs to the right. An arrow says which "
    "operation must have come first, and why. Followed round, the arrows lead back to where they began: no "
    "order of these operations explains what the threads were told. That is what a violation of "
    "linearizability is, and the checker finds it by looking for such circles.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, "JSON of icstress"))
