"""The report's explorer: every median of one setup, for a script to draw as the reader picks."""
from __future__ import annotations

import math

import pandas as pd
from matplotlib.markers import MarkerStyle

import interactive
import style
from intervals import summarise
from over_threads import cache_rows, groups_of, oversubscribed_from, select_workloads
from results import redundant_share, Setup, workload_label, workload_order
from tables import text

# Field, words, unit, factor, logarithmic, more is better.
kMetrics = (
    ("items_per_second", "throughput", "M operations/s", 1e-6, True, True),
    ("seconds", "wall time of a trial", "ms", 1e3, True, False),
    ("seconds_indirect", "seconds for the indirect light", "s", 1.0, True, False),
    ("latency_query_p50_ns", "query, median", "ns", 1.0, True, False),
    ("latency_query_p99_ns", "query, p99", "ns", 1.0, True, False),
    ("latency_query_p999_ns", "query, p99.9", "ns", 1.0, True, False),
    ("latency_insert_p50_ns", "insert, median", "ns", 1.0, True, False),
    ("latency_insert_p999_ns", "insert, p99.9", "ns", 1.0, True, False),
    ("utilisation", "processor time used", "%", 100.0, False, True),
    ("lock_wait_share", "time waiting for locks", "%", 100.0, False, False),
    ("redundant_share", "redundant records", "%", 100.0, False, False),
    ("cas_failures", "failed compare-and-swaps", "", 1.0, False, False),
    ("bytes_per_record", "bytes a record", "B", 1.0, False, False),
    ("relmse", "relMSE", "", 1.0, True, False))
kAxes = (("cost", "record_cost_us", "cost of a record, µs"), ("rays", "rays_per_record", "rays a record"))
kDashes = {style.kSolid: [], style.kDashed: [6, 3], style.kDotted: [2, 2], style.kDashDot: [7, 2, 2, 2]}
kMarkerPixels = 9.0
kShownAtFirst = 2  # workloads
kKeys = ["panel", "cache", "threads"]


def marker_path(marker: str) -> str:
    """A marker of the figures as an SVG path around the origin, kMarkerPixels wide."""
    made = MarkerStyle(marker)
    path = made.get_path().transformed(made.get_transform())
    size = kMarkerPixels * (0.55 if marker == "." else 0.9)
    words = []
    for points, code in path.iter_segments(curves=True, simplify=False):
        points = " ".join(f"{v * size * (-1 if i % 2 else 1):.2f}" for i, v in enumerate(points))
        words.append({1: "M" + points, 2: "L" + points, 3: "Q" + points, 4: "C" + points, 79: "Z"}[int(code)])
    return "".join(words)


def _look(cache: str) -> dict:
    look = style.cache_style(cache)
    return {"colour": look.colour, "path": marker_path(look.marker), "dash": kDashes[look.line],
            "hollow": look.hollow or look.marker == "x"}


def swatch(cache: str) -> str:
    """A cache's line and marker beside its name."""
    look = _look(cache)
    dash = f' stroke-dasharray="{" ".join(map(str, look["dash"]))}"' if look["dash"] else ""
    fill = "#fff" if look["hollow"] else look["colour"]
    return (f'<svg class="swatch" width="30" height="14" viewBox="-15 -7 30 14" aria-hidden="true">'
            f'<path d="M-15 0H15" stroke="{look["colour"]}" stroke-width="1.6"{dash}/>'
            f'<path d="{look["path"]}" stroke="{look["colour"]}" fill="{fill}"/></svg>')


def _rows(setup: Setup) -> pd.DataFrame:
    rows = cache_rows(setup)
    return rows.assign(redundant_share=redundant_share(rows))


def _families(rows: pd.DataFrame, panels: list[str]) -> dict[str, list]:
    """By axis, for workloads that differ in its parameter alone: [name, [[value, number of the panel], ...]]."""
    about = rows.drop_duplicates("panel").set_index("panel")
    several = rows["placement"].nunique() > 1
    made: dict[str, list] = {}
    for axis, field, _ in kAxes:
        groups: dict[str, list] = {}
        for number, panel in enumerate(panels):
            line = about.loc[panel]
            if not math.isfinite(line[field]):
                continue
            name = ":".join(p for p in line["workload"].split(":") if p.split("=")[0] != axis)
            name = workload_label(name) + (f", {line['placement']}" if several else "")
            groups.setdefault(name, []).append([interactive.short(line[field]), number])
        groups = {name: sorted(pairs) for name, pairs in groups.items() if len({p[0] for p in pairs}) > 1}
        if groups:
            made[axis] = [[name, pairs] for name, pairs in groups.items()]
    return made


