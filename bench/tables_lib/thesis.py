"""What the thesis reports: Dubla, Interactive Global Illumination on the CPU, Warwick 2012, chapter 6.

Seconds are of hardware of 2011: only ratios carry over. Its scenes are not ours either.
"""
from __future__ import annotations

from dataclasses import dataclass

kSource = "Dubla, Interactive Global Illumination on the CPU, PhD thesis, University of Warwick, 2012"

# Scenes in the thesis's order: name in icbench, title.
kAnimations = {
    "cornell_box": "Cornell Box", "wobble": "Wobble", "desk": "Desk", "bunnies_1": "Bunnies 1",
    "bunnies_2": "Bunnies 2", "bunnies_4": "Bunnies 4", "bunnies_9": "Bunnies 9", "conference": "Conference",
    "sibenik": "Sibenik"
}
kStills = {"cornell_specular": "Cornell specular", "cornell_indirect": "Cornell indirect", "office": "Office"}
kTitles = kAnimations | kStills


@dataclass(frozen=True)
class IndirectTime:
    """A row of Table 6.4: seconds a frame for diffuse interreflections, averaged over 100 frames."""
    igi: float
    ic: float
    tic: float
    igi_over_tic: float
    ic_over_tic: float


kIndirectTimes = {
    "cornell_box": IndirectTime(0.43, 0.09, 0.03, 14.33,
                                3.00), "wobble": IndirectTime(0.37, 0.09, 0.03, 12.33, 3.00),
    "desk": IndirectTime(0.56, 0.09, 0.03, 18.67,
                         3.00), "bunnies_1": IndirectTime(0.56, 0.12, 0.03, 18.67, 4.00),
    "bunnies_2": IndirectTime(0.55, 0.13, 0.04, 13.75,
                              3.25), "bunnies_4": IndirectTime(0.55, 0.13, 0.05, 11.00, 2.60),
    "bunnies_9": IndirectTime(0.57, 0.12, 0.09, 6.33,
                              1.33), "conference": IndirectTime(1.23, 0.17, 0.05, 24.60, 3.40),
    "sibenik": IndirectTime(0.97, 0.42, 0.05, 19.40, 8.40)
}


@dataclass(frozen=True)
class Perceived:
    """A row of Table 6.5: percent of pixels told apart by HDR-VDP, TIC against path tracing and against IGI.
    """
    p75_path: float
    p75_igi: float
    p95_path: float
    p95_igi: float


kPerceived = {
    "cornell_box": Perceived(0.57, 0.00, 0.31,
                             0.00), "wobble": Perceived(0.13, 0.00, 0.05,
                                                        0.00), "desk": Perceived(2.11, 0.02, 1.01, 0.01),
    "bunnies_9": Perceived(0.21, 0.00, 0.06, 0.00), "cornell_specular": Perceived(0.91, 0.00, 0.43, 0.00),
    "cornell_indirect": Perceived(1.86, 0.33, 0.88, 0.19), "conference": Perceived(1.61, 0.16, 0.91, 0.06),
    "sibenik": Perceived(0.18, 0.06, 0.03, 0.00), "office": Perceived(0.45, 0.23, 0.00, 0.00)
}

# Table 6.3 over all scenes: whole frames per second, TIC over IGI.
kWholeFrameRange = (2.42, 6.82)
# The largest entries of Table 6.5 at P > 75 %.
kMostAgainstIgi = 0.33
kMostAgainstPath = 2.11
# Samples a pixel of its path-traced references.
kReferenceSamples = 2500

# What this project asks of itself, beyond reaching the thesis's ratios.
kFarFaster = 25.0  # IGI / TIC, indirect
kFarFasterOn = ("cornell_box", "desk", "conference", "sibenik")
kSlowestAgainstStatic = 1.05  # TIC / IC on Bunnies 9, indirect
kMostRecordBytes = 64.0  # beyond the cache's own
kMostBits = 1.0  # of visibility, a record and VPL
