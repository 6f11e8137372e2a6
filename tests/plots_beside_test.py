#!/usr/bin/python3
"""Tests of the figures that are made of what lies beside the results of a sweep: speed against error, where the time
goes, what threads change, and simulations."""
from __future__ import annotations

import math
import unittest

import numpy as np

from plots_models import (kFewWorkloads, kRoot, few_caches, model_anatomy, model_pareto, model_preempt,
                          model_repeatability, model_results, model_simulated, model_timeline)
from plots_support import InFolder, read_csv, run, write_results

import anatomy_results
import pareto
import pareto_results
import preemption
import preemption_results
import repeatability
import repeatability_results
import results
import redundant_records
import simulated
import style
import timeline
import timeline_results


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

    def test_other_levels_stand_apart_and_other_settings_are_refused(self):
        first, second = model_repeatability(), model_repeatability()
        for row in second["benchmarks"]:
            row |= {"interpolation": "occlusion_hessian", "leak_guard": True, "real_time": 9.0}
        paths = [write_results(self.folder / "plain.json", first), write_results(self.folder / "ellipses.json", second)]
        found = repeatability_results.load(paths)[0]
        self.assertEqual([name for name, _ in repeatability_results.groups(repeatability_results.points(found))],
                         ["cornell box, irradiance cache", "cornell box, irradiance cache, occlusion hessian, guarded"])
        for row in first["benchmarks"]:
            row |= {"accuracy": 0.4, "real_time": 7.0}
        paths.append(write_results(self.folder / "coarse.json", first))
        with self.assertRaisesRegex(results.InputError, "accuracy of cornell_box by irradiance_cache is 0.4 here and 0.2 in "):
            repeatability_results.load(paths)

    def test_nothing_is_drawn_where_threads_change_nothing(self):
        path = write_results(self.folder / "same.json", model_repeatability(differences={"null": 0.0}))
        done = self.good("repeatability.py", path, "--out", self.folder)
        self.assertIn("left out", done.stdout)


class Pooled(InFolder):
    """Files of one machine and build are runs of one thing, or are refused."""

    def test_another_run_of_queries_adds_its_times(self):
        first, second = model_anatomy(repetitions=2), model_anatomy(repetitions=2)
        for row in second["benchmarks"]:
            row["real_time"] *= 1.5
        paths = [write_results(self.folder / "a.json", first), write_results(self.folder / "b.json", second)]
        alone, both = (anatomy_results.points(anatomy_results.load(some)[0]) for some in (paths[:1], paths))
        self.assertEqual(set(alone["n"]), {2})
        self.assertEqual(set(both["n"]), {4})

    def test_queries_to_other_records_are_another_thing(self):
        second = model_anatomy()
        for row in second["benchmarks"]:
            if "records" in row:
                row["records"] = 2000
        paths = [write_results(self.folder / "a.json", model_anatomy()), write_results(self.folder / "b.json", second)]
        with self.assertRaisesRegex(results.InputError, "records is 2000 here and 100000 in a.json"):
            anatomy_results.load(paths)

    def test_with_a_million_records_more_is_asked(self):
        data = model_anatomy()
        for row in data["benchmarks"]:
            if "records" in row:
                row["records"] = 1_000_000
        for records, asked in (model_anatomy(), 12), (data, 15):
            found, = anatomy_results.load([write_results(self.folder / "a.json", records)])
            bounds = anatomy_results.bounds(found)
            self.assertEqual(set(bounds.loc[bounds["other"] == "wait_free", "asked"]), {asked})

    def test_pauses_of_another_length_are_another_thing(self):
        paths = [write_results(self.folder / f"{pause}.json", model_preempt(configuration={"pause_ms": pause}))
                 for pause in (2, 100)]
        with self.assertRaisesRegex(results.InputError, "pause_ms of mix_90_10 by 10 is 100 here and 2 in 2.json"):
            preemption_results.load(paths)


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

    def test_redundant_records_are_over_those_needed_as_measured_ones_are(self):
        data, path = self.simulated()
        for row in data["benchmarks"]:
            row |= {"records": 1500, "redundant_records": 500}
        one, = simulated.load([write_results(path, data)])
        self.assertEqual(set(one.rows["redundant_share"]), {50.0})
        data["context"] |= {"simulated": False}
        for row in data["benchmarks"]:
            row |= {"simulated": False, "name": "sweep" + row["name"].removeprefix("simulate")}
        setup, = results.load([write_results(path, data)])
        self.assertEqual(set(redundant_records.build(setup).table["median"]), {0.5})

    def test_readmes_picture_says_how_far_it_was_validated(self):
        drawn = (kRoot / "plots/images/simulated.svg").read_text(encoding="utf-8")
        # matplotlib notes every text beside its outlines.
        self.assertRegex(drawn, r"<!-- Throughput: simulated, validated to \d+ threads on this machine -->")

    def test_measured_rows_are_refused(self):
        done = run("simulated.py", self.results())
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertRegex(done.stderr, r"^[^\n]*nothing simulated in it[^\n]*\n$")


if __name__ == "__main__":
    unittest.main()
