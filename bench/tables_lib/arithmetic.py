"""The arithmetic of the tables: medians with intervals, verdicts, levelling-off, times at equal error.

An interval is a dict {median, low, high, n}. With six samples or more, low and high are the order statistics
that hold the median with at least 95 % whatever the distribution; with three to five they are the smallest
and the largest, which hold it with 75 to 94 %; with fewer they are None, and no verdict follows. A figure
that was counted rather than timed is `exact`: its interval is a point.
"""
from __future__ import annotations

import math
from statistics import median

kMinSamples = 3
kConfidence = 0.95


def interval_of(samples) -> dict | None:
    """The median of the finite samples with its interval; None without any."""
    values = sorted(float(v) for v in samples if v is not None and math.isfinite(v))
    n = len(values)
    if n == 0:
        return None
    low = high = None
    if n >= kMinSamples:
        rank, tail = 0, 0.0  # values[rank] is low; tail = P(at most `rank` of n lie below the median)
        while rank < (n - 1) // 2:
            tail += math.comb(n, rank) / 2.0**n
            if 1 - 2 * (tail + math.comb(n, rank + 1) / 2.0**n) < kConfidence:
                break
            rank += 1
        low, high = values[rank], values[n - 1 - rank]
    return {"median": median(values), "low": low, "high": high, "n": n}


def exact(value: float | None) -> dict | None:
    """A counted figure: nothing about it varies."""
    return None if value is None else {"median": value, "low": value, "high": value, "n": 1}


def ratios(numerators, denominators) -> dict | None:
    """The interval of quotients paired by position (what was measured in one round); pairs with a hole or
    without a positive denominator do not count.
    """
    return interval_of(a / b for a, b in zip(numerators, denominators)
                       if a is not None and b is not None and b > 0)


def inverse(interval: dict | None) -> dict | None:
    """Of 1 / x; x is positive."""
    if interval is None or not interval["median"] > 0:
        return None
    low, high = interval["low"], interval["high"]
    return {
        "median": 1 / interval["median"], "low": 1 / high if high else None, "high": 1 / low if low else None,
        "n": interval["n"]
    }


def decide(interval: dict | None, relation: str, target: float) -> str:
    """pass or fail when the whole interval lies on one side of the target (touching it passes), else
    undecided.
    """
    if interval is None or interval["low"] is None:
        return "undecided"
    low, high = interval["low"], interval["high"]
    if relation == "at_most":
        return "pass" if high <= target else "fail" if low > target else "undecided"
    return "pass" if low >= target else "fail" if high < target else "undecided"


def worst(verdicts) -> str:
    """Of a statement about every scene: one failure refutes it, one doubt leaves it open."""
    verdicts = list(verdicts)
    if "fail" in verdicts:
        return "fail"
    return "pass" if verdicts and all(v == "pass" for v in verdicts) else "undecided"


# A figure has levelled off where it is no more than this above its value at the largest count.
kLevelShare = 0.10  # of that value, or of what the figure fell by in all if that is less
kLevelPoints = 0.10  # or percentage points, whichever is more


def level_off(curve: list[tuple[int, float]]) -> tuple[int, bool]:
    """Where an error has levelled off: the smallest count such that it and every larger one measured lies
    within max(kLevelShare of the largest count's error, kLevelPoints) above the largest count's error. Where the
    reference's own noise holds all errors up, a share of that error would let any count pass: then it is kLevelShare
    of what the error fell by from its largest.

    The flag tells whether that is below the largest count: else levelling off was not seen. Raises ValueError
    on an empty curve.
    """
    if not curve:
        raise ValueError("a curve without points does not level off")
    ordered = sorted(curve)
    last_count, last = ordered[-1]
    fell = max(error for _, error in ordered) - last
    limit = last + max(kLevelShare * min(last, fell), kLevelPoints)
    chosen = last_count
    for count, error in reversed(ordered):
        if error > limit + 1e-12:
            break
        chosen = count
    return chosen, chosen != last_count


def front(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """(seconds, error) points that no other one beats in both, by seconds; errors fall strictly."""
    best: list[tuple[float, float]] = []
    for seconds, error in sorted(points):
        if not best or error < best[-1][1]:
            best.append((seconds, error))
    return best


def seconds_at_error(points: list[tuple[float, float]], target: float) -> tuple[float, str] | None:
    """Seconds that a method needs for an error, and how sure that is: "is", "at_least" or "at_most".

    Between the points of its front, log seconds are interpolated linearly over log error. Nothing is
    extrapolated: for an error below all that was measured the slowest point is a lower bound, above all the
    fastest an upper one. None without points of positive time and error.
    """
    best = front([(s, e) for s, e in points if s > 0 and e > 0])
    if not best or not target > 0:
        return None
    if target < best[-1][1]:
        return best[-1][0], "at_least"
    if target > best[0][1]:
        return best[0][0], "at_most"
    for (slow, fine), (fast, coarse) in zip(best[1:], best):
        if fine <= target <= coarse:
            share = (math.log(target) - math.log(coarse)) / (math.log(fine) - math.log(coarse))
            return math.exp(math.log(fast) + share * (math.log(slow) - math.log(fast))), "is"
    return best[0][0], "is"  # one point, met exactly


def root_mean_square(values) -> float | None:
    values = [v for v in values if v is not None]
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else None


def mean(values) -> float | None:
    values = [v for v in values if v is not None]
    return sum(values) / len(values) if values else None
