#!/usr/bin/python3
"""Tests of plots/: what is drawn is what was measured, and nothing is claimed that was not.

Results come from a small model of threads that contend (a scalability law per cache), never from a real run;
its context says so.
"""
from __future__ import annotations

import itertools
import math
import os
import re
import subprocess
import sys
import unittest

import numpy as np

from plots_support import (kFewWorkloads, kPlots, kRoot, InFolder, few_caches, model_caches, model_pareto, model_preempt,
                           model_repeatability, model_results, model_simulated, model_timeline, read_csv, run,
                           run_afresh, write_results)

import contention_map
import over_threads
import pareto
import pareto_results
import preemption
import preemption_results
import repeatability
import repeatability_results
import results
import simulated
import speed_error
import style
import timeline
import timeline_results
from figures import (ANATOMY_FIGURES, FIGURES, PARETO_FIGURES, PREEMPTION_FIGURES, REPEATABILITY_FIGURES,
                     TIMELINE_FIGURES)


class Statistics(unittest.TestCase):
    def test_intervals_are_quantiles_of_the_bootstrap_distribution(self):
        error = 4 * math.sqrt(0.025 * 0.975 / results.kResamples)  # of a share, from drawing resamples
        for n in (3, 4, 5, 6):
            samples = np.random.default_rng(n).lognormal(0, 0.5, n)
            all_resamples = list(itertools.product(range(n), repeat=n))
            every = np.median(samples[all_resamples], axis=1)
            _, low, high = results.median_intervals(samples[None, :])
            for end, tail in ((low[0], 0.025), (high[0], 0.975)):
                self.assertLessEqual(np.mean(every < end - 1e-12), tail + error)
                self.assertGreaterEqual(np.mean(every <= end + 1e-12), tail - error)

    def test_fewer_than_three_repetitions_have_no_interval(self):
        for n in (1, 2):
            median, low, high = results.median_intervals(np.ones((4, n)))
            self.assertTrue(np.all(median == 1) and np.all(np.isnan(low)) and np.all(np.isnan(high)))

    def test_ten_thousand_repetitions_of_one_cell(self):
        median, low, high = results.median_intervals(np.arange(10_000.0)[None, :])
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


class Styles(unittest.TestCase):
    def test_every_known_cache_looks_different(self):
        names = [*style.kCacheStyles, *(f"packed_{name}" for name in style.kCacheStyles)]
        for drawn_together in (names, ["path", *style.kMethodStyles]):
            looks = {(s.colour, s.marker, s.hollow) for s in map(style.cache_style, drawn_together)}
            self.assertEqual(len(looks), len(drawn_together))

    def test_an_unknown_cache_looks_the_same_in_every_process(self):
        code = (f"import sys; sys.path.insert(0, {str(kPlots)!r}); import style; "
                "print(style.cache_style('brand_new'))")
        looks = {subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True,
                                env=os.environ | {"PYTHONHASHSEED": seed}).stdout for seed in ("1", "2")}
        self.assertEqual(len(looks), 1)


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
        table = results.summarise(setups[0].rows, ["cache", "workload", "threads"], "items_per_second")
        self.assertEqual(set(table["n"]), {10})
        self.assertTrue(any("differ in os" in remark for remark in setups[0].remarks))

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


