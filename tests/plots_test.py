#!/usr/bin/python3
"""Tests of plots/: what is drawn is what was measured, and nothing is claimed that was not.

Results come from a small model of threads that contend (a scalability law per cache), never from a real run;
its context says so.
"""
from __future__ import annotations

import itertools
import json
import math
import os
import re
import subprocess
import sys
import unittest

import numpy as np
from scipy import stats

from plots_models import kFewWorkloads, kPlots, kRoot, few_caches, model_caches, model_results
from plots_support import InFolder, no_file_above, read_csv, run, run_afresh, write_results

import choice
import contention_map
import grid
import intervals
import over_threads
import results
import speed_error
import structure_mechanism
import tables
from figures import (ANATOMY_FIGURES, FIGURES, PARETO_FIGURES, PREEMPTION_FIGURES, REPEATABILITY_FIGURES,
                     TIMELINE_FIGURES)


class Statistics(unittest.TestCase):
    def test_intervals_are_quantiles_of_the_bootstrap_distribution(self):
        error = 4 * math.sqrt(0.025 * 0.975 / intervals.kResamples)  # of a share, from drawing resamples
        for n in (3, 4, 5, 6):
            samples = np.random.default_rng(n).lognormal(0, 0.5, n)
            all_resamples = list(itertools.product(range(n), repeat=n))
            every = np.median(samples[all_resamples], axis=1)
            _, low, high = intervals.median_intervals(samples[None, :])
            # As src/harness/statistics.h has it.
            out = stats.norm.cdf(-math.sqrt(n / (n - 1)) * stats.t.ppf(0.975, n - 1))
            for end, share in ((low[0], out), (high[0], 1 - out)):
                self.assertLessEqual(np.mean(every < end - 1e-12), share + error)
                self.assertGreaterEqual(np.mean(every <= end + 1e-12), share - error)

    def test_intervals_hold_the_median_as_often_as_they_say_from_six_repetitions_on(self):
        random = np.random.default_rng(5)
        for n in (5, 6, 7, 9, 10, 11, 15, 25):
            _, low, high = intervals.median_intervals(random.exponential(size=(4000, n)) - math.log(2))
            covered = np.mean((low <= 0) & (0 <= high))
            self.assertGreater(covered, 0.92, n)
            self.assertLess(covered, 0.99, n)
            if n < intervals.kFewRepetitions:
                self.assertLess(covered, 0.95, n)

    def test_fewer_than_three_repetitions_have_no_interval(self):
        for n in (1, 2):
            median, low, high = intervals.median_intervals(np.ones((4, n)))
            self.assertTrue(np.all(median == 1) and np.all(np.isnan(low)) and np.all(np.isnan(high)))

    def test_ten_thousand_repetitions_of_one_cell(self):
        median, low, high = intervals.median_intervals(np.arange(10_000.0)[None, :])
        self.assertEqual(median[0], 4999.5)
        # The median's standard error for a uniform sample is half the range over the root of n.
        self.assertTrue(4999.5 - 150 < low[0] < 4999.5 < high[0] < 4999.5 + 150)

    def test_locks_are_told_from_the_rest(self):
        for mechanism in ("global_mutex", "std::mutex", "queuing-mutex", "spin_rw_mutex", "distributed_rw",
                          "node_lock",
                          "LCK", "spin lock", "readers_writer_lock"):
            self.assertTrue(results.is_lock(mechanism), mechanism)
        for mechanism in ("wait_free", "lock_free", "lock-free", "local_write", "none", "append_log",
                          "unknown", "block", "no lock"):
            self.assertFalse(results.is_lock(mechanism), mechanism)

    def test_front_holds_what_nothing_beats(self):
        table = results.pd.DataFrame({"seconds": [1, 2, 2, 3, 4], "relmse": [8, 4, 5, 4, 1]})
        self.assertEqual(list(speed_error.front(table).index), [0, 1, 4])

    def test_break_even_is_interpolated_over_log_cost(self):
        line = results.pd.DataFrame({"record_cost_us": [1, 100], "median": [2.0, 0.5]})
        self.assertAlmostEqual(contention_map.break_even(line), 10.0)
        self.assertIsNone(contention_map.break_even(line.assign(median=[2.0, 1.5])))


