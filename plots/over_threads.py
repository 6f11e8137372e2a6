"""Lines over thread counts, one per cache: the form that most figures share.

Panels are workloads, plates are structures, because only caches of one structure say what a mechanism costs.
Caches that are alone on their structure meet in one plate with the best cache of each other structure.
"""
from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib import ticker
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

import style
from figure import Built, Omitted, Panel, Plate
from intervals import interval_note, summarise
from results import Setup, workload_order

kPanels = 12  # workloads drawn at most; the CSV has all
kShade = "#f1ece2"
kBoundaryLines = {"core": (0, (5, 2)), "smt": (0, (1.2, 1.6)), "numa_node": (0, (5, 1.5, 1, 1.5)),
                  "package": "-"}
kBoundaryNames = {"core": "core", "smt": "SMT", "numa_node": "NUMA node", "package": "socket"}
kUncached = ("path", "hash_cells")  # integrators without a cache: the rivals in speed against error
kGroupKeys = ["structure", "mechanism", "cache", "workload", "workload_kind", "scene", "panel", "threads"]


def cache_rows(setup: Setup) -> pd.DataFrame:
    """The rows that use a cache."""
    return setup.rows[~setup.rows["integrator"].isin(kUncached)]


def select_workloads(rows: pd.DataFrame, limit: int = kPanels) -> tuple[list[str], str]:
    """At most `limit` workloads that stand for all, in reading order, and a line on what was left out ("" if
    nothing).

    Variants of one thing are thinned first: three record costs, one setting per scene; then kinds take turns.
    """
    order = workload_order(rows)
    kinds = rows.drop_duplicates("workload").set_index("workload")["workload_kind"]
    scenes = rows.drop_duplicates("workload").set_index("workload")["scene"]
    counts = rows.groupby("workload")["threads"].agg(["nunique", "size"])
    queues: dict[str, list[str]] = {}
    for kind in dict.fromkeys(kinds[w] for w in order):
        mine = [w for w in order if kinds[w] == kind]
        if kind == "miss_driven" and len(mine) > 3:
            mine = [mine[i] for i in sorted({0, len(mine) // 2, len(mine) - 1})]
        elif kind == "ray_traced":
            best: dict[str, str] = {}
            for w in mine:
                scene = scenes[w] or w.split(":")[0]
                if scene not in best or tuple(counts.loc[w]) > tuple(counts.loc[best[scene]]):
                    best[scene] = w
            mine = list(best.values())
        queues[kind] = mine
    chosen: set[str] = set()
    while len(chosen) < limit and any(queues.values()):
        for queue in queues.values():
            if queue and len(chosen) < limit:
                chosen.add(queue.pop(0))
    note = ""
    if len(chosen) < len(order):
        note = (f"{len(chosen)} of {len(order)} workloads are shown, chosen over all kinds; "
                "the CSV holds every one")
    return [w for w in order if w in chosen], note


def panels_of(rows: pd.DataFrame, limit: int = kPanels) -> tuple[list[str], str]:
    """Panel titles (workload, and placement where there are several) in reading order, and the note."""
    workloads, note = select_workloads(rows, limit)
    pairs = rows[["workload", "panel"]].drop_duplicates()
    return [p for w in workloads for p in sorted(pairs.loc[pairs["workload"] == w, "panel"])], note


def thread_marks(setup: Setup, rows: pd.DataFrame) -> tuple[int, int | None]:
    """The measured thread counts nearest to all cores and to four threads a core (None: nothing beyond)."""
    counts = sorted(rows["threads"].unique())
    cores = setup.cores or counts[-1]
    full = max((t for t in counts if t <= cores), default=counts[0])
    beyond = [t for t in counts if t > full]
    return full, min(beyond, key=lambda t: abs(math.log2(t / (4 * cores)))) if beyond else None


@dataclass
class Group:
    slug: str
    title: str
    caches: list[str]
    mechanisms: bool  # whether the caches share one structure


def groups_of(setup: Setup, rows: pd.DataFrame, value: str = "items_per_second",
              across: bool = True) -> list[Group]:
    """Caches that may share a panel: those of one structure; then the fastest of each structure."""
    table = rows[["structure", "cache"]].drop_duplicates()
    made, best = [], []
    for structure, part in table.groupby("structure"):
        caches = style.cache_order(part["cache"])
        if len(caches) > 1 or table["structure"].nunique() == 1:
            # Part of a file's name, whatever signs others' structures have in theirs.
            made.append(Group(re.sub(r"[^\w.-]+", "-", structure), f"structure: {structure.replace('_', ' ')}",
                              caches, True))
        best.append(_fastest(setup, rows, caches, value))
    made.sort(key=lambda g: -len(g.caches))
    # A cache that keeps nothing has no structure to compare.
    if across and len(set(table["structure"]) - {"none"}) > 1:
        made.append(Group("across-structures", "across structures: the fastest cache of each",
                          style.cache_order(best), False))
    return made


def _fastest(setup: Setup, rows: pd.DataFrame, caches: list[str], value: str) -> str:
    """The cache with the largest geometric mean of `value` at all cores."""
    if len(caches) == 1:
        return caches[0]
    mine = rows[rows["cache"].isin(caches)]
    at = mine[(mine["threads"] == thread_marks(setup, mine)[0]) & (mine[value] > 0)]
    if at.empty:
        return caches[0]
    medians = at.groupby(["panel", "cache"])[value].median().unstack("cache")
    return np.log(medians).mean().idxmax()


def draw_topology(axes, setup: Setup, rows: pd.DataFrame) -> None:
    """Lines at topology boundaries; a shade where there are more threads than processing units."""
    low, high = axes.get_xlim()
    for threads, kind in _marked(setup, rows):
        place = math.sqrt(threads * (threads - 1))  # between the last count before it and the first beyond
        axes.axvline(place, color="#8a8a8a", linewidth=0.8, zorder=0.6,
                     linestyle=kBoundaryLines.get(kind, "-"))
    edge = oversubscribed_from(setup, rows)
    if edge is not None and edge < high:
        axes.axvspan(max(edge, low), high, color=kShade, zorder=0.4, linewidth=0)


def _marked(setup: Setup, rows: pd.DataFrame) -> list[tuple[int, str]]:
    """Boundaries that get a line: within the measured counts, except oversubscription, which is shaded."""
    least, most = rows["threads"].min(), rows["threads"].max()
    return [(threads, kind) for threads, kind in setup.boundaries
            if least < threads <= most and kind != "oversubscribed"]


def oversubscribed_from(setup: Setup, rows: pd.DataFrame) -> float | None:
    """Where the shade begins: at the harness's own boundary, else between counts that fit and that do not."""
    over = rows.loc[rows["oversubscribed"], "threads"]
    if over.empty:
        return None
    stated = [threads for threads, kind in setup.boundaries if kind == "oversubscribed" and threads > 1]
    if stated:
        return math.sqrt(stated[0] * (stated[0] - 1))
    fits = rows.loc[~rows["oversubscribed"] & (rows["threads"] < over.min()), "threads"]
    return math.sqrt(over.min() * fits.max()) if not fits.empty else over.min() / 1.4


def topology_handles(setup: Setup, rows: pd.DataFrame) -> list:
    """Legend entries of what draw_topology drew."""
    kinds = dict.fromkeys(kind for _, kind in _marked(setup, rows))
    handles = [Line2D([], [], color="#8a8a8a", linewidth=0.8, linestyle=kBoundaryLines.get(kind, "-"),
                      label=f"{kBoundaryNames.get(kind, kind)} boundary") for kind in kinds]
    if rows["oversubscribed"].any():
        handles.append(Patch(color=kShade, label="oversubscribed"))
    return handles


def cache_handles(caches: list[str], layout: style.Layout) -> list:
    return [Line2D([], [], **style.line_options(cache, layout)) for cache in caches]


def thread_axis(axes, counts, layout: style.Layout) -> None:
    """log2 axis, labelled at measured counts, thinned until the labels have room."""
    counts = sorted(counts)
    axes.set_xscale("log", base=2)
    axes.set_xlim(counts[0] / 1.25, counts[-1] * 1.25)
    inches = axes.get_position().width * axes.figure.get_figwidth()
    decades = math.log2(counts[-1] / counts[0] * 1.5625)
    room = layout.font / 72 * 2.0
    shown = [counts[-1]]
    for count in reversed(counts[:-1]):
        if math.log2(shown[-1] / count) / decades * inches >= room:
            shown.append(count)
    axes.xaxis.set_major_locator(ticker.FixedLocator(shown))
    axes.xaxis.set_minor_locator(ticker.NullLocator())
    axes.xaxis.set_major_formatter(ticker.FuncFormatter(lambda value, _: style.thread_label(value)))


def draw_lines(axes, table: pd.DataFrame, layout: style.Layout, scale: float = 1.0) -> None:
    """One line per cache over threads, with its intervals."""
    for cache in style.cache_order(table["cache"]):
        line = table[table["cache"] == cache].sort_values("threads")
        options = style.line_options(cache, layout)
        axes.plot(line["threads"], line["median"] * scale, zorder=3, **options)
        known = line[line["low"].notna()]
        axes.vlines(known["threads"], known["low"] * scale, known["high"] * scale, color=options["color"],
                    linewidth=layout.line * 0.8, zorder=2.5)


def draw_over_threads(axes, layout: style.Layout, part: pd.DataFrame, setup: Setup, marked: pd.DataFrame, counts,
                      spanned: pd.DataFrame, scale: float, logarithmic: bool) -> None:
    """A whole panel. The thread axis has these `counts`, the other spans the medians and intervals of `spanned`, and
    `marked` are the rows whose thread counts the topology is marked for.
    """
    thread_axis(axes, counts, layout)
    values = (spanned[["median", "low", "high"]] * scale).to_numpy().ravel()
    _value_axis(axes.yaxis, values, logarithmic, 5 if layout.small else 6)
    draw_topology(axes, setup, marked)
    draw_lines(axes, part, layout, scale)


def _draw_dots(axes, table: pd.DataFrame, layout: style.Layout, scale: float, logarithmic: bool) -> None:
    """The form for a single thread count: one row per cache, sorted."""
    table = table.sort_values("median").reset_index(drop=True)
    for row, line in table.iterrows():
        options = style.line_options(line["cache"], layout) | {"linestyle": "none"}
        axes.plot([line["median"] * scale], [row], zorder=3, **options)
        if math.isfinite(line["low"]):
            axes.hlines(row, line["low"] * scale, line["high"] * scale, color=options["color"],
                        linewidth=layout.line, zorder=2.5)
    axes.set_yticks(range(len(table)), table["cache"])
    axes.set_ylim(-0.6, len(table) - 0.4)
    values = (table[["median", "low", "high"]] * scale).to_numpy().ravel()
    _value_axis(axes.xaxis, values, logarithmic, 4 if layout.small else 6)


def _value_axis(axis, values, logarithmic: bool, most: int) -> None:
    if logarithmic and any(v > 0 for v in values if math.isfinite(v)):
        style.log_axis(axis, values, most=most)
    else:
        style.linear_axis(axis, values, most)


def line_plates(setup: Setup, table: pd.DataFrame, groups: list[Group], y_label: str, *, logarithmic: bool,
                scale: float = 1.0, extra=None, subtitle=None,
                footnote: str = "") -> tuple[list[Plate], list[str]]:
    """The plates of a metric over threads. `table` is a summary by kGroupKeys with `oversubscribed`.

    `extra(axes)` may add to a panel, `subtitle(panel, part)` says more under its title. Zeros cannot stand on
    a logarithmic axis: they are left out of the drawing there and counted in the notes.
    """
    notes, plates = [], []
    if logarithmic and (table["median"] <= 0).any():
        notes.append(f"{(table['median'] <= 0).sum()} medians are zero and do not show on the logarithmic "
                     "axis")
        table = table[table["median"] > 0]
    if table.empty:
        raise Omitted("every value is zero")
    single = table["threads"].nunique() == 1
    for group in groups:
        mine = table[table["cache"].isin(group.caches)]
        if mine.empty:
            continue
        titles, note = panels_of(mine)
        if note and note not in notes:
            notes.append(note)
        drawn = mine[mine["panel"].isin(titles)]
        counts = sorted(drawn["threads"].unique())

        def panel(title, drawn=drawn, counts=counts):
            part = drawn[drawn["panel"] == title]

            def draw(axes, layout):
                if single:
                    return _draw_dots(axes, part, layout, scale, logarithmic)
                draw_over_threads(axes, layout, part, setup, drawn, counts, part, scale, logarithmic)
                if extra:
                    extra(axes)
            return Panel(title, draw, subtitle(title, part) if subtitle else "")
        caches = style.cache_order(drawn["cache"])
        text = " ".join(t for t in (interval_note(drawn["n"]), footnote) if t)
        if single:
            title = f"{group.title}, {style.threads_text(counts[0])}"
            height = 0.16 * len(caches) + 0.2
            plates.append(Plate(group.slug, title, [panel(t) for t in titles], lambda layout: [], y_label, "",
                                text,
                                (3, 1), (height * 1.25, height), (1.35, 1.1)))
        else:
            plates.append(Plate(group.slug, group.title, [panel(t) for t in titles],
                                lambda layout, caches=caches, drawn=drawn:
                                cache_handles(caches, layout) + topology_handles(setup, drawn),
                                "threads", y_label, text))
    return plates, notes


def with_oversubscription(table: pd.DataFrame, rows: pd.DataFrame) -> pd.DataFrame:
    """Adds to a summary whether its thread count exceeds the processing units."""
    over = rows.groupby("threads")["oversubscribed"].any()
    return table.assign(oversubscribed=table["threads"].map(over).fillna(False).astype(bool))


def metric_figure(setup: Setup, value: str, y_label: str, *, rows: pd.DataFrame | None = None, missing: str,
                  logarithmic: bool = False, scale: float = 1.0, across: bool = True) -> Built:
    """The whole of a figure that shows one field over threads."""
    rows = cache_rows(setup) if rows is None else rows
    rows = rows[rows[value].notna()] if value in rows else rows.iloc[:0]
    if rows.empty:
        raise Omitted(missing)
    table = with_oversubscription(summarise(rows, kGroupKeys, value), rows)
    plates, notes = line_plates(setup, table, groups_of(setup, rows, across=across), y_label,
                                logarithmic=logarithmic, scale=scale)
    return Built(table, plates, notes)
