"""Files of icbench preempt: loading, and the others' latencies with and without a thread that is held."""
from __future__ import annotations

import re
from pathlib import Path

import style  # first: it checks what is installed

import pandas as pd

import percentiles
from pareto_results import Measured, Settings, pool, read_rows
from results import InputError, workload_label

kFiles = "results of icbench preempt"
kKeys = ["workload", "cache", "threads", "hold_ms", "held"]


def _read(path: Path) -> tuple[dict, pd.DataFrame]:
    context, rows = read_rows(path, "icbench preempt", kFiles, ("workload", "cache", "threads", "hold_ms", "held",
                                                              "stalled_share"))
    for name in [c for c in rows if re.match(r"latency_|stalled_|hold|threads|others_", c)]:
        rows[name] = pd.to_numeric(rows[name], errors="coerce")
    rows = rows[rows["stalled_share"].notna() & (rows["threads"] > 1)]
    if rows.empty:
        raise InputError(f"{path}: no row tells what the others did")
    rows["held"] = rows["held"].astype(bool)
    return context, rows


def load(paths) -> list[Measured]:
    """Raises InputError for a file that is none of icbench preempt, and for files whose settings differ."""
    return pool(paths, _read, "preempt", Settings(("pause_ms", "placement"), ("workload", "hold_ms")))


def latencies(measured: Measured) -> pd.DataFrame:
    """One line per cache, held or not, operation and percentile: the median over repetitions, with its interval."""
    return percentiles.curves(percentiles.long_form(measured.rows, kKeys), kKeys)


def panel_name(workload: str, threads: int, hold_ms: float) -> str:
    return f"{workload_label(workload)}, {style.threads_text(int(threads))}, holds of {hold_ms:g} ms"
