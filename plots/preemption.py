#!/usr/bin/python3
"""Latencies of all others while a thread is held in the middle of an operation, and while none is."""
import re
import sys
from functools import partial

import style  # first: it checks what is installed

import percentiles
from figure import Built, Figure, Omitted, Panel, Plate, main
from intervals import interval_note
from over_threads import cache_handles
from pareto_results import Measured
from preemption_results import kFiles, latencies, load, panel_name


def _stalled(measured: Measured, caches: list[str], keys: dict) -> str:
    """What the holds cost, by the others' own time; other programs can put them off for as long."""
    rows = measured.rows
    for name, value in keys.items():
        rows = rows[rows[name] == value]
    shares = 100 * rows.groupby(["held", "cache"])["stalled_share"].median()
    said = [f"{style.short_name(cache)} {style.number(shares[True, cache], 2)} %"
            + (f" ({style.number(shares[False, cache], 2)} %)" if (False, cache) in shares else "")
            for cache in caches if (True, cache) in shares]
    return ("Of the others' time with a thread held (in brackets: with none held), in operations that took over half a "
            "hold: " + ", ".join(said) + ".")


def build(measured: Measured) -> Built:
    table = latencies(measured)
    if table.empty:
        raise Omitted("no row has latencies")
    plates = []
    for (workload, threads, hold), part in table.groupby(["workload", "threads", "hold_ms"]):
        panels = []
        for operation in ("query", "insert"):
            mine = part[part["operation"] == operation]
            for held, name in ((False, "no thread held"), (True, "a thread held")):
                one = mine[mine["held"] == held]
                if not one.empty:
                    panels.append(Panel(f"{operation}: {name}", partial(percentiles.draw, part=one, neighbours=mine)))
        caches = style.cache_order(part["cache"])
        foot = _stalled(measured, caches, {"workload": workload, "threads": threads, "hold_ms": hold})
        foot += f" Markers: the longest operation. {interval_note(part['n'])}"
        plates.append(Plate(f"{re.sub(r'[^A-Za-z0-9.]+', '-', workload)}-{int(threads)}-{hold:g}ms",
                            panel_name(workload, threads, hold), panels,
                            lambda layout, caches=caches: cache_handles(caches, layout), "percentile of operations",
                            "latency", foot, (4, 2), (1.75, 1.1), (0.46, 0.33)))
    return Built(table, plates)


FIGURE = Figure(
    "preemption", "When a thread is held in mid-operation",
    "One thread is stopped in the middle of an operation, as the system's scheduler may do at any time, for as long as "
    "the title says; the curves are the latencies of all other threads. If a line that was low ends at the length of "
    "the hold, the others had to wait for a thread that was not running: it held a lock. Such waits are few, because "
    "who waits asks nothing, but they are where the time goes; the note under the figure weighs them by it. Where "
    "nobody can be waited for, both curves are the same.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE, load, kFiles))
