#!/usr/bin/python3
"""A trial as a timeline: threads as rows, what they did as colours."""
import sys
from functools import partial

import style  # first: it checks what is installed

import numpy as np
from matplotlib import colors, ticker
from matplotlib.patches import Patch

from figure import Built, Figure, Panel, Plate, main
from timeline_results import Timeline, kFiles, load

kBins = 1600   # columns of the picture; what is shorter shares one
kHeight = 24   # its lines per row
kRows = 16     # threads drawn
# Name of the events: name in the legend, colour; from the bottom of a row up.
kKinds = {
    "compute a record": ("computing a record", style.kGreen),
    "query": ("query", style.kBlue),
    "insert": ("insert", style.kSky),
    "end of frame": ("end of frame", style.kPurple),
    "wait for a lock": ("waiting for a lock", style.kVermilion),
    "off": ("off the processor", style.kOrange),
    "idle at a barrier": ("idle at a barrier", "#bdbdbd"),
    "other": ("other", "#e8e2d4"),
}
kWait = "wait for a lock"


def coverage(begin: np.ndarray, length: np.ndarray, weight: np.ndarray, end: float) -> np.ndarray:
    """Of each of kBins equal stretches of [0, end], how much lies in the spans, each counting `weight`."""
    # The integral of the spans up to each edge is piecewise linear; differences of it are what lies between.
    edges = np.linspace(0.0, end, kBins + 1)
    out = np.zeros(kBins)
    first = np.clip(np.searchsorted(edges, begin, "right") - 1, 0, kBins - 1)
    last = np.clip(np.searchsorted(edges, begin + length, "left") - 1, 0, kBins - 1)
    inside = first == last
    np.add.at(out, first[inside], (length * weight)[inside])
    for i in np.flatnonzero(~inside):
        out[first[i]] += (edges[first[i] + 1] - begin[i]) * weight[i]
        out[last[i]] += (begin[i] + length[i] - edges[last[i]]) * weight[i]
        out[first[i] + 1:last[i]] += (end / kBins) * weight[i]
    return out * kBins / end


def shares(timeline: Timeline, row: int, end: float) -> dict[str, np.ndarray]:
    """Of one row, for each kind its share of every stretch. Waits and time off the processor are taken out of the
    operation that they lie in.
    """
    mine = timeline.events[timeline.events["row"] == row]
    out = {}
    for kind in kKinds:
        part = mine[mine["name"] == kind]
        out[kind] = coverage(*(part[c].to_numpy(float) for c in ("begin", "length")), np.ones(len(part)), end)
    # Waits stand behind the operation that they are part of, and begin with it.
    taken = mine[mine["name"] == kWait].merge(mine[mine["name"].isin(["query", "insert"])], on="begin",
                                              suffixes=("", "_of"))
    for kind, part in taken.groupby("name_of"):
        out[kind] = out[kind] - coverage(part["begin"].to_numpy(float), part["length"].to_numpy(float),
                                         np.ones(len(part)), end)
    off = mine[mine["off"] > 0]
    for kind, part in off.groupby("name"):
        weight = (part["off"] / part["length"]).clip(upper=1).to_numpy(float)
        lost = coverage(part["begin"].to_numpy(float), part["length"].to_numpy(float), weight, end)
        out["off"] = out["off"] + lost
        for source in (kWait, kind):  # whoever waits is off while it waits, first of all
            here = np.minimum(lost, np.clip(out[source], 0, None)) if source in out else 0.0
            out[source] = out[source] - here
            lost = lost - here
    return {kind: np.clip(value, 0, 1) for kind, value in out.items()}


def picture(timeline: Timeline, rows: list[int], end: float) -> np.ndarray:
    """A strip for each row; within a column every kind takes lines according to its share."""
    image = np.ones((len(rows) * kHeight, kBins, 3))
    for at, row in enumerate(rows):
        top = np.zeros(kBins)
        strip = image[at * kHeight:(at + 1) * kHeight - 4]
        lines = (np.arange(len(strip))[::-1, None] + 0.5) / len(strip)
        for kind, value in shares(timeline, row, end).items():
            here = (lines >= top) & (lines < top + value)
            strip[here] = colors.to_rgb(kKinds[kind][1])
            top = top + value
    return image


def _draw(axes, layout: style.Layout, timeline: Timeline, rows: list[int]) -> None:
    end = (timeline.events["begin"] + timeline.events["length"]).max()
    scale, unit = (1e-3, "ms") if end >= 1000 else (1.0, "µs")
    axes.imshow(picture(timeline, rows, end), extent=(0, end * scale, len(rows), 0), aspect="auto",
                interpolation="nearest", zorder=2)
    axes.set_yticks([i + 0.42 for i in range(len(rows))], [timeline.names.get(row, f"row {row}") for row in rows])
    axes.grid(False)
    axes.tick_params(axis="y", length=0)
    axes.xaxis.set_major_locator(ticker.MaxNLocator(5 if layout.small else 9))
    axes.xaxis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g} {unit}"))


def build(timeline: Timeline) -> Built:
    rows = sorted(timeline.events["row"].unique())
    drawn = rows[:kRows]
    ends = [r for r in rows if timeline.names.get(r) == "ends of frames"]
    drawn += [r for r in ends if r not in drawn]
    kinds = set(timeline.events["name"]) | ({"off"} if (timeline.events["off"] > 0).any() else set())
    handles = [Patch(color=colour, label=name) for kind, (name, colour) in kKinds.items() if kind in kinds]
    totals = timeline.events.groupby(["row", "name"])[["length", "off"]].agg(["sum", "size"])
    totals.columns = ["total_us", "spans", "off_processor_us", "_"]
    table = totals.drop(columns="_").reset_index()
    title = timeline.label.removeprefix("sweep/").replace("/", ", ")
    foot = "White: spans too short and too many to be kept, and nothing at all."
    left_out = timeline.about.get("spans_left_out")
    if left_out:
        least = timeline.about.get("shorter_spans_may_be_missing_ns", 0)
        foot = (f"White: {left_out:,} spans shorter than {style.duration(least * 1e-9)} that were not kept, and "
                "nothing at all.")
    height = 0.22 * len(drawn) + 0.1
    notes = [] if len(drawn) >= len(rows) else [f"{len(drawn)} of {len(rows)} rows are drawn"]
    return Built(table, [Plate("", title, [Panel("", partial(_draw, timeline=timeline, rows=drawn))],
                               lambda layout: handles, "time since the first thread began", "", foot, (1, 1),
                               (height, 0.85 * height), (0.8, 0.65))], notes)


FIGURE = Figure(
    "timeline", "A trial as a timeline",
    "Every row is a thread, time runs to the right. Where spans are shorter than a column of the picture, the column "
    "shows their shares of it, one above the other. Red is a thread before a lock, grey one that has nothing left to "
    "do. The file itself opens in Perfetto (ui.perfetto.dev) or chrome://tracing, where single operations can be "
    "looked at.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, kFiles))