class Figures(InFolder):
    def test_csv_holds_the_medians_that_were_put_in(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads, threads=(1, 8), errors=False)
        path = write_results(self.folder / "results.json", data)
        rates: dict[tuple, list] = {}
        for row in data["benchmarks"]:
            # Where inserts come from misses, repeated ones do not count as work.
            missed = row["workload_kind"] in ("miss_driven", "ray_traced", "trace") and "queries" in row
            rate = row["queries"] / (1e-3 * row["real_time"]) if missed else row["items_per_second"]
            rates.setdefault((row["cache"], row["workload"], row["threads"]), []).append(rate)
        self.good("throughput.py", path, "--out", self.folder)
        table = read_csv(self.folder / "throughput.csv")
        self.assertEqual(len(table), len(rates))
        for line in table:
            samples = rates[line["cache"], line["workload"], int(line["threads"])]
            self.assertAlmostEqual(float(line["median"]) / float(np.median(samples)), 1, 8)
            self.assertTrue(float(line["low"]) <= float(line["median"]) <= float(line["high"]))
            self.assertEqual(int(line["n"]), len(samples))
        self.good("speedup.py", path, "--out", self.folder)
        for line in read_csv(self.folder / "speedup.csv"):
            base = rates["packed_sequential", line["workload"], 1]
            own = rates[line["cache"], line["workload"], int(line["threads"])]
            self.assertEqual((line["base_cache"], line["base_threads"]), ("packed_sequential", "1"))
            self.assertAlmostEqual(float(line["base_operations_per_second"]) / np.median(base), 1, 8)
            self.assertAlmostEqual(float(line["median"]) / np.median(np.divide(own, base)), 1, 8)

    def test_contention_map_compares_with_the_best_lock_of_the_same_structure(self):
        caches = model_caches(("ward", "packed"), ("global_mutex", "shared_mutex", "wait_free"), ())
        data = model_results(caches=caches, workloads=kFewWorkloads, threads=(4,), errors=False)
        path = write_results(self.folder / "results.json", data)
        self.good("contention_map.py", path, "--out", self.folder)
        table = read_csv(self.folder / "contention_map.csv")
        self.assertEqual(len(table), 4)
        for line in table:
            times: dict[str, list] = {}
            for row in data["benchmarks"]:
                workload = f"miss_driven:cost={line['record_cost_us']}"
                if row["structure"] == line["structure"] and row["workload"] == workload:
                    times.setdefault(row["cache"], []).append(row["real_time"])
            locks = {c: t for c, t in times.items() if "mutex" in c}
            best = min(locks, key=lambda c: np.median(locks[c]))
            self.assertEqual(line["best_lock"], best)
            expected = np.median(np.divide(locks[best], times[line["cache"]]))
            self.assertAlmostEqual(float(line["median"]) / expected, 1, 8)
        plate, = contention_map.build(results.load([path])[0]).plates
        self.assertIn("Of 5 repetitions an interval is their range", plate.footnote)

    def test_structures_and_mechanisms_are_held_against_one_base(self):
        data = model_results(caches=model_caches(), threads=(1, 16, 64), errors=False)
        path = write_results(self.folder / "results.json", data)
        self.good("structure_mechanism.py", path, "--out", self.folder)
        table = read_csv(self.folder / "structure_mechanism.csv")
        self.assertEqual({line["threads"] for line in table}, {"16", "64"})
        rates: dict[tuple, list] = {}
        for row in data["benchmarks"]:
            key = row["workload"], row["threads"], row["structure"], row["mechanism"]
            rates.setdefault(key, []).append(row["items_per_second"])
        checked = 0
        for line in table:
            if "miss_driven" in line["workload"] or line["mechanism"] == "wait_free":
                continue  # there queries count; and two caches of the model share that mechanism
            own = rates[line["workload"], int(line["threads"]), line["structure"], line["mechanism"]]
            base = rates[line["workload"], int(line["threads"]), "ward", "global_mutex"]
            self.assertAlmostEqual(float(line["median"]) / np.median(np.divide(own, base)), 1, 8)
            checked += 1
        self.assertGreater(checked, 20)

    def test_structures_and_mechanisms_are_held_against_the_base_of_their_own_placement(self):
        def over(caches, workloads) -> dict:
            data = model_results(caches=caches, workloads=workloads, threads=(1, 8), errors=False)
            for row in data["benchmarks"]:
                row["items_per_second"] = 4e6 if "wait_free" in row["cache"] else 1e6
            slow = [row | {"placement": "scatter", "items_per_second": 0.1 * row["items_per_second"],
                           "real_time": 10 * row["real_time"]} for row in data["benchmarks"]]
            return data | {"benchmarks": data["benchmarks"] + slow}

        caches = model_caches(("ward", "packed"), ("global_mutex", "wait_free"), ())
        setup, = results.load([write_results(self.folder / "results.json", over(caches, ("read_only",)))])
        table = structure_mechanism.ratios(setup)
        self.assertEqual(set(table["panel"]), {"read only, compact", "read only, scatter"})
        for line in table.itertuples():
            known = 4.0 if line.mechanism == "wait_free" else 1.0
            self.assertAlmostEqual(line.median, known, 8, line)
            self.assertEqual(line.n, 5)
        self.assertEqual([panel.title for panel in structure_mechanism.build(setup).plates[0].panels],
                         ["read only, compact", "read only, scatter"])

    def test_mechanisms_are_compared_on_one_structure_only(self):
        path = self.results(caches=model_caches())
        setup = results.load([path])[0]
        groups = over_threads.groups_of(setup, setup.rows)
        shared = [g for g in groups if g.mechanisms]
        self.assertEqual(len(shared), 2)
        home = setup.rows.drop_duplicates("cache").set_index("cache")["structure"]
        for group in shared:
            self.assertEqual(home[group.caches].nunique(), 1)
        other, = (g for g in groups if not g.mechanisms)
        self.assertEqual(home[other.caches].nunique(), len(other.caches))

    def test_a_cache_each_of_two_structures_makes_a_report_without_what_compares_mechanisms(self):
        caches = [c for c in model_caches() if c["cache"] in ("global_mutex", "packed_global_mutex")]
        path = self.results(caches=caches)
        done = self.good("report.py", path, "--out", self.folder / "out")
        self.assertIn("figure lock_wait: left out, nothing of it can be compared", done.stdout)
        self.assertTrue((self.folder / "out/report.html").exists())
        done = self.good("lock_wait.py", path, "--out", self.folder / "alone")
        self.assertIn("lock_wait: left out for model", done.stdout)
        self.assertFalse((self.folder / "alone").exists())

    def test_names_are_no_formulas(self):
        data = model_results(caches=few_caches(), workloads=("mix_90_10:order=a$^$",), threads=(1, 8), errors=False)
        path = write_results(self.folder / "results.json", data)
        self.good("throughput.py", path, "--out", self.folder / "out")

    def test_a_structure_may_have_any_name(self):
        caches = [cache | {"structure": "../its own/grid"} for cache in few_caches()]
        self.good("throughput.py", self.results(caches=caches), "--out", self.folder / "figures")
        self.assertEqual({path.name for path in (self.folder / "figures").iterdir()},
                         {"throughput.csv", "throughput.pdf", "throughput.svg"})
        more = [*caches, *few_caches(("ward",))]
        self.good("throughput.py", self.results(caches=more), "--out", self.folder / "figures")
        self.assertTrue((self.folder / "figures/throughput-..-its-own-grid.svg").exists())

    def test_single_repetition_is_said_and_carries_no_interval(self):
        path = self.results(repetitions=1)
        self.good("throughput.py", path, "--out", self.folder)
        self.assertTrue(all(line["low"] == "" for line in read_csv(self.folder / "throughput.csv")))
        # matplotlib notes every text beside its outlines.
        self.assertIn("no intervals can be given", (self.folder / "throughput.svg").read_text())

    def test_single_thread_count(self):
        self.good("speedup.py", self.results(), "--out", self.folder)
        path = self.results(threads=(4,))
        self.good("throughput.py", path, "--out", self.folder)
        done = self.good("speedup.py", path, "--out", self.folder)
        self.assertRegex(done.stdout,
                         r"^speedup: left out for model: only one thread count was measured.*\n$")
        self.assertEqual(list(self.folder.glob("speedup*")), [], "files of the earlier run are stale")

    def test_where_a_file_has_no_room_what_was_there_stays(self):
        path = self.results()
        self.good("speedup.py", path, "--out", self.folder)
        before = {file.name: file.read_bytes() for file in self.folder.iterdir()}
        self.assertGreater(min(len(content) for content in before.values()), 2000)
        with no_file_above(2000):
            done = run("speedup.py", path, "--out", self.folder)
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertRegex(done.stderr, r"^speedup\.py: [^\n]*File too large: '[^\n]*/speedup\.csv'\n$")
        self.assertEqual({file.name: file.read_bytes() for file in self.folder.iterdir()}, before)

    def test_nan_zero_and_absent_values_do_not_reach_a_median(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:1], threads=(1, 8), repetitions=4,
                             errors=False)
        for row in data["benchmarks"]:
            row["items_per_second"] = {0: 5e6, 1: math.nan, 2: 5e6, 3: None}[row["repetition_index"]]
            row["utilisation"] = 0.0
            for key in [k for k in row if k.startswith("latency") or k == "lock_wait_share"]:
                del row[key]
        path = write_results(self.folder / "results.json", data)
        self.good("report.py", path, "--out", self.folder)
        table = read_csv(self.folder / "figures/throughput.csv")
        self.assertEqual({(line["median"], line["n"]) for line in table}, {("5000000", "2")})
        self.assertFalse((self.folder / "figures/latency.csv").exists())

    def test_a_percentile_of_too_few_operations_is_none(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:1], threads=(1, 8, 32), errors=False)
        for row in data["benchmarks"]:
            row |= {"latency_query_samples": 999 if row["cache"] == "packed_wait_free" else 1000,
                    "latency_query_p999_ns": 5e3, "latency_query_p99_ns": 4e3, "latency_query_max_ns": 9e3}
        setup, = results.load([write_results(self.folder / "few.json", data)])
        few = setup.rows[setup.rows["cache"] == "packed_wait_free"]
        self.assertTrue(few["latency_query_p999_ns"].isna().all())
        self.assertTrue((few[["latency_query_p99_ns", "latency_query_max_ns"]].notna()).all(axis=None))
        self.assertEqual(setup.rows["latency_query_p999_ns"].notna().sum(), len(setup.rows) - len(few))
        self.assertNotIn("packed_wait_free", choice.tails(setup)[1])

    def test_failed_trials_and_aggregates_are_not_samples(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:1], threads=(1, 8), errors=False)
        data["benchmarks"] += [row | {"error_occurred": True, "items_per_second": 1.0}
                               for row in data["benchmarks"][:3]]
        data["benchmarks"] += [row | {"run_type": "aggregate", "items_per_second": 1.0}
                               for row in data["benchmarks"][:3]]
        setup = results.load([write_results(self.folder / "results.json", data)])[0]
        self.assertGreater(setup.rows["items_per_second"].min(), 1.0)
        self.assertTrue(any("3 trials" in remark for remark in setup.remarks))

    def test_what_cannot_be_is_told_and_left_out(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:1], threads=(1, 8), errors=False)
        rows = data["benchmarks"]
        rows[0]["items_per_second"], rows[1]["real_time"], rows[2]["utilisation"] = -5.0, -1.0, "x"
        setup = results.load([write_results(self.folder / "results.json", data)])[0]
        self.assertEqual(len(setup.rows), len(rows) - 2)
        self.assertGreater(setup.rows["items_per_second"].min(), 0.0)
        self.assertTrue(any("2 rows of results.json took less than no time" in r for r in setup.remarks))
        self.assertTrue(any("1 values of utilisation in results.json are no numbers" in r for r in setup.remarks))

    def test_ten_thousand_rows_stay_below_half_a_gigabyte(self):
        data = model_results()
        self.assertGreater(len(data["benchmarks"]), 10_000)
        path = write_results(self.folder / "results.json", data)
        with subprocess.Popen([sys.executable, kPlots / "latency.py", path, "--out", self.folder],
                              stdout=subprocess.DEVNULL) as program:
            _, status, used = os.wait4(program.pid, 0)
            program.returncode = os.waitstatus_to_exitcode(status)
        self.assertEqual(program.returncode, 0)
        self.assertLess(used.ru_maxrss, 512 * 1024)


