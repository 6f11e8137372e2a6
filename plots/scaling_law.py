#!/usr/bin/python3
"""The Universal Scalability Law fitted to throughput, with its bands, and what it says past the last thread count."""
import sys

import style  # first: it checks what is installed

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from figure import Built, Figure, Omitted, Panel, Plate, main
from intervals import kFewRepetitions, kMinRepetitions, summarise
from over_threads import cache_rows, groups_of, kGroupKeys, panels_of, thread_axis
from results import Setup
from scalability import Law, kLess, laws

kFurther = 4  # the law is drawn up to this many times the largest thread count it was fitted to
kScale = 1e-6


def fitted(setup: Setup) -> tuple[pd.DataFrame, dict[tuple, Law]]:
    """A line of parameters for every cache and workload with a law, and the laws by (cache, panel).

    Raises Omitted where no cache was measured with enough thread counts.
    """
    rows = cache_rows(setup)
    found = {key: law for key, law in laws(rows, ["cache", "panel"]).items() if law}
    if not found:
        most = rows.loc[~rows["oversubscribed"]].groupby(["cache", "panel"])["threads"].nunique()
        raise Omitted(f"{kLess} ({int(most.max()) if len(most) else 0} were): three parameters would fit anything")
    about = rows.drop_duplicates(["cache", "panel"]).set_index(["cache", "panel"])
    lines = []
    for (cache, panel), law in found.items():
        line = {"structure": about.at[(cache, panel), "structure"], "cache": cache, "panel": panel,
                "workload": about.at[(cache, panel), "workload"], "counts": len(law.counts),
                "largest_count": law.counts[-1]}
        for number, name in enumerate(("gamma", "alpha", "beta")):
            low, high = law.interval(number)
            line |= {name: getattr(law, name), f"{name}_low": low, f"{name}_high": high}
        low, high = law.peak_interval
        lines.append(line | {"peak_threads": law.peak, "peak_low": low, "peak_high": high})
    return pd.DataFrame(lines), found


def build(setup: Setup) -> Built:
    table, found = fitted(setup)
    rows = cache_rows(setup)
    rows = rows[~rows["oversubscribed"] & (rows["items_per_second"] > 0)]
    points = summarise(rows, kGroupKeys, "items_per_second")
    points = points[[key in found for key in zip(points["cache"], points["panel"])]]
    plates, notes = [], []
    for group in groups_of(setup, rows):
        mine = points[points["cache"].isin(group.caches)]
        if mine.empty:
            continue
        titles, note = panels_of(mine)
        notes += [note] if note and note not in notes else []
        caches = style.cache_order(mine.loc[mine["panel"].isin(titles), "cache"])
        panels = [Panel(title, lambda axes, layout, part=mine[mine["panel"] == title]:
                        _draw(axes, layout, part, found)) for title in titles]
        plates.append(Plate(group.slug, group.title, panels, lambda layout, caches=caches: _handles(caches, layout),
                            "threads", "million operations per second",
                            f"Solid: fitted. Dashed on grey: extrapolation, to {kFurther} times the most threads "
                            f"measured. Bands: 95 %, from refits to repetitions drawn anew.{_few(mine['n'])}"))
    without = len(rows.drop_duplicates(["cache", "panel"])) - len(found)
    if without:
        notes.append(f"{style.plural(without, 'pair')} of cache and workload without a law: {kLess}")
    if not all(len(law.refits) for law in found.values()):
        notes.append("laws of fewer than three repetitions at some thread count have no band")
    return Built(table, plates, notes)


def _few(n: pd.Series) -> str:
    """What bands of few repetitions are worth. `n`: repetitions of each point."""
    few = n[(n >= kMinRepetitions) & (n < kFewRepetitions)]
    return f" Points of fewer than {kFewRepetitions} repetitions make them too narrow." if len(few) else ""


def _handles(caches: list[str], layout: style.Layout) -> list:
    made = [Line2D([], [], **style.line_options(cache, layout) | {"linestyle": "-"}) for cache in caches]
    return made + [Line2D([], [], color="#555555", linewidth=layout.line, linestyle=style.kDashed,
                          label="extrapolation, not measured"), Patch(color="#f3f3f3", label="past what was measured")]


def _draw(axes, layout: style.Layout, part: pd.DataFrame, found: dict[tuple, Law]) -> None:
    values, last = [], int(part["threads"].max())
    drawn = []
    for (cache, panel), line in part.groupby(["cache", "panel"]):
        law = found[cache, panel]
        inside = np.geomspace(law.counts[0], law.counts[-1], 40)
        beyond = np.geomspace(law.counts[-1], law.counts[-1] * kFurther, 30)
        drawn.append((cache, line, law, inside, beyond))
        values += [*law.speed(inside) * kScale, *law.speed(beyond) * kScale, *line["median"] * kScale]
    thread_axis(axes, sorted({*part["threads"], last * 2, last * kFurther}), layout)
    style.log_axis(axes.yaxis, values, most=5 if layout.small else 6)
    axes.axvspan(last, last * kFurther * 1.25, color="#f3f3f3", zorder=0.3, linewidth=0)
    for cache, line, law, inside, beyond in drawn:
        options = style.line_options(cache, layout)
        axes.plot(line["threads"], line["median"] * kScale, zorder=3, **options | {"linestyle": "none"})
        for threads, dashes in ((inside, "-"), (beyond, style.kDashed)):
            axes.plot(threads, law.speed(threads) * kScale, color=options["color"], linestyle=dashes,
                      linewidth=layout.line * 0.8, zorder=2.4)
            band = law.band(threads)
            if band:
                axes.fill_between(threads, band[0] * kScale, band[1] * kScale, color=options["color"], alpha=0.13,
                                  linewidth=0, zorder=1.5)


FIGURE = Figure(
    "scaling_law", "Scaling law",
    "Points are measured medians without oversubscription; the line is the Universal Scalability Law fitted to them, "
    "X(N) = γN / (1 + α(N - 1) + βN(N - 1)): γ is the throughput of one thread, α the share of the work that is "
    "serial, β what the threads spend on agreeing with one another, which in the end makes more threads slower. On "
    "the grey ground the line is dashed: there it is an extrapolation, and nothing was measured. The law knows nothing "
    "of sockets and hardware threads; a machine that has a boundary beyond the last point will do worse.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE))
