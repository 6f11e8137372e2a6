"""How far the run is, and an estimate of the time left."""
from __future__ import annotations

import sys
import time

from jobs import Job, Store

kPlainEvery = 10.0  # seconds between lines where the output is no terminal


def clock(seconds: float) -> str:
    minutes, s = divmod(int(seconds + 0.5), 60)
    hours, m = divmod(minutes, 60)
    return f"{hours}:{m:02}:{s:02}"


class Progress:
    """Counts the jobs that are expected. Time left: what the jobs left were guessed to take, times how far
    the guesses of finished jobs of the same kind (of all kinds, where there is none) were off.
    """
    def __init__(self, store: Store):
        self._store = store
        self._left: dict[str, dict[str, Job]] = {}  # scene: identity: job
        self._finished: set[str] = set()  # identities
        self._took: dict[str, list[float]] = {}  # kind: seconds, guessed seconds
        self._is_terminal = sys.stderr.isatty()
        self._last = -kPlainEvery

    def expect(self, scene: str, jobs: list[Job]) -> None:
        """The jobs of a scene, instead of those expected before. The finished ones teach how long jobs take.
        """
        left = {}
        for job in jobs:
            record = self._store.record(job)
            if record is None:
                left[self._store.identity(job)] = job
            else:
                self._learn(job, record.get("seconds"))
        self._left[scene] = left

    def _learn(self, job: Job, seconds) -> None:
        name = self._store.identity(job)
        if name in self._finished or not isinstance(seconds, (int, float)):
            return
        self._finished.add(name)
        for kind in (job.kind, ""):
            sums = self._took.setdefault(kind, [0.0, 0.0])
            sums[0] += seconds
            sums[1] += job.guess

    def advance(self, job: Job) -> None:
        record = self._store.record(job)
        if record is not None:
            self._learn(job, record.get("seconds"))
        self._left.get(job.scene, {}).pop(self._store.identity(job), None)

    def seconds_left(self) -> float:
        total = 0.0
        for jobs in self._left.values():
            for job in jobs.values():
                seconds, guessed = self._took.get(job.kind) or self._took.get("") or (1.0, 1.0)
                total += job.guess * seconds / guessed
        return total

    def show(self, job: Job) -> None:
        now = time.monotonic()
        if not self._is_terminal and now - self._last < kPlainEvery:
            return
        self._last = now
        left = sum(map(len, self._left.values()))
        done = len(self._finished)
        text = f"{done} of {done + left} jobs, about {clock(self.seconds_left())} left; " \
               f"{job.scene}: {job.label}"
        if self._is_terminal:
            print(f"\r\033[K{text[:140]}", end="", file=sys.stderr, flush=True)
        else:
            print(f"bench/tables: {text}", file=sys.stderr, flush=True)

    def wipe(self) -> None:
        if self._is_terminal:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
