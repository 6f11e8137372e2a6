"""The report's part on why the fastest cache is fast: its structure, step by step, and what bounds it."""
from __future__ import annotations

import style  # first: it checks what is installed

import numpy as np
import pandas as pd

from anatomy_results import bounds, kParts, kPoints, kReads, memory, name_of, points, roofs
from pareto_results import Measured
from tables import interval, note_line, table, text

kTitle = "Why the winner wins"
kLead = ("<p>The structures below answer with the same records. What differs is how much they have to read to find "
         "them, and in how many waits for memory. Below, the structure of the thesis becomes the packed octree in "
         "steps, with one thread and without any lock, so that nothing but the structure counts; the figure "
         "“Structure or mechanism” sets beside it what mechanisms do on top.</p>")


def _ratio(part: pd.DataFrame, above: str, below: str) -> float | None:
    ns = part.set_index("part")["ns"]
    return ns[above] / ns[below] if {above, below} <= set(ns.index) else None


def sentences(table: pd.DataFrame) -> str:
    """What the numbers say, for each order of points."""
    made = ""
    for name, part in table.groupby("points", sort=False):
        whole = _ratio(part, "wait_free", "packed_wait_free")
        if whole is None:
            continue
        said = (f"At {kPoints.get(name, name)} a packed query is {style.number(whole)} times as fast as one to Ward's "
                "structure.")
        reads = part.set_index("part")
        told = ["cache_lines", "records_read", "records_valid"]
        if set(told) <= set(reads) and reads.loc[["wait_free", "packed_wait_free"], told].notna().all(axis=None):
            ward, packed = reads.loc["wait_free"], reads.loc["packed_wait_free"]
            said += (f" It reads {style.number(packed['cache_lines'])} cache lines instead of "
                     f"{style.number(ward['cache_lines'])}, and {style.number(packed['records_read'])} whole records "
                     f"instead of {style.number(ward['records_read'])}, of which "
                     f"{style.number(packed['records_valid'])} are valid.")
        steps = [("wait_free", "replicated", "one path instead of many"),
                 ("replicated", "packed_scalar", "small copies instead of whole records"),
                 ("packed_scalar", "packed_wait_free", "vectors")]
        worth = [(what, _ratio(part, above, below)) for above, below, what in steps]
        worth = [f"{what} {style.number(ratio)}" for what, ratio in worth if ratio is not None]
        if worth:
            said += f" Step by step: {', '.join(worth)} times."
        batch = _ratio(part, "wait_free", "packed_batch")
        if batch is not None:
            said += f" Asked in batches, the packed octree is {style.number(batch)} times as fast as Ward's structure."
        left = _ratio(part, "packed_wait_free", "told")
        if left is not None:
            said += (f" A query that is told which records are valid, and only reads, weighs and adds them, is another "
                     f"{style.number(left)} times as fast: no way of finding them can gain more, as long as one query "
                     "is answered after the other and records lie where they do.")
        made += f"<p><b>{text(said)}</b></p>"
    return made


def waits(latency: pd.DataFrame) -> str:
    """How long memory takes to answer here."""
    if len(latency) < 2:
        return ""
    near, far = latency.iloc[0], latency.iloc[-1]
    size = {name: f"{style.number(line['block_bytes'] / 2**20)} MiB" for name, line in (("near", near), ("far", far))}
    return (f"<p>Why so: a load that has to wait for the one before takes "
            f"{interval(near['median'], near['low'], near['high'])} ns on this machine from a block of {size['near']} "
            f"and {interval(far['median'], far['low'], far['high'])} ns from one of {size['far']}. A packed query "
            "waits for its cell and then for the records that the cell's lanes leave: at points far from one another "
            "that is memory twice, whatever is computed in between; at points of an image most of it is at hand.</p>")


