#!/usr/bin/python3
"""How much of the processing units the threads really used."""
import sys

from figure import Figure, main
from over_threads import metric_figure

FIGURE = Figure(
    "utilisation", "Use of the processing units",
    "The processor time that the threads received as a share of what their processing units could give: 100 "
    "% means that no unit was ever idle. A low value means that threads were asleep, most often before a "
    "lock; a spin lock shows 100 % although it only turns in circles, so read this together with the waiting "
    "time and the throughput.",
    lambda setup: metric_figure(setup, "utilisation", "use of processing units, %", scale=100,
                                missing="no row has utilisation"))

if __name__ == "__main__":
    sys.exit(main(FIGURE))
