#!/usr/bin/python3
"""Failed compare-and-swap operations per insert."""
import sys

from figure import Built, Figure, Omitted, main
from over_threads import cache_rows, metric_figure
from results import Setup


def build(setup: Setup) -> Built:
    rows = cache_rows(setup)
    rows = rows[(rows["cas_attempts"] > 0) & (rows["inserts"] > 0) & rows["cas_failures"].notna()].copy()
    if rows.empty:
        raise Omitted("no row has compare-and-swap attempts (contention counters off, or no cache that uses "
                      "them)")
    if not (rows["cas_failures"] > 0).any():
        raise Omitted(f"none of {rows['cas_attempts'].sum():,.0f} compare-and-swap attempts failed")
    rows["failures_per_insert"] = rows["cas_failures"] / rows["inserts"]
    return metric_figure(setup, "failures_per_insert", "failed CAS per insert", rows=rows, across=False,
                         missing="no row has cas_failures")


FIGURE = Figure(
    "cas_failures", "Failed compare-and-swap per insert",
    "Caches without locks install nodes and pieces of lists with compare-and-swap (CAS), which fails when another "
    "thread was faster at the very same place; the loser adopts the winner's and goes on, so the count is bounded "
    "and small. The axis counts failures per insert; other kinds of CAS, as of spin locks, are not among them. "
    "Values that grow with the threads show where they collide.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE))
