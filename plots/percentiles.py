"""Latencies as percentile curves: from fields to lines over a log-probability axis."""
from __future__ import annotations

import math
import re

import style  # first: it checks what is installed

import numpy as np
import pandas as pd
from matplotlib import ticker

from intervals import summarise

kField = r"latency_(query|insert)_(p\d+|max)_ns"
kTicks = {0.5: "50", 0.9: "90", 0.99: "99", 0.999: "99.9", 0.9999: "99.99", 0.99999: "99.999"}


def share_of(percentile: str) -> float:
    """0.999 of "p999"; 1 of "max"."""
    return 1.0 if percentile == "max" else float("0." + percentile[1:])


def place(share) -> float:
    """Where a percentile stands: each nine as far from the last as the last from the one before."""
    return -np.log10(1.0 - np.asarray(share, float))


def long_form(rows: pd.DataFrame, keys: list[str]) -> pd.DataFrame:
    """One line per repetition, operation and percentile; nanoseconds. `samples`: how many operations were timed."""
    columns = [c for c in rows if re.fullmatch(kField, c)]
    if not columns:
        return rows.iloc[:0].assign(latency_ns=[], operation=[], percentile=[], samples=[])
    tall = rows[[*keys, *columns]].melt(keys, var_name="field", value_name="latency_ns", ignore_index=False)
    tall = tall[tall["latency_ns"] > 0].copy()
    tall[["operation", "percentile"]] = tall.pop("field").str.extract(kField)
    tall["samples"] = math.nan
    for operation in ("query", "insert"):
        name = f"latency_{operation}_samples"
        if name in rows:
            mine = tall["operation"] == operation
            tall.loc[mine, "samples"] = rows[name].reindex(tall.index[mine]).to_numpy()
    return tall.reset_index(drop=True)


def curves(tall: pd.DataFrame, keys: list[str]) -> pd.DataFrame:
    """Medians of long_form with intervals, and where each stands; the maximum stands where one sample in all would."""
    table = summarise(tall, [*keys, "operation", "percentile"], "latency_ns")
    if table.empty:
        return table.assign(x=[])
    samples = tall.groupby([*keys, "operation"], dropna=False)["samples"].median().rename("samples").reset_index()
    table = table.merge(samples, on=[*keys, "operation"], how="left")
    share = table["percentile"].map(share_of)
    last = np.where(share < 1, 0.0, np.log10(table["samples"].fillna(1e4).clip(lower=2)))
    table["x"] = np.where(share < 1, place(share.clip(upper=1 - 1e-12)), last)
    # A percentile beyond what the samples tell would stand right of the maximum.
    most = table.assign(x=last).groupby([*keys, "operation"], dropna=False)["x"].transform("max")
    table["x"] = np.minimum(table["x"], np.where(most > 0, most, np.inf))
    return table.sort_values([*keys, "operation", "x", "median"]).reset_index(drop=True)


def draw(axes, layout: style.Layout, part: pd.DataFrame, neighbours: pd.DataFrame) -> None:
    """A line for each cache; the scales are shared with `neighbours`."""
    for cache in style.cache_order(part["cache"]):
        line = part[part["cache"] == cache].sort_values(["x", "median"])
        options = style.line_options(cache, layout)
        axes.plot(line["x"], line["median"], zorder=3, **(options | {"marker": ""}))
        ends = line[line["percentile"] == "max"]  # the marker: the longest of all
        axes.plot(ends["x"], ends["median"], zorder=3.1, **(options | {"linestyle": "none"}))
        known = line[line["low"].notna()]
        axes.vlines(known["x"], known["low"], known["high"], color=options["color"], linewidth=layout.line * 0.6,
                    zorder=2.5)
    right = neighbours["x"].max() * 1.04
    axes.set_xlim(0, right)
    inches = axes.get_position().width * axes.figure.get_figwidth()
    shown: dict[float, str] = {}
    end = -1.0
    for share, label in kTicks.items():  # those that have room
        x = place(share).item()
        half = (len(label) + 1.5) * 0.25 * layout.font / 72 / inches * right
        if x <= right and x - half >= end:
            shown[x] = label
            end = x + half
    axes.xaxis.set_major_locator(ticker.FixedLocator(list(shown)))
    axes.xaxis.set_minor_locator(ticker.NullLocator())
    axes.xaxis.set_major_formatter(ticker.FixedFormatter(list(shown.values())))
    values = neighbours[["median", "low", "high"]].to_numpy().ravel()
    style.log_axis(axes.yaxis, values, lambda value: style.short_duration(value * 1e-9), 5 if layout.small else 6)
