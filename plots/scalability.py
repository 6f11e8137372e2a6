"""The Universal Scalability Law fitted to measured throughput.

X(N) = gamma N / (1 + alpha (N - 1) + beta N (N - 1)), Gunther, *Guerrilla Capacity Planning*, 2007: gamma is the
throughput of one thread, alpha the share of work that is serial (contention), beta what threads spend on agreeing with
one another (coherency). None of them is negative.

N / X is linear in (1, alpha, beta) / gamma, so the fit is linear least squares with non-negative coefficients: it has
one answer, needs no starting point and cannot fail to converge. Residuals are relative to N / X, since the scatter of
times is. The interval of every number is that of refits to repetitions drawn anew within each thread count.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.optimize import nnls

from intervals import kConfidence, kMinRepetitions

kLeastCounts = 6     # thread counts without oversubscription that a fit needs
kRefits = 300
kTail = 50 * (1 - kConfidence)
kLess = "fewer than six thread counts without oversubscription were measured"


@dataclass
class Law:
    """gamma in operations per second; `refits` has a line of gamma, alpha, beta each, none without enough
    repetitions.
    """
    gamma: float
    alpha: float
    beta: float
    refits: np.ndarray
    counts: list[int]  # thread counts that it was fitted to

    def speed(self, threads) -> np.ndarray:
        return _speed(np.array([[self.gamma, self.alpha, self.beta]]), threads)[0]

    def band(self, threads) -> tuple[np.ndarray, np.ndarray] | None:
        """The 95 % band of `speed`; None without refits."""
        if not len(self.refits):
            return None
        low, high = np.percentile(_speed(self.refits, threads), [kTail, 100 - kTail], axis=0)
        return low, high

    def interval(self, which: int) -> tuple[float, float]:
        """Low and high of gamma (0), alpha (1) or beta (2)."""
        if not len(self.refits):
            return np.nan, np.nan
        low, high = np.percentile(self.refits[:, which], [kTail, 100 - kTail])
        return float(low), float(high)

    @property
    def peak(self) -> float:
        """The number of threads of the highest throughput; infinite if it never falls."""
        return float(_peaks(np.array([[self.gamma, self.alpha, self.beta]]))[0])

    @property
    def peak_interval(self) -> tuple[float, float]:
        if not len(self.refits):
            return np.nan, np.nan
        # Of the order statistics themselves: there is nothing between a number and infinity.
        peaks = np.sort(_peaks(self.refits))
        last = len(peaks) - 1
        return float(peaks[int(last * kTail / 100)]), float(peaks[last - int(last * kTail / 100)])


def _speed(laws: np.ndarray, threads) -> np.ndarray:
    n = np.asarray(threads, float)[None, :]
    gamma, alpha, beta = (laws[:, k][:, None] for k in range(3))
    return gamma * n / (1 + alpha * (n - 1) + beta * n * (n - 1))


def _peaks(laws: np.ndarray) -> np.ndarray:
    alpha, beta = laws[:, 1], laws[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = np.sqrt((1 - alpha) / beta)
    return np.where(alpha >= 1 - 1e-9, 1.0, np.where(beta > 0, np.maximum(1.0, inside), np.inf))


def _solve(counts: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    """gamma, alpha, beta that fit speeds > 0 at thread counts."""
    measured = counts / speeds
    terms = np.stack([np.ones_like(counts), counts - 1, counts * (counts - 1)], axis=1) / measured[:, None]
    scale = terms.max(axis=0)  # columns of one size: beta's would be thousands of times alpha's
    found = nnls(terms / scale, np.ones_like(counts))[0] / scale
    if found[0] <= 0:
        # Throughput that falls faster than any such law: the nearest one still has to be finite for one thread.
        found[0] = measured[counts.argmin()] * 1e-9
    return np.array([1.0, found[1], found[2]]) / found[0]


def fit(samples: dict[int, np.ndarray]) -> Law | None:
    """The law of positive throughputs by thread count; None with fewer than kLeastCounts counts."""
    samples = {n: np.asarray(values, float) for n, values in sorted(samples.items())}
    samples = {n: values[np.isfinite(values) & (values > 0)] for n, values in samples.items()}
    samples = {n: values for n, values in samples.items() if len(values)}
    if len(samples) < kLeastCounts:
        return None
    counts = np.array(list(samples), float)
    law = _solve(counts, np.array([np.median(v) for v in samples.values()]))
    refits = np.empty((0, 3))
    if min(map(len, samples.values())) >= kMinRepetitions:
        random = np.random.default_rng(len(counts))
        drawn = np.stack([np.median(v[random.integers(0, len(v), (kRefits, len(v)))], axis=1)
                          for v in samples.values()], axis=1)
        refits = np.stack([_solve(counts, speeds) for speeds in drawn])
    return Law(*law, refits, list(samples))


def laws(rows: pd.DataFrame, keys: list[str], value: str = "items_per_second") -> dict[tuple, Law | None]:
    """The law of each group of rows that are not oversubscribed; None for groups of too few thread counts."""
    fair = rows[~rows["oversubscribed"] & (rows[value] > 0)]
    return {key: fit({int(n): part[value].to_numpy() for n, part in group.groupby("threads")})
            for key, group in fair.groupby(keys)}
