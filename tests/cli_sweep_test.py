#!/usr/bin/env python3
"""icbench sweep, the lists of what there is and the help, end to end."""

import itertools
import json
import os
import subprocess
import tempfile
import unittest
from pathlib import Path

from cli_support import ICBENCH, PATIENCE, SCENE, Case, key_of


class Sweep(Case):
    """One sweep over every kind of workload, looked at from all sides."""

    CACHES = ["null", "sequential", "global_mutex", "node_lock", "local_write", "wait_free"]
    THREADS = [1, 2, 8]
    SYNTHETIC = ["read_only:records=2000:operations=2000", "insert_only:records=2000",
                 "mix_90_10:records=2000:operations=2000", "miss_driven:cost=0:operations=2000"]
    RAY_TRACED = SCENE + ":rays=4:size=32x32"
    PATH = SCENE + ":integrator=path:spp=1:size=32x32"
    CELLS = SCENE + ":integrator=hash_cells:spp=1:size=32x32"
    REPETITIONS = 2
    PERCENTILES = ["p10", "p25", "p50", "p75", "p90", "p95", "p99", "p999", "max"]

    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory(prefix="icbench-cli-") as folder:
            done = subprocess.run(
                [ICBENCH, "sweep", "--caches", ",".join(cls.CACHES), "--threads", "1,2,8", "--workloads",
                 ",".join([*cls.SYNTHETIC, cls.RAY_TRACED, cls.PATH, cls.CELLS]), "--repetitions", str(cls.REPETITIONS),
                 "--reference-spp", "2", "--latency-every", "4", "--out", "out.json"],
                cwd=folder, capture_output=True, text=True, timeout=PATIENCE)
            if done.returncode != 0:
                raise AssertionError(done.stderr)
            cls.left_behind = os.listdir(folder)
            results = json.loads((Path(folder) / "out.json").read_text())
        cls.context, cls.rows = results["context"], results["benchmarks"]

    def cached_rows(self, *workloads, keeps=True):
        rows = [r for r in self.rows if r["workload"] in workloads and (r["cache"] != "null" or not keeps)]
        self.assertTrue(rows)
        return rows

    def test_leaves_one_complete_file(self):
        self.assertEqual(self.left_behind, ["out.json"])
        self.assertIs(self.context["complete"], True)

    def test_context_tells_where_the_results_come_from(self):
        google_benchmark = {"date", "host_name", "executable", "num_cpus", "mhz_per_cpu",
                            "cpu_scaling_enabled", "caches", "load_avg", "library_build_type"}
        ours = {"schema_version", "commit", "compiler", "compiler_flags", "cpu_model", "governor", "pin_map",
                "seed", "command_line", "configuration", "work_calibration", "tick_rate"}
        self.assertLessEqual(google_benchmark | ours, self.context.keys())
        self.assertEqual(self.context["command_line"][1], "sweep")

    def test_one_entry_per_point_and_repetition(self):
        expected = set()
        for workload, threads in itertools.product([*self.SYNTHETIC, self.RAY_TRACED], self.THREADS):
            for cache in self.CACHES:
                if cache != "sequential" or threads == 1:
                    expected.add(f"sweep/{workload}/{cache}/threads:{threads}")
        expected |= {f"sweep/{uncached}/none/threads:{threads}" for threads in self.THREADS
                     for uncached in (self.PATH, self.CELLS)}
        keys = [key_of(row) for row in self.rows]
        self.assertEqual(len(keys), len(set(keys)))
        self.assertEqual(set(keys), set(itertools.product(expected, range(self.REPETITIONS))))

    def test_fields_of_every_entry(self):
        always = {"name", "run_name", "run_type", "repetitions", "repetition_index", "threads", "iterations",
                  "real_time", "cpu_time", "time_unit", "items_per_second", "cache", "workload", "structure",
                  "mechanism", "placement", "oversubscribed", "utilisation"}
        cached = {"queries", "hits", "inserts", "records", "lock_wait_share", "cas_attempts", "cas_failures",
                  "nodes_discarded"}
        ray_traced = {"scene", "integrator", "width", "height", "rays", "seconds_indirect", "rmse", "relmse",
                      "mean_ratio"}
        for row in self.rows:
            fields = set(always)
            if row["workload"] not in (self.PATH, self.CELLS):
                fields |= cached
                if row["records"]:
                    fields.add("bytes_per_record")
                for operation, count in ("query", row["queries"]), ("insert", row["inserts"]):
                    if count >= 1000:  # so many that some were certainly timed
                        fields |= {f"latency_{operation}_{p}_ns" for p in self.PERCENTILES}
            if row["workload"] in (self.RAY_TRACED, self.PATH, self.CELLS):
                fields |= ray_traced
            if row["workload"] in (self.SYNTHETIC[3], self.RAY_TRACED) and row["cache"] != "null":
                fields.add("redundant_records")
            self.assertLessEqual(fields, row.keys(), row["name"])
            self.assertEqual(row["iterations"], 1)
            self.assertEqual(row["name"],
                             f"sweep/{row['workload']}/{row['cache']}/threads:{row['threads']}")

    def test_times_and_shares_are_possible(self):
        units = self.context["allowed"]["units"]
        for row in self.rows:
            with self.subTest(row["name"]):
                self.assertGreater(row["real_time"], 0)
                self.assertGreater(row["utilisation"], 0)
                self.assertLessEqual(row["utilisation"], 1)
                self.assertEqual(row["oversubscribed"], row["threads"] > units)
                self.assertLessEqual(0, row.get("lock_wait_share", 0))
                self.assertLessEqual(row.get("lock_wait_share", 0), 1)
                self.assertGreaterEqual(row.get("bytes_per_record", 44), 44)
                for operation in "query", "insert":
                    latencies = [row.get(f"latency_{operation}_{p}_ns", 0)
                                 for p in self.PERCENTILES]
                    self.assertEqual(latencies, sorted(latencies))

    def test_operations_add_up_to_the_rate(self):
        for row in self.rows:
            if row["cache"] == "null":
                continue  # refuses its inserts
            operations = row["queries"] + row["inserts"] if "queries" in row else 32 * 32
            self.assertAlmostEqual(row["items_per_second"] * 1e-3 * row["real_time"], operations, places=3)

    def test_counts_fit_the_workload(self):
        for row in self.cached_rows(self.SYNTHETIC[0]):
            self.assertEqual((row["queries"], row["inserts"], row["records"]), (2000, 0, 2000))
        for row in self.cached_rows(self.SYNTHETIC[1]):
            self.assertEqual((row["queries"], row["inserts"], row["records"]), (0, 2000, 2000))
        for row in self.cached_rows(self.SYNTHETIC[2]):
            self.assertEqual((row["queries"], row["inserts"], row["records"]), (1800, 200, 2200))
        for row in self.cached_rows(self.SYNTHETIC[3], self.RAY_TRACED):
            self.assertEqual(row["inserts"], row["queries"] - row["hits"])
            self.assertEqual(row["records"], row["inserts"])
            self.assertGreater(row["hits"], 0)
        for row in self.cached_rows(self.SYNTHETIC[3]):
            self.assertEqual(row["queries"], 2000)
        for row in self.rows:
            self.assertLessEqual(row.get("hits", 0), row.get("queries", 0))

    def test_null_never_hits_and_keeps_nothing(self):
        for row in self.rows:
            if row["cache"] == "null":
                self.assertEqual((row["hits"], row["records"]), (0, 0))

    def test_every_cache_and_thread_count_finds_the_same(self):
        for repetition in range(self.REPETITIONS):
            hits = {row["hits"] for row in self.cached_rows(self.SYNTHETIC[0])
                    if row["repetition_index"] == repetition}
            self.assertEqual(len(hits), 1)

    def test_one_thread_needs_no_redundant_records(self):
        for row in self.cached_rows(self.SYNTHETIC[3], self.RAY_TRACED):
            if row["threads"] == 1:
                self.assertEqual(row["redundant_records"], 0, row["name"])

    def test_local_write_repeats_work(self):
        for row in self.cached_rows(self.SYNTHETIC[3]):
            if row["cache"] == "local_write" and row["threads"] == 8:
                self.assertGreater(row["redundant_records"], 0)

    def test_only_locks_are_waited_for_and_only_atomics_exchanged(self):
        for row in self.rows:
            if row["cache"] in ("null", "sequential", "local_write", "wait_free"):
                self.assertEqual((row["lock_wait_share"], row["lock_acquisitions"]), (0, 0), row["name"])
            if row["cache"] == "global_mutex":
                self.assertEqual(row["lock_acquisitions"], row["queries"] + row["inserts"])
            if row["cache"] in ("null", "sequential", "global_mutex"):
                self.assertEqual((row["cas_failures"], row["nodes_discarded"]), (0, 0), row["name"])
            self.assertLessEqual(row.get("cas_failures", 0), row.get("cas_attempts", 0))
        for row in self.cached_rows(self.SYNTHETIC[1]):
            if row["cache"] == "wait_free":
                self.assertGreater(row["cas_attempts"], 0)