def collected(setup: Setup) -> dict:
    """Everything that the script draws: cells of a panel, a cache and a thread count, and their medians."""
    rows = _rows(setup)
    order = workload_order(rows)
    pairs = rows[["workload", "panel"]].drop_duplicates()
    panels = [p for w in order for p in sorted(pairs.loc[pairs["workload"] == w, "panel"])]
    caches = style.cache_order(rows["cache"])
    about = rows.drop_duplicates("cache").set_index("cache")
    cells = rows[kKeys].drop_duplicates().sort_values(kKeys, ignore_index=True)
    metrics = []
    for field, words, unit, factor, logarithmic, better in kMetrics:
        if field not in rows or not (rows[field].notna() & (rows[field] != 0)).any():
            continue
        found = cells[kKeys].merge(summarise(rows, kKeys, field), on=kKeys, how="left")
        columns = [[interactive.short(v * factor) for v in found[name]] for name in ("median", "low", "high")]
        metrics.append({"words": words, "unit": unit, "log": logarithmic, "more": better, "m": columns[0],
                        "l": columns[1], "h": columns[2], "n": [int(n) for n in found["n"].fillna(0)]})
    number = {name: {value: i for i, value in enumerate(values)} for name, values in
              (("panel", panels), ("cache", caches))}
    groups = groups_of(setup, rows)
    chosen = select_workloads(rows, kShownAtFirst)[0]
    over = oversubscribed_from(setup, rows)
    return {"panels": panels, "caches": [{"name": c, "structure": about.at[c, "structure"]} | _look(c) for c in caches],
            "threads": sorted(int(t) for t in rows["threads"].unique()), "over": interactive.short(over),
            "families": _families(rows, panels), "axes": {axis: words for axis, _, words in kAxes},
            "first": {"caches": [number["cache"][c] for c in (groups[0].caches if groups else caches)],
                      "panels": [i for i, p in enumerate(panels) if p in set(pairs.loc[pairs["workload"].isin(chosen),
                                                                                       "panel"])][:kShownAtFirst]},
            "cells": {"p": [number["panel"][p] for p in cells["panel"]],
                      "c": [number["cache"][c] for c in cells["cache"]],
                      "t": [int(t) for t in cells["threads"]]},
            "metrics": metrics}


def _boxes(name: str, values: list[str], labels: list[str]) -> str:
    return "".join(f'<label><input type="checkbox" name="{name}" value="{text(v)}">{label}</label>'
                   for v, label in zip(values, labels))


def section(setup: Setup, prefix: str) -> str:
    """The explorer, hidden until a script shows it, and a word for pages without scripts."""
    found = interactive.library()
    if not found:
        return (f'<p class="note">Charts to pick and hover in are left out: {interactive.kPackage} is not installed '
                "where this page was made. The figures below show the same medians.</p>")
    made = collected(setup)
    if not made["metrics"]:
        return '<p class="note">The rows hold nothing that can be drawn.</p>'
    identity = f"{prefix}explorer-data"
    axes = [("threads", "threads")] + [(a, made["axes"][a]) for a in made["families"]]
    select = "".join(f'<option value="{i}">{text(m["words"])}{text(", " + m["unit"] if m["unit"] else "")}</option>'
                     for i, m in enumerate(made["metrics"]))
    across = "".join(f'<option value="{a}">{text(words)}</option>' for a, words in axes)
    groups = ""
    for structure in dict.fromkeys(c["structure"] for c in made["caches"]):
        mine = [i for i, c in enumerate(made["caches"]) if c["structure"] == structure]
        labels = [swatch(made["caches"][i]["name"]) + text(made["caches"][i]["name"]) for i in mine]
        groups += (f'<fieldset><legend>{text(structure.replace("_", " "))} '
                   f'<button type="button" data-all="caches">all</button>'
                   f'<button type="button" data-none="caches">none</button></legend>'
                   f'{_boxes("caches", list(map(str, mine)), labels)}</fieldset>')
    threads = _boxes("threads", list(map(str, made["threads"])), [style.thread_label(t) for t in made["threads"]])
    return (f'<div class="explorer" data-from="{identity}" hidden><form>'
            f'<div class="pick"><label>Show <select name="metric">{select}</select></label>'
            f'<label>against <select name="axis">{across}</select></label></div>'
            f'<fieldset class="workloads"><legend>Workloads</legend><div class="boxes"></div></fieldset>'
            f'<fieldset class="threads"><legend>Threads</legend>{threads}</fieldset>'
            f'<div class="caches">{groups}</div></form>'
            '<p class="note">Move over a chart for its values; or focus it by Tab, and go by the arrow keys: left and '
            'right along the axis, Escape to leave. Bars are 95 % bootstrap intervals of the median.</p>'
            '<div class="charts"></div><p class="said" role="status" aria-live="polite"></p>'
            '<details class="numbers"><summary>These numbers as a table</summary><div></div></details></div>'
            f'{interactive.data(identity, made)}'
            '<noscript><p class="note">With scripts allowed there would be charts here to pick from and hover in; the '
            "figures below show the same medians.</p></noscript>")
