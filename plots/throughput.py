#!/usr/bin/python3
"""Throughput against threads, per cache and workload."""
import sys

from figure import Figure, main
from over_threads import metric_figure

FIGURE = Figure(
    "throughput", "Throughput against threads",
    "Each panel is one workload, each line one cache; higher is better. The axis counts cache operations "
    "finished per second by all threads together (queries alone where inserts come from misses, so that "
    "repeated work does not count), on a logarithmic scale: a cache that scales perfectly rises as a straight "
    "line, and one that serialises its threads stays flat or falls. "
    "Grey vertical lines mark where threads begin to share something (a core, a socket); in the shaded part "
    "there are more threads than processing units, so no line can be expected to rise there, only to hold. "
    "Points are medians, bars are 95 % bootstrap intervals of the median.",
    lambda setup: metric_figure(setup, "items_per_second", "million operations per second", logarithmic=True,
                                scale=1e-6, missing="no row has items_per_second"))

if __name__ == "__main__":
    sys.exit(main(FIGURE))
