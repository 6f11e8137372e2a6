"""Medians over repetitions with bootstrap intervals, and ratios paired by repetition.

Intervals are 95 % percentile bootstrap intervals of the median over repetitions, expanded for few of them as those of
src/harness/statistics.h are. Below kMinRepetitions none is given. Below kFewRepetitions not even the range of the
samples, which such an interval then is, covers 95 %.
"""
from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import pandas as pd
from scipy.special import ndtr, stdtrit

kMinRepetitions = 3
kFewRepetitions = 6  # the range of fewer samples covers the median in less than 95 % of cases
kResamples = 2000
kConfidence = 0.95
kNoisy = 0.10  # IQR over median above which a group of repetitions is reported as noisy


@lru_cache(maxsize=256)
def _resampled_middles(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Ranks of the two middle values in kResamples resamples of n sorted values.

    They depend on n alone, so one draw serves all groups of n samples; the result equals resampling the
    values.
    """
    random = np.random.default_rng(n)
    low, high = np.empty(kResamples, int), np.empty(kResamples, int)
    step = max(1, 2_000_000 // n)
    for start in range(0, kResamples, step):
        size = min(step, kResamples - start)
        ranks = np.sort(random.integers(0, n, (size, n)), axis=1)
        low[start:start + size] = ranks[:, (n - 1) // 2]
        high[start:start + size] = ranks[:, n // 2]
    return low, high


def tail(n: int) -> float:
    """Per cent of the resampled medians of n > 1 samples to leave out at each end, 2.5 in the limit.

    Leaving out 2.5 makes intervals of few samples too narrow, by sqrt((n - 1) / n) and by the normal's quantile in
    place of Student's t (Hesterberg 2014, What Teachers Should Know about the Bootstrap, arXiv:1411.5279).
    """
    return 100 * float(ndtr(-math.sqrt(n / (n - 1)) * stdtrit(n - 1, (1 + kConfidence) / 2)))


def median_intervals(samples: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Median, low and high of each row of `samples`; low and high are NaN below kMinRepetitions columns."""
    groups, n = samples.shape
    ordered = np.sort(samples, axis=1)
    median = np.median(ordered, axis=1)
    low, high = np.full(groups, np.nan), np.full(groups, np.nan)
    if n >= kMinRepetitions:
        first, second = _resampled_middles(n)
        out = tail(n)
        for start in range(0, groups, 500):
            part = ordered[start:start + 500]
            low[start:start + 500], high[start:start + 500] = np.percentile(
                (part[:, first] + part[:, second]) / 2, [out, 100 - out], axis=1)
    return median, low, high


def few_note(n: pd.Series) -> str:
    """What intervals of three to five repetitions are worth, as a sentence; "" where there is none. `n`: repetitions
    that went into each interval.
    """
    few = sorted(n[(n >= kMinRepetitions) & (n < kFewRepetitions)].unique())
    if not few:
        return ""
    counts = f"{few[0]:g}" if len(few) == 1 else f"{few[0]:g} to {few[-1]:g}"
    held = dict.fromkeys(f"{100 * (1 - 2.0 ** (1 - count)):.0f}" for count in (few[0], few[-1]))
    return f"Of {counts} repetitions an interval is their range, which holds the median in {' to '.join(held)} % of cases."


def interval_note(n: pd.Series, things: str = "points") -> str:
    """What a figure has to say about its bars. `n`: repetitions of each of its `things`."""
    none = int((n < kMinRepetitions).sum())
    if none == len(n):
        return f"Fewer than {kMinRepetitions} repetitions: no intervals can be given."
    said = ["Bars: 95 % bootstrap intervals of the median.", few_note(n)]
    if none:
        said.append(f"{none} of {len(n)} {things} have fewer than {kMinRepetitions} repetitions and so no interval.")
    return " ".join(filter(None, said))


def summarise(rows: pd.DataFrame, keys: list[str], value: str) -> pd.DataFrame:
    """One line per group: keys, n, median, low, high, spread (IQR over median). NaN values do not count."""
    rows = rows[rows[value].notna()]
    columns = [*keys, "n", "median", "low", "high", "spread"]
    if rows.empty:
        return pd.DataFrame(columns=columns)
    ordered = rows.sort_values(keys, kind="stable")
    heads = ordered[keys].ne(ordered[keys].shift()).any(axis=1).to_numpy()
    starts = np.flatnonzero(heads)
    sizes = np.diff(np.append(starts, len(ordered)))
    values = ordered[value].to_numpy(float)
    out = ordered.iloc[starts][keys].reset_index(drop=True)
    result = {c: np.full(len(starts), np.nan) for c in columns[len(keys) + 1:]}
    for n in np.unique(sizes):
        which = np.flatnonzero(sizes == n)
        samples = values[starts[which][:, None] + np.arange(n)[None, :]]
        median, low, high = median_intervals(samples)
        quarter, three = np.percentile(samples, [25, 75], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = np.where(median != 0, (three - quarter) / np.abs(median), np.nan)
        for column, data in zip(result, (median, low, high, spread)):
            result[column][which] = data
    return out.assign(n=sizes, **result)


kPairKeys = ["run", "repetition_index", "take"]


def paired(rows: pd.DataFrame, base: pd.DataFrame, on: list[str], value: str) -> pd.DataFrame:
    """`rows` with a column `ratio`: value over the base's value in the same run and repetition.

    `on` are the columns that must agree besides run and repetition; pairs without a positive base are
    dropped.
    """
    keys = [*on, *kPairKeys]
    base = base[base[value] > 0].drop_duplicates(keys)[[*keys, value]].rename(columns={value: "base_value"})
    merged = rows[rows[value].notna()].merge(base, on=keys, how="inner")
    return merged.assign(ratio=merged[value] / merged["base_value"])


def interval_of(samples) -> tuple[float, float, float, int]:
    """(median, low, high, n) of one list of samples; NaN where it says nothing."""
    clean = np.asarray([s for s in samples if s is not None and math.isfinite(s)], float)
    if not clean.size:
        return math.nan, math.nan, math.nan, 0
    median, low, high = median_intervals(clean[None, :])
    return float(median[0]), float(low[0]), float(high[0]), clean.size