class Machines(InFolder):
    def test_machines_are_kept_apart(self):
        first = self.results("a.json")
        second = self.results("b.json", host_name="other", num_cpus=4)
        setups = results.load([first, second])
        self.assertEqual([s.label for s in setups], ["model", "other"])
        self.assertEqual([s.processing_units for s in setups], [16, 4])
        self.good("throughput.py", first, second, "--out", self.folder)
        self.assertTrue((self.folder / "model/throughput.pdf").exists()
                        and (self.folder / "other/throughput.pdf").exists())

    def test_builds_and_circumstances_of_one_machine_are_kept_apart(self):
        setups = results.load([self.results("a.json"), self.results("b.json", commit="fedcba9876"),
                               self.results("c.json", governor="powersave")])
        self.assertEqual(len({s.slug for s in setups}), 3)
        self.assertIn("commit fedcba9876", setups[1].label)
        self.assertIn("governor powersave", setups[2].label)

    def test_builds_that_differ_far_behind_have_names_of_their_own(self):
        common = "-O3 -DNDEBUG -fno-math-errno -std=c++20 -march="
        setups = results.load([self.results("a.json", compiler_flags=common + "native"),
                               self.results("b.json", compiler_flags=common + "x86-64-v2")])
        self.assertEqual([s.label for s in setups],
                         ["model, compiler flags …native", "model, compiler flags …x86-64-v2"])
        # Where one differs early, so that there is nothing to leave out, the other two are not cut.
        setups = results.load([self.folder / "a.json", self.folder / "b.json",
                               self.results("c.json", compiler_flags="-O2")])
        self.assertEqual(len({s.label for s in setups}), 3)

    def test_a_run_may_be_allowed_less_than_the_machine_has(self):
        allowed = {"units": 2, "cores": 1, "packages": 1, "numa_nodes": 1}
        setup, = results.load([self.results(allowed=allowed)])
        self.assertEqual((setup.processing_units, setup.cores, setup.packages), (2, 1, 1))

    def test_runs_of_one_machine_and_build_are_pooled_and_said(self):
        second = model_results(caches=few_caches(), workloads=kFewWorkloads, threads=(1, 2), errors=False,
                               noise=0.05,
                               os="another")
        setups = results.load([self.results("a.json", threads=(1, 2)),
                               write_results(self.folder / "b.json", second)])
        self.assertEqual(len(setups), 1)
        table = intervals.summarise(setups[0].rows, ["cache", "workload", "threads"], "items_per_second")
        self.assertEqual(set(table["n"]), {10})
        self.assertTrue(any("differ in os" in remark for remark in setups[0].remarks))

    def test_sweeps_that_were_measured_in_another_way_are_not_pooled(self):
        def sweep(name, **measured_with):
            return self.results(name, configuration={"command": "sweep", "reference_spp": 64} | measured_with)

        plain = sweep("a.json")
        self.assertEqual(len(results.load([plain, sweep("b.json", seed=3)])), 1)
        for name, other in ("reference_spp", 1024), ("breakdown", True), ("latency_every", 1000):
            with self.assertRaisesRegex(results.InputError, f"{name} is {other} here and .* in a.json"):
                results.load([plain, sweep("b.json", **{name: other})])

    def test_traces_of_one_name_that_differ_are_not_pooled(self):
        def swept(name, trace):
            return self.results(name, configuration={"command": "sweep", "traces": {"trace:file=a.trace": trace}})

        def replayed(name, trace):
            data = model_results(caches=few_caches(), workloads=kFewWorkloads, threads=(1, 2), errors=False,
                                 configuration={"command": "trace replay", "trace": trace})
            for row in data["benchmarks"]:
                row["workload"] = "trace:file=a.trace"
            return write_results(self.folder / name, data)

        for make in swept, replayed:
            self.assertEqual(len(results.load([make("a.json", "1f"), make("b.json", "1f")])), 1)
            with self.assertRaisesRegex(results.InputError, "trace:file=a.trace is another one than in a.json"):
                results.load([make("a.json", "1f"), make("b.json", "2f")])

    def test_trials_with_a_thread_that_is_held_are_none_of_a_sweep(self):
        for command in "preempt", "repeatability":
            with self.assertRaisesRegex(results.InputError, f"rows of icbench {command} are no trials by themselves"):
                results.load([self.results("a.json"), self.results("b.json", configuration={"command": command})])

    def test_half_a_character_is_named_with_its_line_and_whole_ones_are_read(self):
        def written(name):
            data = json.dumps({"context": {}, "benchmarks": []}, indent=1).replace("{}", f'{{"host_name": "{name}"}}')
            return (self.folder / "a.json", (self.folder / "a.json").write_text(data))[0]

        for name in r"a\ud83d\ude00b", r"\\ud800", r"\\\\udc00", "é":
            self.assertIn("host_name", results.read_json(written(name), "x", "y")["context"])
        for name in r"\ud800", r"a\uDC00\ud800", r"\\\ud83d", r"\ud83dx\ude00", r"\ud83d\ude00\ude00":
            with self.assertRaisesRegex(results.InputError, r"^\S+a\.json: line 2 has half a character \(\\u[dD]\w{3}\)"):
                results.read_json(written(name), "x", "y")

    def test_the_same_rows_count_once(self):
        first = self.results("a.json")
        copy = self.folder / "b.json"
        copy.write_bytes(first.read_bytes())
        once, twice = results.load([first])[0], results.load([first, first, copy])[0]
        self.assertEqual(len(once.rows), len(twice.rows))

    def test_placements_are_not_merged(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:1], threads=(1, 8), errors=False)
        data["benchmarks"] += [row | {"placement": "scatter", "real_time": row["real_time"] * 2}
                               for row in data["benchmarks"]]
        setup = results.load([write_results(self.folder / "results.json", data)])[0]
        self.assertEqual(set(setup.rows["panel"]), {"mix 90/10, hot spot, compact",
                                                    "mix 90/10, hot spot, scatter"})
        data["context"]["placement"] = ""
        for row in data["benchmarks"]:
            row["placement"] = row["placement"].replace("compact", "")
        setup = results.load([write_results(self.folder / "results.json", data)])[0]
        self.assertEqual(set(setup.rows["panel"]), {"mix 90/10, hot spot", "mix 90/10, hot spot, scatter"})


    def test_errors_of_placements_are_not_merged(self):
        data = model_results(caches=few_caches(), workloads=(), threads=(1, 8))
        one = results.load([write_results(self.folder / "a.json", data)])[0]
        self.assertEqual(re.findall(r'colspan="4">([^<]*)<', tables.errors(one)), ["cornell box", "sibenik"])
        # Slower everywhere: beside the other one nothing of it would be left.
        data["benchmarks"] += [row | {"placement": "scatter", "seconds_indirect": 3 * row["seconds_indirect"]}
                               for row in data["benchmarks"]]
        both = results.load([write_results(self.folder / "b.json", data)])[0]
        blocks = re.split(r'colspan="4">([^<]*)<', tables.errors(both))
        self.assertEqual(blocks[1::2], ["cornell box, compact", "cornell box, scatter", "sibenik, compact",
                                        "sibenik, scatter"])
        lines = [block.count("<tr><td>") for block in blocks[2::2]]
        self.assertEqual(lines[0::2], lines[1::2])


