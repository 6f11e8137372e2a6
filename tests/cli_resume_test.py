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
            self.succeed("sweep", "--caches", "sequential,wait_free", "--threads", "1", "--repetitions", "2",
                       "--workloads", "miss_driven:cost=0:operations=1000,cornell_box:rays=4:size=16x16",
                       "--reference-spp", "2", "--seed", seed, "--out", name)
            fields = ["queries", "hits", "inserts", "records", "rays", "rmse", "relmse", "mean_ratio"]
            rows = self.load(name)["benchmarks"]
            return {key_of(row): [row.get(field) for field in fields] for row in rows}

        first, second, other = results(1, "a.json"), results(1, "b.json"), results(2, "c.json")
        self.assertEqual(first, second)
        self.assertEqual(first.keys(), other.keys())
        for key in first:
            self.assertNotEqual(first[key], other[key])
        at = {repetition: first["sweep/miss_driven:cost=0:operations=1000/wait_free/threads:1", repetition]
              for repetition in (0, 1)}
        self.assertNotEqual(at[0], at[1], "repetitions are to be independent")

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


class Interrupted(Case):
    """Sweeps that are stopped at any moment lose nothing."""

    CACHES, THREADS, REPETITIONS = ["global_mutex", "local_write", "wait_free"], [1, 2], 12
    WORKLOADS = ["insert_only:records=200", "miss_driven:cost=0:operations=200"]
    ARGUMENTS = ["sweep", "--caches", ",".join(CACHES), "--threads", "1,2",
                 "--workloads", ",".join(WORKLOADS), "--repetitions", str(REPETITIONS),
                 "--out", "r.json", "--resume"]

    def start(self):
        # An interactive shell's background jobs ignore SIGINT, and their children inherit that.
        process = subprocess.Popen([ICBENCH, *self.ARGUMENTS], cwd=self.folder, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL,
                                   preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
        self.addCleanup(process.kill)
        return process

    def safe_rows(self):
        """What the file and its journal hold, by name and repetition."""
        rows = []
        if (self.folder / "r.json").exists():
            results = self.load("r.json")
            self.assertIs(results["context"]["complete"], False)
            rows += results["benchmarks"]
        journal = self.folder / "r.json.partial"
        if journal.exists():
            lines = journal.read_text().split("\n")[1:-1]  # without the header and what was not finished
            rows += map(json.loads, lines)
        safe = {}
        for row in rows:
            self.assertEqual(safe.setdefault(key_of(row), row), row)
        return safe

    def wait_for_rows(self, process, wanted):
        journal = self.folder / "r.json.partial"
        deadline = time.monotonic() + PATIENCE
        while process.poll() is None and time.monotonic() < deadline:
            if journal.exists() and journal.read_text().count("\n") > wanted:
                return
            time.sleep(0.002)

    def assert_complete(self, safe):
        """One more run completes the sweep; the rows that were safe are as they were."""
        self.succeed(*self.ARGUMENTS)
        results = self.load("r.json")
        self.assertIs(results["context"]["complete"], True)
        self.assertEqual(os.listdir(self.folder), ["r.json"])
        rows = {key_of(row): row for row in results["benchmarks"]}
        self.assertEqual(len(rows), len(results["benchmarks"]))
        points = itertools.product(self.WORKLOADS, self.CACHES, self.THREADS)
        names = [f"sweep/{workload}/{cache}/threads:{threads}" for workload, cache, threads in points]
        self.assertEqual(rows.keys(), set(itertools.product(names, range(self.REPETITIONS))))
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
                process = self.start()
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
            context = self.assert_complete(safe) if kills else None
            self.assertLessEqual(len(context.get("resumed", [])), kills, "a resumption is recorded once")

    def test_interrupt_ends_promptly_and_resume_completes(self):
        process = self.start()
        self.wait_for_rows(process, 3)
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(PATIENCE), -signal.SIGINT)
        safe = self.safe_rows()
        self.assertGreaterEqual(len(safe), 3)
        self.assert_complete(safe)

    def test_two_sweeps_never_share_a_file(self):
        process = self.start()
        self.wait_for_rows(process, 1)
        process.send_signal(signal.SIGSTOP)
        try:
            if process.poll() is None:
                self.assert_refused(self.run_icbench(*self.ARGUMENTS), "another process")
        finally:
            process.kill()
            process.wait(PATIENCE)
        self.assert_complete(self.safe_rows())


if __name__ == "__main__":
    unittest.main()