def limits(measured: Measured) -> str:
    """What is asked of a packed query, and whether the machine has room for it."""
    asked, roof = bounds(measured), roofs(measured)
    if asked.empty:
        return ""
    head = ('<th>asked for</th><th class="n">may take, ns</th><th class="n">takes, ns</th>'
            '<th class="n">room for instructions</th><th class="n">executes</th><th class="n">told, it executes</th>'
            "<th>what stands against it</th>")
    lines = []
    for _, line in asked.iterrows():
        other = name_of(line["other"])
        if line["asked"] >= 1:
            what = f"{style.number(line['asked'])} times as fast as {other}"
        else:
            what = f"at most {style.number(1 / line['asked'])} times as long as {other}"
        if line["ns"] <= line["ns_asked"]:
            why = "nothing: it is reached"
        elif line["instructions"] > line["room"]:
            why = "its instructions alone, though none waited for another or for memory"
            if line["ns_told"] > line["ns_asked"]:
                why += "; and a query that is told the valid records takes longer, too"
        elif line["ns_told"] > line["ns_asked"]:
            why = "a query that is told the valid records takes longer, too"
        elif line["ns_of_waits"] > line["ns_asked"]:
            why = ("to wait twice for memory, for its cells and then for the records that they name, takes "
                   f"{style.number(line['ns_of_waits'])} ns, unless queries overlap as in a batch")
        else:
            why = ("waiting: it executes "
                   f"{style.number(line['instructions'] / line['ns'])} of "
                   f"{style.number(roof['instructions_per_ns'])} instructions a nanosecond")
        lines.append(f"<tr><td>{text(what)}<span class=\"under\">{text(kPoints.get(line['points'], line['points']))}"
                     "</span></td>" + "".join(f'<td class="n">{style.number(line[n])}</td>' for n in
                                              ("ns_asked", "ns", "room", "instructions", "instructions_told"))
                     + f"<td>{text(why)}</td></tr>")
    counted = measured.contexts[0].get("counted") or {}
    size = f"{style.number(counted['last_level_bytes'] / 2**20)} MiB" if "last_level_bytes" in counted else "unknown size"
    note = note_line(f"Instructions and lines from memory are counted by {counted.get('tool', 'callgrind')}, lines with "
                     f"a last level of {size}. One thread of this machine executes "
                     f"{style.number(roof['instructions_per_ns'])} instructions a nanosecond at most, as measured by "
                     "additions and loads from the nearest cache, and gets "
                     f"{style.number(roof['lines_per_ns'])} scattered cache lines a nanosecond from memory")
    return f"<h3>What is asked of a query, and what there is room for</h3>{table(head, lines, 'wide')}{note}"


def numbers(everything: pd.DataFrame) -> str:
    """A line for every structure."""
    made = ""
    shown = [n for n in (*kReads, "bytes_per_record") if n in everything and everything[n].notna().any()]
    names = kReads | {"bytes_per_record": "bytes a record"}
    head = ('<th>structure</th><th class="n">ns a query</th>'
            + "".join(f'<th class="n">{text(names[n])}</th>' for n in shown))
    for name, part in everything.groupby("points", sort=False):
        lines = []
        for _, line in part.iterrows():
            word, what = kParts.get(line["part"], (line["part"], ""))
            cells = [f'<td>{text(word)}<span class="under">{text(what)}</span></td>',
                     f'<td class="n">{interval(line["ns"], line["ns_low"], line["ns_high"])}</td>']
            cells += [f'<td class="n">{style.number(line[n]) if np.isfinite(line[n]) else "–"}</td>' for n in shown]
            lines.append(f"<tr>{''.join(cells)}</tr>")
        made += f"<h3>{text(kPoints.get(name, name).capitalize())}</h3>{table(head, lines, 'wide')}"
    return made


def section(measured: Measured, anchor: str, figures: str) -> str:
    """The page. `figures`: their HTML."""
    everything = points(measured)
    made = f'<h2 id="{anchor}">{text(kTitle)}</h2>{kLead}'
    if not measured.complete:
        made += '<div class="banner">Incomplete: this part shows what was measured until the run was cut short.</div>'
    records = int(everything["records"].max())
    scenes = sorted({(c.get("configuration") or {}).get("scene", "cornell_box") for c in measured.contexts})
    made += sentences(everything) + figures + waits(memory(measured)) + limits(measured) + numbers(everything)
    made += note_line(f"Median [low, high] over {style.plural(int(everything['n'].max()), 'repetition')}; {records:,} "
                      f"records in {', '.join(scenes)}, one thread, read-only. What is read is a mean over all points; a dash: "
                      "not counted, since it is no cache")
    paths = ", ".join(path.name for path in measured.paths)
    return made + f'<p class="note">From <code>{text(paths)}</code>, measured on {text(measured.label)}.</p>'
