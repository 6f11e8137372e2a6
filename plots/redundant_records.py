#!/usr/bin/python3
"""Records that were computed although another thread had, or was about to have, the same one."""
import sys

from figure import Built, Figure, Omitted, main
from over_threads import cache_rows, metric_figure
from results import redundant_share, Setup


def build(setup: Setup) -> Built:
    rows = cache_rows(setup)
    rows = rows[rows["redundant_records"].notna()].copy()
    if rows.empty:
        raise Omitted("no row has redundant_records")
    rows = rows[rows.groupby("panel")["redundant_records"].transform("max") > 0].copy()
    if rows.empty:
        raise Omitted("no redundant record was made anywhere")
    rows["redundant_share"] = redundant_share(rows)
    built = metric_figure(setup, "redundant_share", "redundant records, %", rows=rows, scale=100,
                          missing="no row has both records and redundant_records")
    counts = rows.groupby(["cache", "panel", "threads"])["redundant_records"].median()
    built.table = built.table.join(counts.rename("redundant_records_median"),
                                   on=["cache", "panel", "threads"])
    return built


FIGURE = Figure(
    "redundant_records", "Redundant records",
    "Records made beyond what a single thread needs for the same work, in per cent of that need. Two threads "
    "that miss at the same place at the same time both compute a record; caches that show new records late "
    "(local write shows them only at the end of a frame) repeat the most work. Every such record costs its "
    "full set of rays.",
    build)

if __name__ == "__main__":
    sys.exit(main(FIGURE))