class Help(Case):
    COMMANDS = ["list", "sweep", "simulate", "render", "animate", "compare", "preempt", "trace"]
    TRACE_COMMANDS = ["capture", "info", "replay"]

    def test_without_arguments_help_goes_to_standard_error(self):
        done = self.run_icbench()
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertEqual(done.stderr, self.succeed("--help"))

    def test_help_is_there_and_fits_the_screen(self):
        for arguments in ([], *([command] for command in self.COMMANDS),
                          *(["trace", command] for command in self.TRACE_COMMANDS)):
            for option in "--help", "-h":
                text = self.succeed(*arguments, option)
                self.assertIn("Usage: " + " ".join(["icbench", *arguments]), text)
                self.assertLessEqual(max(map(len, text.splitlines())), 100, text)
        for command in self.COMMANDS:
            self.assertIn(command, self.succeed("--help"))

    def test_version(self):
        self.assertRegex(self.succeed("--version"), r"\Aicbench \d+\.\d+\.\d+, commit \w+.*\n\Z")

    def test_lists(self):
        known = {"caches": "wait_free", "scenes": "cornell_box", "integrators": "path",
                 "workloads": "miss_driven", "metrics": "rmse"}
        for what, name in known.items():
            rows = json.loads(self.succeed("list", what, "--json"))
            self.assertIn(name, [row["name"] for row in rows])
            text = self.succeed("list", what).splitlines()
            self.assertEqual([line.split()[0] for line in text], ["name", *(row["name"] for row in rows)])

    def test_every_workload_can_be_named_with_its_listed_parameters(self):
        rows = json.loads(self.succeed("list", "workloads", "--json"))
        names = [":".join([row["name"], *row["parameters"].split()]) for row in rows]
        # Parsed before the cache's name, which is refused.
        self.refuse("sweep", "--workloads", ",".join(names), "--caches", "nul", says=["did you mean 'null'?"])


if __name__ == "__main__":
    unittest.main()
