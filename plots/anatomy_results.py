"""Files of bench's anatomy: loading, and medians of every structure with what its queries read."""
from __future__ import annotations

from pathlib import Path

import style  # first: it checks what is installed

import pandas as pd

from intervals import summarise
from pareto_results import Measured, Settings, pool, read_rows
from results import InputError

kFiles = "results of anatomy"
# What is compared, each with one thing more than the last: part, name, what a query to it is.
kParts = {
    "wait_free": ("Ward's structure", "every record is stored once, by its size; a query looks into all cells whose "
                  "records may reach its point"),
    "replicated": ("one path", "whole copies of a record in every cell that it reaches; a query looks along one path"),
    "packed_scalar": ("packed, no vectors", "cells hold 8 bytes of a record; the whole one is read only if these "
                      "leave it in question"),
    "packed_wait_free": ("packed", "the same with vectors: packed_wait_free as it ships"),
    "packed_batch": ("packed, in batches", "16 queries under way at once: while one waits for memory, others go on"),
    "packed_frozen": ("frozen", "what is left when nothing can change any more"),
    "told": ("told", "what is left when the valid records are known beforehand: reading, weighing and adding them"),
}
# Means over all points of what one query reads and executes: field, name. The last two are bench/instructions'.
kReads = {"cache_lines": "cache lines", "lists": "lists looked into", "items": "records or copies tested",
          "records_read": "whole records read", "records_valid": "valid records", "instructions": "instructions",
          "lines_from_memory": "lines from memory"}
# What one thread gets of the machine at most, a nanosecond.
kRoofs = ("instructions_per_ns", "lines_per_ns")
# So many lines from memory, as a mean over queries to scattered points, and nearly every query waits for some of them.
kSurelyWaits = 2.0
# A block of so many times the counted last level holds little that is at hand: its latency is memory's.
kFarBlocks = 4
# How many times as fast as a query to another structure bench/targets asks a packed one to be, by order of points.
kAsked = {"wait_free": {"random": 12.0, "coherent": 12.0}, "replicated": {"random": 3.0, "coherent": 3.0},
          "packed_scalar": {"random": 3.0, "coherent": 3.3}, "packed_frozen": {"random": 1 / 1.25, "coherent": 1 / 1.4}}
kAskedOfMillion = 15.0  # of Ward's structure, with 10^6 records
kPoints = {"random": "random points", "coherent": "points of an image"}
kKeys = ["points", "part"]


def _read(path: Path) -> tuple[dict, pd.DataFrame]:
    context, rows = read_rows(path, "anatomy", kFiles, (*kKeys, "ns_per_query", "records"))
    for name in {*kReads, "ns_per_query", "records", "bytes_per_record", "repetition_index"} & set(rows):
        rows[name] = pd.to_numeric(rows[name], errors="coerce")
    for name in {"block_bytes", "ns_per_load", *kRoofs} & set(rows):
        rows[name] = pd.to_numeric(rows[name], errors="coerce")
    if not (rows["ns_per_query"] > 0).any():
        raise InputError(f"{path}: no row has a time")
    return context, rows


def load(paths) -> list[Measured]:
    """Raises InputError for a file that is none of anatomy, and for files of other scenes or numbers of records."""
    return pool(paths, _read, "anatomy", Settings(("scene", "records")))


def points(measured: Measured) -> pd.DataFrame:
    """One line per order of points and structure, in the order of kParts: the time of a query, ns, with its interval,
    and what a query reads, where that is known.
    """
    rows = measured.rows[measured.rows["ns_per_query"] > 0]
    table = summarise(rows, kKeys, "ns_per_query").drop(columns="spread").rename(
        columns={"median": "ns", "low": "ns_low", "high": "ns_high"})
    known = rows.groupby(kKeys, sort=True)
    for name in [n for n in (*kReads, "bytes_per_record", "records") if n in rows]:
        table = table.merge(known[name].max().rename(name), on=kKeys, how="left")
    order = [*kParts]
    table["place"] = [order.index(p) if p in order else len(order) for p in table["part"]]
    return table.sort_values(["points", "place", "part"], ascending=[False, True, True]).drop(
        columns="place").reset_index(drop=True)


def memory(measured: Measured) -> pd.DataFrame:
    """What a load costs that waits for the one before, ns, by the size of the block, bytes; may be empty."""
    if not {"block_bytes", "ns_per_load"} <= set(measured.rows):
        return pd.DataFrame(columns=["block_bytes", "median", "low", "high"])
    rows = measured.rows[measured.rows["ns_per_load"] > 0]
    return summarise(rows, ["block_bytes"], "ns_per_load").sort_values("block_bytes").reset_index(drop=True)


def roofs(measured: Measured) -> dict[str, float]:
    """Medians of kRoofs; empty unless all were measured."""
    if not set(kRoofs) <= set(measured.rows):
        return {}
    found = {name: measured.rows[name].median() for name in kRoofs}
    return found if all(value > 0 for value in found.values()) else {}


def bounds(measured: Measured) -> pd.DataFrame:
    """One line for every figure asked of a packed query: the time it may take and takes, ns; the instructions that have
    room in it at most, those that it executes, and those of a query that is told the valid records; and the least time,
    ns, for its instructions alone, for its lines from memory alone, and for waiting twice, for cells and then for the
    records they name, where nearly every query has to. Empty where these were not counted.
    """
    roof, table, lines, blocks = roofs(measured), points(measured), [], memory(measured)
    near = (measured.contexts[0].get("counted") or {}).get("last_level_bytes", float("inf"))
    latency = blocks.loc[blocks["block_bytes"] >= kFarBlocks * near, "median"].min()
    if not roof or not {"instructions", "lines_from_memory"} <= set(table):
        return pd.DataFrame()
    for name, part in table.groupby("points", sort=False):
        known = part.set_index("part")
        if not {"packed_wait_free", "told"} <= set(known.index) or known["instructions"].isna().any():
            continue
        packed, told = known.loc["packed_wait_free"], known.loc["told"]
        fetched = told["lines_from_memory"], packed["lines_from_memory"] - told["lines_from_memory"]
        waits = 2 * latency if min(fetched) >= kSurelyWaits else float("nan")
        for other, all_asked in kAsked.items():
            if other not in known.index or name not in all_asked:
                continue
            of_million = other == "wait_free" and packed["records"] >= 1e6
            asked = kAskedOfMillion if of_million else all_asked[name]
            ns_asked = known.loc[other, "ns"] / asked
            lines.append({"points": name, "other": other, "asked": asked, "ns_asked": ns_asked,
                          "ns": packed["ns"], "room": ns_asked * roof["instructions_per_ns"],
                          "instructions": packed["instructions"], "instructions_told": told["instructions"],
                          "ns_told": told["ns"],
                          "ns_of_instructions": packed["instructions"] / roof["instructions_per_ns"],
                          "ns_of_lines": packed["lines_from_memory"] / roof["lines_per_ns"], "ns_of_waits": waits})
    return pd.DataFrame(lines)


def name_of(part: str) -> str:
    return kParts[part][0] if part in kParts else part.replace("_", " ")


def examples(measured: Measured) -> dict[str, dict[str, dict]]:
    """What queries at one point read: by order of points and structure."""
    found: dict[str, dict[str, dict]] = {}
    if "example" not in measured.rows:
        return found
    for _, row in measured.rows.iterrows():
        if isinstance(row["example"], dict) and row["example"].get("records"):
            found.setdefault(row["points"], {}).setdefault(row["part"], row["example"])
    return found