class Pareto(InFolder):
    def test_the_front_is_what_no_other_point_beats_in_both(self):
        chance = np.random.default_rng(3)
        for size in range(1, 40):
            seconds, error = chance.integers(1, 12, size), chance.integers(1, 12, size)  # with many ties
            expected = [not any(s < seconds[i] and e < error[i] for s, e in zip(seconds, error))
                        for i in range(size)]
            self.assertEqual(list(pareto_results.on_front(seconds, error)), expected)

    def test_every_setting_is_one_line_with_its_medians_and_fronts(self):
        data = model_pareto()
        self.good("pareto.py", write_results(self.folder / "pareto.json", data), "--out", self.folder)
        lines = read_csv(self.folder / "pareto.csv")
        self.assertEqual(len(lines), len({row["name"] for row in data["benchmarks"]}))
        for line in lines:
            name = f"pareto/{line['scene']}/{line['method']}/{line['setting']}"
            mine = [row for row in data["benchmarks"] if row["name"] == name]
            self.assertAlmostEqual(float(line["seconds"]), np.median([r["seconds_indirect"] for r in mine]))
            self.assertAlmostEqual(float(line["relmse"]), np.median([r["relmse"] for r in mine]))
            self.assertEqual(float(line["bias_runs"]), 3)
            for error in ("relmse", "rmse", "flip", "hdrvdp_p75", "full_relmse"):
                beaten = any(o["scene"] == line["scene"] and float(o["seconds"]) < float(line["seconds"])
                             and float(o[error]) < float(line[error]) for o in lines)
                self.assertEqual(line[f"front_{error}"], str(not beaten), (name, error))

    def test_a_panel_a_scene_and_machines_apart(self):
        first = write_results(self.folder / "a.json", model_pareto(scenes=("desk",)))
        second = write_results(self.folder / "b.json", model_pareto(scenes=("office",)))
        other = write_results(self.folder / "c.json", model_pareto(scenes=("desk",), host_name="other"))
        found = pareto_results.load([first, second, other, first])
        self.assertEqual([sorted(set(one.rows["scene"])) for one in found], [["desk", "office"], ["desk"]])
        self.assertEqual(len({one.slug for one in found}), 2)
        plates = pareto.build(found[0]).plates
        self.assertEqual([panel.title for panel in plates[0].panels], ["desk", "office"])
        self.assertEqual([plate.slug for plate in plates], ["relmse", "rmse", "flip", "hdrvdp_p75"])


