#!/usr/bin/env python3
"""The files that icbench sweep writes: determinism, resuming, and interruptions at any moment."""

import itertools
import json
import os
import random
import signal
import subprocess
import time
import unittest

from cli_support import ICBENCH, PATIENCE, PRECIOUS, Case, key_of, small_sweep


class SweepFiles(Case):
    """What a sweep writes, and how it goes on."""

    def test_seed_fixes_the_results_of_one_thread(self):
        def results(seed, name):
            workloads = "miss_driven:cost=0:operations=1000,cornell_box:rays=4:size=16x16"
            self.succeed(*small_sweep(caches="sequential,wait_free", workloads=workloads, repetitions=2,
                                      **{"reference-spp": 2}, seed=seed, out=name))
            fields = ["queries", "hits", "inserts", "records", "rays", "rmse", "relmse", "mean_ratio"]
            rows = self.load(name)["benchmarks"]
            return {key_of(row): [row.get(field) for field in fields] for row in rows}

        first, second, other = results(1, "a.json"), results(1, "b.json"), results(2, "c.json")
        self.assertEqual(first, second)
        self.assertEqual(first.keys(), other.keys())
        self.assertNotEqual(first, other)
        picture = "sweep/cornell_box:rays=4:size=16x16/wait_free/threads:1"
        self.assertNotEqual(first[picture, 0], other[picture, 0])
        self.assertNotEqual(first[picture, 0], first[picture, 1], "repetitions are to be independent")

    def test_standard_output_is_one_valid_document(self):
        results = json.loads(self.succeed(*small_sweep(out="/dev/stdout")))
        self.assertEqual(len(results["benchmarks"]), 1)
        self.assertIs(results["context"]["complete"], True)

    def test_dry_run_writes_nothing(self):
        (self.folder / "old.json").write_text(PRECIOUS)
        for name in "old.json", "new.json":
            estimate = self.succeed(*small_sweep(out=name), "--dry-run")
            self.assertRegex(estimate, r"insert_only:records=50 +1 trials +\d+:\d\d\n")
            self.assertRegex(estimate, r"in all +1 trials +\d+:\d\d")
        self.assertEqual(self.contents(), {"old.json": PRECIOUS.encode()})

    def test_without_resume_a_sweep_starts_anew(self):
        self.succeed(*small_sweep(out="r.json"))
        self.succeed(*small_sweep(out="r.json", seed=2))
        results = self.load("r.json")
        self.assertEqual(results["context"]["seed"], 2)
        self.assertEqual(len(results["benchmarks"]), 1)

    def test_resuming_a_complete_sweep_measures_nothing(self):
        self.succeed(*small_sweep(out="r.json"))
        rows = self.load("r.json")["benchmarks"]
        self.succeed(*small_sweep(out="r.json"), "--resume")
        self.assertEqual(self.load("r.json")["benchmarks"], rows)

    def test_resume_refuses_another_configuration(self):
        self.succeed(*small_sweep(out="r.json"))
        for option, value in (("seed", 5), ("repetitions", 3), ("threads", 2), ("caches", "null"),
                              ("workloads", "insert_only:records=51"), ("placement", "none")):
            self.refuse(*small_sweep(out="r.json", **{option: value}), "--resume",
                        says=["cannot resume", f"{option} is"])

    def test_resume_refuses_damaged_and_foreign_files(self):
        self.succeed(*small_sweep(out="r.json"))
        whole = (self.folder / "r.json").read_text()
        for text in (whole[:len(whole) // 2], "no JSON", "{}", "[]", '{"context": {}, "benchmarks": []}',
                     '{"context": {}, "benchmarks": 3}'):
            (self.folder / "r.json").write_text(text)
            self.refuse(*small_sweep(out="r.json"), "--resume", says=["r.json"])


class Plan:
    """A sweep that is to be interrupted."""

    def __init__(self, caches, threads, workloads, repetitions):
        points = itertools.product(workloads, caches, threads)
        names = [f"sweep/{workload}/{cache}/threads:{count}" for workload, cache, count in points]
        self.keys = set(itertools.product(names, range(repetitions)))
        self.arguments = ["sweep", "--caches", ",".join(caches), "--threads", ",".join(map(str, threads)),
                          "--workloads", ",".join(workloads), "--repetitions", str(repetitions),
                          "--out", "r.json", "--resume"]


QUICK = Plan(["global_mutex", "local_write", "wait_free"], [1, 2],
             ["insert_only:records=200", "miss_driven:cost=0:operations=200"], 12)
# A trial takes a fifth of a second, so that a signal arrives long before the end.
SLOW = Plan(["wait_free"], [1], ["miss_driven:cost=2000:operations=200"], 6)


class Interrupted(Case):
    """Sweeps that are stopped at any moment lose nothing."""

    def start(self, plan):
        # An interactive shell's background jobs ignore SIGINT, and their children inherit that.
        process = subprocess.Popen([ICBENCH, *plan.arguments], cwd=self.folder, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL,
                                   preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def journalled(self):
        """Complete rows of the journal, as text."""
        journal = self.folder / "r.json.partial"
        # Without the header and a row that was not finished.
        return journal.read_text().split("\n")[1:-1] if journal.exists() else []

    def safe_rows(self):
        """What the file and its journal hold, by name and repetition."""
        rows = [json.loads(row) for row in self.journalled()]
        if (self.folder / "r.json").exists():
            results = self.load("r.json")
            self.assertIs(results["context"]["complete"], False)
            rows += results["benchmarks"]
        safe = {}
        for row in rows:
            self.assertEqual(safe.setdefault(key_of(row), row), row)
        return safe

    def wait_for_rows(self, process, wanted):
        """Returns when the process has added so many rows, or has ended."""
        wanted += len(self.journalled())
        deadline = time.monotonic() + PATIENCE
        while process.poll() is None and time.monotonic() < deadline and len(self.journalled()) < wanted:
            time.sleep(0.002)

    def assert_completes(self, plan, safe):
        """One more run completes the sweep; the rows that were safe are as they were."""
        self.succeed(*plan.arguments)
        results = self.load("r.json")
        self.assertIs(results["context"]["complete"], True)
        self.assertEqual(os.listdir(self.folder), ["r.json"])
        rows = {key_of(row): row for row in results["benchmarks"]}
        self.assertEqual(len(rows), len(results["benchmarks"]))
        self.assertEqual(rows.keys(), plan.keys)
        for key, row in safe.items():
            self.assertEqual(rows[key], row)
        return results["context"]

    def test_killed_at_random_moments(self):
        seed = random.randrange(1 << 32)
        chance = random.Random(seed)
        safe = {}
        kills = 0
        with self.subTest(seed=seed):
            for by_time in (True, False, True, False, True, False):
                process = self.start(QUICK)
                if by_time:  # most likely while it is starting
                    time.sleep(chance.uniform(0, 0.5))
                else:
                    self.wait_for_rows(process, chance.randint(1, 40))
                process.kill()
                if process.wait(PATIENCE) == 0:
                    break
                kills += 1
                now = self.safe_rows()
                for key, row in safe.items():
                    self.assertEqual(now[key], row)
                safe = now
            self.assertGreater(kills, 0)
            context = self.assert_completes(QUICK, safe)
            self.assertLessEqual(len(context.get("resumed", [])), kills, "a resumption is recorded once")

    def test_interrupt_ends_promptly_and_resume_completes(self):
        process = self.start(SLOW)
        self.wait_for_rows(process, 2)
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(PATIENCE), -signal.SIGINT)
        safe = self.safe_rows()
        self.assertGreaterEqual(len(safe), 2)
        self.assertLess(len(safe), len(SLOW.keys))
        self.assert_completes(SLOW, safe)

    def test_two_sweeps_never_share_a_file(self):
        process = self.start(SLOW)
        self.wait_for_rows(process, 1)
        process.send_signal(signal.SIGSTOP)
        self.assert_refused(self.run_icbench(*SLOW.arguments), "another process")
        process.kill()
        process.wait(PATIENCE)
        self.assert_completes(SLOW, self.safe_rows())


if __name__ == "__main__":
    unittest.main()
