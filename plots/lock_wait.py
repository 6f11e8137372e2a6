#!/usr/bin/python3
"""Share of the threads' time that is spent waiting for locks."""
import sys

from figure import Built, Figure, Omitted, main
from over_threads import cache_rows, metric_figure
from results import Setup, is_lock


def build(setup: Setup) -> Built:
    rows = cache_rows(setup)
    locked = rows[rows["mechanism"].map(is_lock) | (rows["lock_wait_share"] > 0)]
    if locked.empty:
        raise Omitted("no cache with a lock was measured")
    if not (locked["lock_wait_share"] > 0).any():
        raise Omitted("no time waiting for locks was recorded (contention counters off, or one thread only)")
    return metric_figure(setup, "lock_wait_share", "time waiting for locks, %", rows=locked, scale=100,
                         across=False, missing="no row has lock_wait_share")


FIGURE = Figure(
    "lock_wait", "Time spent waiting for locks",
    "Of all the time of all threads, the share in which a thread stood before a lock that another one held. "
    "At 90 % nine of ten threads do nothing. Caches without locks do not appear: they have nothing to wait "
    "for.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE))