class Time(InFolder):
    def test_bars_are_means_that_add_up(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads, threads=(1, 8), errors=False)
        path = write_results(self.folder / "results.json", data)
        self.good("time_breakdown.py", path, "--out", self.folder)
        sums: dict[tuple, float] = {}
        for line in read_csv(self.folder / "time_breakdown.csv"):
            key = line["cache"], line["workload"], line["threads"]
            sums[key] = sums.get(key, 0.0) + float(line["mean"])
        self.assertEqual(len(sums), len({r["name"] for r in data["benchmarks"]}))
        for key, whole in sums.items():
            self.assertAlmostEqual(whole, 1, 9, key)

    def test_without_a_breakdown_nothing_is_drawn(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:1], threads=(1,), errors=False)
        for row in data["benchmarks"]:
            for key in [k for k in row if k.startswith("time_") and k != "time_unit"]:
                del row[key]
        path = write_results(self.folder / "results.json", data)
        self.assertIn("--breakdown", self.good("time_breakdown.py", path, "--out", self.folder).stdout)

    def test_time_that_is_not_explained_is_said(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:1], threads=(1,), errors=False)
        for row in data["benchmarks"]:
            row["time_unexplained"] = 0.2
        path = write_results(self.folder / "results.json", data)
        self.assertIn("not explained", self.good("time_breakdown.py", path, "--out", self.folder).stdout)

    def test_a_trial_that_is_not_explained_is_named_though_its_cells_median_is(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[1:2], threads=(1, 8), errors=False)
        for row in data["benchmarks"]:
            if (row["cache"], row["threads"]) == ("packed_local_write", 8):
                row["time_unexplained"] = {2: 0.035, 4: -0.21}.get(row["repetition_index"], 0.01)
        path = write_results(self.folder / "results.json", data)
        self.assertIn("in 2 of 45 trials more than 3 % of the time is not explained, by the median in 0 of 9 cells; the "
                      "worst: -21 % in packed_local_write, miss driven, 1 µs a record, 8 threads, repetition 4",
                      self.good("time_breakdown.py", path, "--out", self.folder).stdout)

    def test_a_timeline_shows_each_moment_by_its_shares(self):
        path = write_results(self.folder / "timeline.json", model_timeline())
        one = timeline_results.load([path])[0]
        self.assertEqual((one.label, one.names), ("sweep/a/b/threads:2", {0: "thread 0", 1: "thread 1"}))
        shares = timeline.shares(one, 0, 1000.0)
        middle = {kind: [round(float(value[int(f * timeline.kBins)]), 6) for f in (0.25, 0.55, 0.7, 0.9)]
                  for kind, value in shares.items()}
        self.assertEqual(middle["compute a record"], [0.8, 0, 0, 0])
        self.assertEqual(middle["off"], [0.2, 0, 0, 0])
        self.assertEqual(middle["wait for a lock"], [0, 1, 0, 0])
        self.assertEqual(middle["query"], [0, 0, 1, 0])
        self.assertEqual(middle["idle at a barrier"], [0, 0, 0, 1])
        self.good("timeline.py", path, "--out", self.folder)
        self.assertTrue((self.folder / "timeline.svg").exists())

    def test_files_that_are_no_timeline_are_told_in_one_line(self):
        for data in ([], {}, {"traceEvents": []}, {"traceEvents": [{"ph": "X", "name": "a"}]}):
            path = write_results(self.folder / "timeline.json", data)
            done = run("timeline.py", path, "--out", self.folder)
            self.assertEqual((done.returncode, done.stdout), (2, ""))
            self.assertRegex(done.stderr, r"^[^\n]+\n$")

    def test_curves_rise_to_the_right_and_end_at_the_longest(self):
        path = write_results(self.folder / "preempt.json", model_preempt())
        self.good("preemption.py", path, "--out", self.folder)
        lines: dict[tuple, list] = {}
        for line in read_csv(self.folder / "preemption.csv"):
            key = line["cache"], line["held"], line["operation"]
            lines.setdefault(key, []).append((float(line["x"]), float(line["median"]), line["percentile"]))
        self.assertEqual(len(lines), 8)
        for key, points in lines.items():
            self.assertEqual([p[2] for p in points], ["p10", "p50", "p90", "p999", "max"])
            self.assertEqual(points, sorted(points))
            self.assertAlmostEqual(points[1][0], math.log10(2))
            self.assertAlmostEqual(points[-1][0], 5)
        self.assertAlmostEqual(lines["packed_global_mutex", "True", "query"][-1][1], 1.1e7)
        plate = preemption.build(preemption_results.load([path])[0]).plates[0]
        self.assertIn("mutex 50 %", plate.footnote)


class Repeatability(InFolder):
    def test_every_cache_and_thread_count_is_one_line_with_its_medians(self):
        path = write_results(self.folder / "repeatability.json", model_repeatability())
        self.good("repeatability.py", path, "--out", self.folder)
        lines = {(line["cache"], int(line["threads"])): line for line in read_csv(self.folder / "repeatability.csv")}
        expected = {("sequential", 1)} | {(cache, n) for cache in ("null", "global_mutex", "wait_free")
                                          for n in (1, 2, 8)}
        self.assertEqual(lines.keys(), expected)
        self.assertAlmostEqual(float(lines["wait_free", 8]["rms_to_single"]), 0.0022)
        self.assertAlmostEqual(float(lines["wait_free", 8]["rms_to_single_share_of_error"]), 0.11)
        self.assertAlmostEqual(float(lines["wait_free", 8]["rms_to_last_run"]), 0.0024 * 1.15)
        self.assertEqual(float(lines["wait_free", 1]["rms_to_single"]), 0)
        self.assertAlmostEqual(float(lines["wait_free", 2]["rms_to_fewer_threads_share_of_mean"]), 0.00484)
        self.assertEqual(lines["wait_free", 1]["rms_to_fewer_threads"], "")

    def test_a_panel_a_scene_without_the_caches_that_threads_do_not_change(self):
        first = write_results(self.folder / "a.json", model_repeatability("desk"))
        second = write_results(self.folder / "b.json", model_repeatability("office"))
        found = repeatability_results.load([first, second, first])
        self.assertEqual(len(found), 1)
        plate = repeatability.build(found[0]).plates[0]
        self.assertEqual([panel.title for panel in plate.panels],
                         ["desk, irradiance cache", "office, irradiance cache"])
        self.assertIn("No difference at all: null.", plate.footnote)

    def test_nothing_is_drawn_where_threads_change_nothing(self):
        path = write_results(self.folder / "same.json", model_repeatability(differences={"null": 0.0}))
        done = self.good("repeatability.py", path, "--out", self.folder)
        self.assertIn("left out", done.stdout)