class WrongInput(InFolder):
    def test_a_python_without_the_modules_is_told_in_one_line(self):
        done = subprocess.run([sys.executable, "-S", "-E", str(kPlots / "report.py"), "x"],
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"^[^\n]*no module matplotlib; [^\n]+\n$")

    def test_the_program_that_times_the_page_starts(self):
        done = subprocess.run([sys.executable, "-B", str(kRoot / "bench/report_opening"), "--help"],
                              capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, done.stderr), (0, ""))

    def refused(self, script, *arguments):
        done = run(script, *arguments)
        self.assertEqual(done.returncode, 2)
        self.assertEqual(done.stdout, "")
        self.assertRegex(done.stderr, r"^[^\n]+\n$")

    def test_every_wrong_file_is_one_line_and_status_2(self):
        (self.folder / "text.json").write_text("not json")
        (self.folder / "bytes.json").write_bytes(b"\xff\xfe\x00")
        (self.folder / "list.json").write_text("[]")
        (self.folder / "empty.json").write_text('{"context": {}, "benchmarks": []}')
        (self.folder / "context.json").write_text('{"benchmarks": [{"name": "x"}]}')
        (self.folder / "rows.json").write_text('{"context": {}, "benchmarks": [{"name": "BM_x/1"}, 3]}')
        for name in ("absent", "text", "bytes", "list", "empty", "context", "rows"):
            with self.subTest(name):
                self.refused("throughput.py", self.folder / f"{name}.json", "--out", self.folder)
                self.refused("report.py", self.folder / f"{name}.json", "--out", self.folder)
        self.refused("report.py", self.folder, "--out", self.folder)

    def test_wrong_usage(self):
        self.refused("report.py")
        self.refused("throughput.py", "--nonsense")
        self.refused("throughput.py", self.results(), "--out", "/proc/nowhere")

    def test_help(self):
        figures = [*FIGURES, *PARETO_FIGURES, *REPEATABILITY_FIGURES, *PREEMPTION_FIGURES, *TIMELINE_FIGURES,
                   *ANATOMY_FIGURES]
        for script in ["report.py", "simulated.py", *(f"{figure.name}.py" for figure in figures)]:
            done = self.good(script, "--help")
            self.assertIn("--out DIR", done.stdout)

    def test_programs_start_on_their_own(self):
        for script in ("report.py", "simulated.py", "throughput.py", "correctness.py"):
            done = run_afresh(script, "--help")
            self.assertEqual((done.returncode, done.stderr), (0, ""), script)
            self.assertIn("usage: " + script, done.stdout)


class Grids(unittest.TestCase):
    """Tables as they are written."""

    def test_parts_of_a_list_below_a_value_stand_on_lines_of_their_own(self):
        made = grid.Grid("g", "Title", "", ["what", "measured"], [
            [grid.Cell("all"), grid.Cell("2", "a: 1 [0, 1]; b: 3 [2, 4]")],
            [grid.Cell("one"), grid.Cell("5", "[4, 6]")],
        ])
        for parts in (["a: 1 [0, 1];", "b: 3 [2, 4]"], ["[4, 6]"]):
            self.assertIn("".join(f'<span class="under">{part}</span>' for part in parts) + "</td>", made.html())
        self.assertIn("| all | 2 (a: 1 [0, 1]; b: 3 [2, 4]) |", made.markdown())

    def test_markdown_shows_names_as_they_are(self):
        self.assertEqual(grid.markdown_text("a<img src=x>|`b`*c*\nd_e"), "a\\<img src=x>\\|\\`b\\`\\*c\\* d_e")


if __name__ == "__main__":
    unittest.main()
