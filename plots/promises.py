#!/usr/bin/python3
"""Which cache promises which condition, and what was found: one picture."""
import sys

import style  # first: it checks what is installed

from matplotlib.patches import Patch, Rectangle

from correctness import Correctness, kBroken, kHeld, kUnseen, kViolated, load, words
from figure import Built, Figure, Panel, Plate, main

kLooks = {  # fill, ink, what the legend says
    kHeld: (style.kBlue, "white", "promised, and no violation found"),
    kBroken: ("#b3261e", "white", "promised, and violated: a fault"),
    kViolated: ("#F4DDB4", "#4a3a10", "not promised, and seen violated"),
    kUnseen: ("#f4f5f6", "#59626d", "not promised, no violation seen")}


def build(c: Correctness) -> Built:
    caches, conditions = c.caches, c.conditions

    def draw(axes, layout):
        axes.set_xlim(-0.5, len(conditions) - 0.5)
        axes.set_ylim(len(caches) - 0.5, -0.5)
        axes.grid(False)
        for spine in axes.spines.values():
            spine.set_visible(False)
        axes.xaxis.tick_top()
        axes.tick_params(length=0)
        axes.set_xticks(range(len(conditions)), [words(name).replace(" ", "\n", 1) for name in conditions],
                        fontsize=layout.font * (0.8 if layout.small else 1), linespacing=1.0)
        axes.set_yticks(range(len(caches)), caches)
        for cell in c.cells:
            fill, ink, _ = kLooks[cell.state]
            x, y = conditions.index(cell.check), caches.index(cell.cache)
            axes.add_patch(Rectangle((x - 0.48, y - 0.44), 0.96, 0.88, facecolor=fill,
                                     edgecolor="black" if cell.state == kBroken else fill, linewidth=0.6))
            axes.text(x, y, cell.state, ha="center", va="center_baseline", color=ink,
                      fontsize=layout.font * (0.88 if layout.small else 0.96),
                      fontweight="bold" if cell.promised else "normal")

    def handles(_):
        states = {cell.state for cell in c.cells}
        return [Patch(facecolor=fill, edgecolor="#9aa0a6", linewidth=0.4, label=f"{state}: {said}")
                for state, (fill, _, said) in kLooks.items() if state in states]

    rows = len(caches)
    plate = Plate("matrix", "caches and conditions: promised and found", [Panel("", draw)], handles, "", "",
                  columns=(1, 1), heights=(0.235 * rows, 0.125 * rows), left=(1.45, 0.86))
    return Built(c.table(), [plate])


FIGURE = Figure(
    "promises", "What each cache promises, and what was found",
    "A row is a cache, a column a condition on what its queries may answer; regular to linearizable grow "
    "stricter from left to right. Blue: the cache promises it, and every history and schedule that was "
    "examined agrees. Sand: it does not promise that, and was indeed seen otherwise, which is no fault and "
    "shows that the check can fail. Grey: nothing promised, nothing seen. Red: a broken promise.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, "JSON of icstress"))