class Simulated(InFolder):
    """What is simulated is drawn as such, and nowhere else."""

    def simulated(self, name="simulated.json", validated=2, **model):
        data = model_simulated(validated=validated, **model)
        return data, write_results(self.folder / name, data)

    def test_no_figure_of_measurements_takes_simulated_rows(self):
        measured = model_results(caches=few_caches(), workloads=kFewWorkloads, threads=(1, 2), errors=False)
        rows = len(measured["benchmarks"])
        simulated, path = self.simulated()
        with self.assertRaisesRegex(results.InputError, "simulated, not measured"):
            results.load([path])
        # Either mark suffices.
        for row in simulated["benchmarks"][::2]:
            row["simulated"] = False
        for row in simulated["benchmarks"][1::2]:
            row["name"] = "sweep" + row["name"].removeprefix("simulate")
        measured["benchmarks"] += simulated["benchmarks"]
        setup, = results.load([write_results(self.folder / "mixed.json", measured)])
        self.assertEqual((len(setup.rows), setup.rows["threads"].max()), (rows, 2))
        self.assertTrue(any("left out" in remark for remark in setup.remarks))
        self.good("throughput.py", self.folder / "mixed.json", "--out", self.folder)
        self.assertLessEqual({line["threads"] for line in read_csv(self.folder / "throughput.csv")}, {"1", "2"})

    def test_lines_are_dashed_and_every_title_says_what_they_are(self):
        for validated, words in ((2, "simulated, validated to 2 threads on this machine"),
                                 (0, "simulated, not validated")):
            _, path = self.simulated(validated=validated)
            one, = simulated.load([path])
            plates = simulated.build(one).plates
            self.assertGreaterEqual(len(plates), 4)
            for plate in plates:
                self.assertTrue(plate.title.endswith(words), plate.title)
                axes = simulated.style.matplotlib.figure.Figure().add_axes([0, 0, 1, 1])
                plate.panels[0].draw(axes, style.kReport)
                self.assertTrue(axes.lines)
                for line in [*axes.lines, *plate.handles(style.kReport)]:
                    self.assertTrue(line.is_dashed(), line)
        one.rows["validated_to_threads"] = 2
        one.context["calibration"]["host_name"] = "another"
        self.assertEqual(one.said, "simulated, validated to 2 threads on another")
        self.good("simulated.py", path, "--out", self.folder)
        for line in read_csv(self.folder / "simulated.csv"):
            self.assertEqual((line["simulated"], line["validated_to_threads"]), ("True", "0"))

    def test_readmes_picture_says_how_far_it_was_validated(self):
        drawn = (kRoot / "plots/images/simulated.svg").read_text(encoding="utf-8")
        # matplotlib notes every text beside its outlines.
        self.assertRegex(drawn, r"<!-- Throughput: simulated, validated to \d+ threads on this machine -->")

    def test_measured_rows_are_refused(self):
        done = run("simulated.py", self.results())
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertRegex(done.stderr, r"^[^\n]*nothing simulated in it[^\n]*\n$")


class WrongInput(InFolder):
    def test_a_python_without_the_modules_is_told_in_one_line(self):
        done = subprocess.run([sys.executable, "-S", "-E", str(kPlots / "report.py"), "x"],
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"^[^\n]*no module matplotlib; [^\n]+\n$")

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


if __name__ == "__main__":
    unittest.main()
