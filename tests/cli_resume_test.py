#!/usr/bin/env python3
"""The files that icbench sweep writes: determinism, resuming, and interruptions at any moment.

ICBENCH_KILLS in the environment is how often a sweep is killed, by default a dozen times.
"""

import itertools
import json
import os
import random
import resource
import signal
import subprocess
import time
import unittest

from cli_support import (ICBENCH, PATIENCE, PRECIOUS, SANITIZED, SCENE, Case, key_of, small_pareto,
                         small_repeatability, small_sweep)

KILLS = int(os.environ.get("ICBENCH_KILLS", 12))


class SweepFiles(Case):
    """What a sweep writes, and how it goes on."""

    def test_seed_fixes_the_results_of_one_thread(self):
        def results(seed, name):
            workloads = f"miss_driven:cost=0:operations=1000,{SCENE}:rays=4:size=16x16"
            self.succeed(*small_sweep(caches="sequential,wait_free", workloads=workloads, repetitions=2,
                                      **{"reference-spp": 2}, seed=seed, out=name))
            fields = ["queries", "hits", "inserts", "records", "rays", "rmse", "relmse", "mean_ratio"]
            rows = self.load(name)["benchmarks"]
            return {key_of(row): [row.get(field) for field in fields] for row in rows}

        first, second, other = results(1, "a.json"), results(1, "b.json"), results(2, "c.json")
        self.assertEqual(first, second)
        self.assertEqual(first.keys(), other.keys())
        self.assertNotEqual(first, other)
        picture = f"sweep/{SCENE}:rays=4:size=16x16/wait_free/threads:1"
        self.assertNotEqual(first[picture, 0], other[picture, 0])
        self.assertNotEqual(first[picture, 0], first[picture, 1], "repetitions are to be independent")

    def test_parameters_that_an_integrator_has_no_use_for_are_named(self):
        for workload, idle in ((f"{SCENE}:rays=4:spp=1:cell=4:size=16x16", ("spp", "cell")),
                               (f"{SCENE}:integrator=path:rays=4:a=0.5:spp=1:size=16x16", ("rays", "a"))):
            integrator = "path" if "path" in workload else "irradiance_cache"
            done = self.run_icbench(*small_sweep(workloads=workload, out="o.json"), "--reference-spp", "2")
            self.assertEqual(done.returncode, 0, done.stderr)
            for key in idle:
                self.assertRegex(done.stderr,
                                 rf"icbench: {key} of workload '{SCENE}:[^']+' has no effect on {integrator}\n")
            self.assertEqual(done.stderr.count("no effect"), len(idle))

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

    def test_what_neither_an_estimate_nor_a_list_heeds_is_named(self):
        for mode, *given in ("--dry-run", "--resume"), ("--list", "--resume"), ("--list", "--timeline", "t.json"):
            self.succeed_but_for([f"{given[0]} has no effect with {mode}, which is of the whole sweep"],
                                 *small_sweep(out="r.json"), mode, *given)
            self.assertEqual(self.contents(), {})

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

    def test_resume_refuses_a_scene_that_changed_under_its_name(self):
        def scene(height):
            (self.folder / "room.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 0 {height} 0\nf 1 2 3\n")

        for make in small_pareto, small_repeatability:
            scene(1)
            arguments = make(scene="room.obj", out="r.json")
            self.succeed(*arguments)
            self.succeed(*arguments, "--resume")
            scene(2)
            done = self.run_icbench(*arguments, "--resume")
            self.assertEqual(done.returncode, 2)
            self.assertIn("cannot resume", done.stderr)
            self.assertIn("scene_key is", done.stderr)

    def test_resume_refuses_damaged_and_foreign_files(self):
        self.succeed(*small_sweep(out="r.json"))
        whole = (self.folder / "r.json").read_text()
        context = json.loads(whole)["context"]
        for text in (whole[:len(whole) // 2], whole[:-3], "no JSON", "{}", "[]", "\0" * len(whole),
                     '{"context": {}, "benchmarks": []}', '{"context": {}, "benchmarks": 3}',
                     json.dumps({"context": context, "benchmarks": [3]}),
                     '{"context": {"configuration": ' + "[" * 300_000 + "]" * 300_000 + '}, "benchmarks": []}',
                     json.dumps({"context": {**context, "resumed": 3}, "benchmarks": []})):
            (self.folder / "r.json").write_text(text)
            self.refuse(*small_sweep(out="r.json"), "--resume", says=["r.json"])
        for noise in (random.Random(1).randbytes(5000), whole.encode().replace(b"insert_only", b"insert\xffonly")):
            (self.folder / "r.json").write_bytes(noise)
            self.refuse(*small_sweep(out="r.json"), "--resume", says=["r.json"])

    def test_flipped_bits_are_refused_or_harm_one_row_at_most(self):
        arguments = small_sweep(caches="null,wait_free", repetitions=3, out="r.json")
        self.succeed(*arguments)
        whole = self.load("r.json")
        original = {key_of(row): row for row in whole["benchmarks"]}
        # As a kill leaves it: half of the rows in the file, all of them in the journal.
        whole["context"]["complete"] = False
        files = {"r.json": json.dumps({**whole, "benchmarks": whole["benchmarks"][:3]}).encode(),
                 "r.json.partial": b"".join(json.dumps(row).encode() + b"\n"
                                            for row in (whole["context"], *whole["benchmarks"]))}
        chance = random.Random(2)
        refused = 0
        for name, content in files.items():
            # Half of the flips where they are most likely to matter, in what is not a value.
            structure = [i for i, byte in enumerate(content) if byte in b'{}[]":,\n']
            for i in range(12):
                at = chance.choice(structure) if i % 2 else chance.randrange(len(content))
                damaged = bytearray(content)
                damaged[at] ^= 1 << chance.randrange(8)
                with self.subTest(file=name, byte=at, becomes=chr(damaged[at])):
                    for other, bytes_of_other in files.items():
                        (self.folder / other).write_bytes(bytes_of_other)
                    (self.folder / name).write_bytes(damaged)
                    before = self.contents()
                    done = self.run_icbench(*arguments, "--resume")
                    if done.returncode != 0:
                        self.assert_refused(done, "r.json")
                        self.assertEqual(self.contents(), before)
                        refused += 1
                        continue
                    rows = {key_of(row): row for row in self.load("r.json")["benchmarks"]}
                    self.assertLessEqual(original.keys(), rows.keys())
                    changed = [key for key in original if rows[key] != original[key]]
                    self.assertLessEqual(len(changed), 1)
        self.assertGreater(refused, 8)


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
        try:
            return journal.read_text().split("\n")[1:-1]
        except FileNotFoundError:  # not begun, or finished just now
            return []

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

    def is_complete(self):
        return (self.folder / "r.json").exists() and self.load("r.json")["context"]["complete"]

    def test_killed_at_random_moments(self):
        seed = random.randrange(1 << 32)
        chance = random.Random(seed)
        safe = {}
        kills = kills_of_this_sweep = 0
        with self.subTest(seed=seed):
            for start in itertools.count():
                self.assertLess(start, 10 * KILLS + 100, "sweeps end before they can be killed")
                process = self.start(QUICK)
                if start % 2 == 0:  # most likely while it is starting
                    time.sleep(chance.uniform(0, 0.5))
                else:
                    self.wait_for_rows(process, chance.randint(1, 40))
                process.kill()
                was_killed = process.wait(PATIENCE) != 0
                kills += was_killed
                kills_of_this_sweep += was_killed
                if self.is_complete() or kills == KILLS:
                    context = self.assert_completes(QUICK, safe)
                    self.assertLessEqual(len(context.get("resumed", [])), kills_of_this_sweep + 1,
                                         "a resumption is recorded once")
                    if kills == KILLS:
                        break
                    (self.folder / "r.json").unlink()
                    safe, kills_of_this_sweep = {}, 0
                    continue
                now = self.safe_rows()
                for key, row in safe.items():
                    self.assertEqual(now[key], row)
                safe = now

    @unittest.skipIf(SANITIZED, "sanitizers write files of their own")
    def test_space_that_runs_out_ends_the_sweep_and_resume_completes(self):
        self.succeed(*QUICK.arguments)
        size = (self.folder / "r.json").stat().st_size
        (self.folder / "r.json").unlink()

        def limit_files():
            # Stands in for a full disk: writes become short, then fail.
            resource.setrlimit(resource.RLIMIT_FSIZE, (size // 2, size // 2))

        for _ in range(2):  # the second time there is no space from the start
            done = self.run_icbench(*QUICK.arguments, preexec_fn=limit_files)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertRegex(done.stderr.splitlines()[-1], r"\Aicbench: .*r\.json.*File too large")
            safe = self.safe_rows()
            self.assertGreater(len(safe), 0)
        self.assert_completes(QUICK, safe)

    # Guards against: the work of a miss being calibrated anew, so that rows of one name did not do the same.
    def test_a_resumed_sweep_works_by_the_steps_of_the_first(self):
        # A second a miss; by the steps that stand in the file then, no time.
        arguments = small_sweep(workloads="miss_driven:cost=1000000:operations=2000", out="r.json")
        process = subprocess.Popen([ICBENCH, *arguments], cwd=self.folder, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        deadline = time.monotonic() + PATIENCE
        while not (self.folder / "r.json").exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        process.kill()
        process.wait(PATIENCE)
        begun = self.load("r.json")
        self.assertEqual(begun["benchmarks"], [])
        begun["context"]["work_calibration"]["ns_per_unit"] = 1e30
        (self.folder / "r.json").write_text(json.dumps(begun))
        self.succeed(*arguments, "--resume")
        results = self.load("r.json")
        self.assertEqual(len(results["benchmarks"]), 1)
        self.assertEqual(results["context"]["work_calibration"], begun["context"]["work_calibration"])
        begun["context"]["work_calibration"] = {}
        (self.folder / "r.json").write_text(json.dumps(begun))
        self.assert_refused(self.run_icbench(*arguments, "--resume"), "damaged at 'work_calibration'")

    def test_interrupt_ends_promptly_and_resume_completes(self):
        process = self.start(SLOW)
        self.wait_for_rows(process, 2)
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(PATIENCE), -signal.SIGINT)
        safe = self.safe_rows()
        self.assertGreaterEqual(len(safe), 2)
        self.assertLess(len(safe), len(SLOW.keys))
        self.assert_completes(SLOW, safe)

    def test_a_killed_comparison_goes_on_as_if_it_had_not_been(self):
        plan = Plan([], [], [], 0)
        plan.arguments = [*small_pareto(repetitions=4, threads=1, out="r.json"), "--resume"]
        self.succeed(*small_pareto(repetitions=4, threads=1, out="whole.json"))
        fields = ["rmse", "relmse", "hdrvdp_p75", "full_relmse", "bias", "deviation", "bias_runs", "rays", "records"]

        def told(name):
            return {key_of(row): [row.get(f) for f in fields] for row in self.load(name)["benchmarks"]}

        whole = told("whole.json")
        (self.folder / "whole.json").unlink()
        plan.keys = whole.keys()
        for wanted in 3, 15:
            process = self.start(plan)
            self.wait_for_rows(process, wanted)
            process.kill()
            self.assertNotEqual(process.wait(PATIENCE), 0)
        self.assert_completes(plan, self.safe_rows())
        self.assertEqual(told("r.json"), whole)
        self.refuse(*small_pareto(repetitions=4, threads=1, out="r.json", size="25x24"), "--resume",
                    says=["cannot resume", "size is"])

    def test_killed_runs_of_one_seed_go_on(self):
        plan = Plan([], [], [], 0)
        options = {"caches": "wait_free,local_write", "repetitions": 40, "threads": 1, "scene": "white_furnace"}
        plan.arguments = [*small_repeatability(**options, out="r.json"), "--resume"]
        self.succeed(*small_repeatability(**options, out="whole.json"))
        fields = ["rms_to_single", "rms_to_last_run", "rmse", "error", "records_made"]

        def told(name):
            return {key_of(row): [row.get(f) for f in fields] for row in self.load(name)["benchmarks"]}

        whole = told("whole.json")
        (self.folder / "whole.json").unlink()
        plan.keys = whole.keys()
        process = self.start(plan)
        self.wait_for_rows(process, 5)
        process.kill()
        self.assertNotEqual(process.wait(PATIENCE), 0)
        self.assert_completes(plan, self.safe_rows())
        self.assertEqual(told("r.json"), whole)
        self.refuse(*small_repeatability(**options, out="r.json", seed=2), "--resume",
                    says=["cannot resume", "seed is"])

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
