#!/usr/bin/python3
"""Tests of what the report concludes: scaling laws, and which scheme to use."""
from __future__ import annotations

import json
import math
import unittest

import numpy as np
import pandas as pd

from plots_models import kFewWorkloads, few_caches, model_caches, model_results, model_simulated
from plots_support import InFolder, write_results

import choice
import choice_page
import intervals
import results
import scalability
import scaling_law
import simulated
import tables
from figure import Omitted

kCounts = (1, 2, 4, 8, 16, 32)


def speed(n, gamma, alpha, beta):
    return gamma * n / (1 + alpha * (n - 1) + beta * n * (n - 1))


class ScalabilityLaw(unittest.TestCase):
    def test_known_parameters_lie_in_their_intervals(self):
        random = np.random.default_rng(3)
        for truth in ((1e6, 0.05, 0.002), (4e7, 0.9, 0.02), (2.0, 0.3, 0.0004)):
            law = scalability.fit({n: speed(n, *truth) * np.exp(random.normal(0, 0.02, 15)) for n in kCounts})
            for number, value in enumerate(truth):
                low, high = law.interval(number)
                self.assertLessEqual(low, value * 1.02, truth)
                self.assertGreaterEqual(high, value * 0.98, truth)
            low, high = law.band([64, 128])
            for n, a, b in zip((64, 128), low, high):
                self.assertTrue(a * 0.98 <= speed(n, *truth) <= b * 1.02, (truth, n))

    def test_exact_data_give_the_exact_law(self):
        law = scalability.fit({n: [speed(n, 5e5, 0.1, 0.01)] * 3 for n in kCounts})
        self.assertAlmostEqual(law.gamma / 5e5, 1, places=9)
        self.assertAlmostEqual(law.alpha, 0.1, places=9)
        self.assertAlmostEqual(law.beta, 0.01, places=9)
        self.assertAlmostEqual(law.peak, math.sqrt(0.9 / 0.01), places=6)

    def test_degenerate_data_give_finite_laws_that_are_not_negative(self):
        for speeds in ([1e6] * 6, [1e6 / n for n in kCounts], [1e6 / n**4 for n in kCounts],
                       [1e6 * n**2 for n in kCounts], [1e-300] * 6):
            law = scalability.fit({n: [v] * 3 for n, v in zip(kCounts, speeds)})
            for value in (law.gamma, law.alpha, law.beta, *law.refits.ravel(), *law.speed([1, 7, 1024])):
                self.assertTrue(math.isfinite(value) and value >= 0, (speeds, value))
            self.assertGreaterEqual(law.peak, 1)
        flat = scalability.fit({n: [1e6] * 3 for n in kCounts})
        np.testing.assert_allclose(flat.speed(kCounts), 1e6, rtol=1e-9)

    def test_five_thread_counts_are_too_few(self):
        self.assertIsNone(scalability.fit({n: [speed(n, 1e6, 0.1, 0)] * 3 for n in kCounts[:5]}))
        broken = {n: [math.nan, 0.0, -1.0] for n in (64, 128)}
        self.assertIsNone(scalability.fit({n: [1e6] * 3 for n in kCounts[:5]} | broken))

    def test_two_repetitions_give_no_band(self):
        law = scalability.fit({n: [speed(n, 1e6, 0.1, 0.01)] * 2 for n in kCounts})
        self.assertIsNone(law.band([64]))
        self.assertTrue(math.isnan(law.interval(0)[0]))


class ScalingLawFigure(InFolder):
    def setup_of(self, **options) -> results.Setup:
        return results.load([self.results(**options)])[0]

    def test_oversubscribed_counts_do_not_count(self):
        with self.assertRaisesRegex(Omitted, "fewer than six thread counts without oversubscription were measured "
                                             r"\(5 were\)"):
            scaling_law.fitted(self.setup_of(threads=(1, 2, 4, 8, 16, 32, 64)))

    def test_it_says_why_there_is_none(self):
        said = self.good("scaling_law.py", self.results(), "--out", self.folder).stdout
        self.assertIn("left out for model: fewer than six thread counts without oversubscription", said)
        self.assertEqual(tables.scaling_laws(None), "")

    def test_laws_are_drawn_and_tabled(self):
        path = self.results(threads=(1, 2, 3, 4, 6, 8, 32), workloads=kFewWorkloads[:1], repetitions=3)
        self.good("scaling_law.py", path, "--out", self.folder)
        drawing = (self.folder / "scaling_law.svg").read_text(encoding="utf-8")
        self.assertIn("stroke-dasharray", drawing)
        table = pd.read_csv(self.folder / "scaling_law.csv")
        self.assertEqual(set(table["cache"]), {c["cache"] for c in few_caches()} - {"packed_sequential"})
        self.assertTrue((table["alpha_low"] <= table["alpha"]).all())
        contended = table.set_index("cache").loc[["packed_global_mutex", "packed_wait_free"], "alpha"]
        self.assertGreater(contended.iloc[0], contended.iloc[1])
        shown = tables.scaling_laws(table)
        for cache in table["cache"]:
            self.assertIn(f"<td>{cache}</td>", shown)

    def test_bands_of_few_repetitions_are_called_too_narrow(self):
        for repetitions, few in ((2, False), (3, True), (6, False)):
            setup = self.setup_of(threads=(1, 2, 3, 4, 6, 8), workloads=kFewWorkloads[:1], repetitions=repetitions)
            self.assertEqual("make them too narrow" in scaling_law.build(setup).plates[0].footnote, few, repetitions)

    def test_the_report_tables_the_law_of_the_cache_called_null(self):
        path = self.small(caches=model_caches((), (), ("null",)), threads=(1, 2, 3, 4, 6, 8), repetitions=3)
        self.good("report.py", path, "--out", self.folder)
        self.assertIn("<h3>Scaling laws</h3>", page := (self.folder / "report.html").read_text(encoding="utf-8"))
        self.assertIn("<tr><td>null</td>", page[page.index("<h3>Scaling laws</h3>"):])


class Choice(InFolder):
    def chosen(self, **options) -> tuple[choice.Choice, dict[str, str], results.Setup]:
        options = {"workloads": ("miss_driven:cost=0", "miss_driven:cost=1", "miss_driven:cost=16",
                                 "miss_driven:cost=64"), "threads": (1, 2, 4, 8, 16, 32)} | options
        setup = results.load([self.results(**options)])[0]
        return choice.choice(setup), dict(zip(setup.rows["cache"], setup.rows["mechanism"])), setup

    def test_hardware_threads_are_no_cores(self):
        made, _, setup = self.chosen()
        self.assertEqual(setup.cores, 8)
        self.assertEqual(made.threads, [1, 2, 4, 8])

    def test_a_measured_point_is_answered_by_its_own_rows(self):
        made, mechanisms, setup = self.chosen()
        found = choice.answer(made, mechanisms, 16, 8, None)
        self.assertFalse(made.in_rays)
        self.assertEqual((found.certainty, found.how), ("measured", "points that miss, 16 µs a record"))
        rows = setup.rows
        mine = rows[(rows["workload"] == "miss_driven:cost=16") & (rows["threads"] == 8)]
        times = 1 / mine.groupby("cache")["items_per_second"].median()
        self.assertEqual(found.lines[0].cache, times.idxmin())
        self.assertAlmostEqual(found.lines[0].time, times.min(), places=15)
        lock = next(line for line in found.lines if line.kind == "one lock")
        pairs = intervals.paired(mine[mine["cache"] == found.lines[0].cache], mine[mine["cache"] == lock.cache], [],
                               "items_per_second")["ratio"]
        self.assertAlmostEqual(lock.ratio[0], pairs.median(), places=9)
        self.assertLess(lock.ratio[1], lock.ratio[0])

    def test_between_two_costs_times_are_straight(self):
        made, mechanisms, _ = self.chosen(noise=0)
        ends = [choice.answer(made, mechanisms, x, 8, None) for x in (16, 64)]
        middle = choice.answer(made, mechanisms, 40, 8, None)
        self.assertEqual(middle.how, "points that miss, between 16 and 64 µs a record")
        times = [{line.cache: line.time for line in a.lines} for a in (*ends, middle)]
        for cache in set(times[0]) & set(times[1]) & set(times[2]):
            self.assertAlmostEqual(times[2][cache] * 1e9, (times[0][cache] + times[1][cache]) / 2 * 1e9, places=6)

    def test_outside_the_measured_costs_it_says_so(self):
        made, mechanisms, _ = self.chosen()
        found = choice.answer(made, mechanisms, 1000, 8, None)
        self.assertEqual((found.certainty, found.how), ("extrapolated",
                                                        "points that miss, 64 µs a record, the nearest"))

    def test_nothing_is_made_up_for_other_cores(self):
        made, mechanisms, _ = self.chosen()
        self.assertIsNone(choice.answer(made, mechanisms, 16, 256, None))

    def test_a_rendered_scene_answers_for_its_rays_and_tells_what_a_ray_costs(self):
        data = model_results(caches=few_caches(), workloads=("miss_driven:cost=1", "miss_driven:cost=100"),
                             threads=(1, 8), repetitions=5)
        for row in data["benchmarks"]:
            if row["cache"] != "none" and row.get("scene"):
                rays = float(row["workload"].split("rays=")[1].split(":")[0])
                slow = 1.3 if row["cache"] == "packed_global_mutex" and row["threads"] > 1 else 1
                row["records"], row["redundant_records"] = 1000, 0
                row["seconds_indirect"] = slow * (0.01 + 1000 * rays * 0.25e-6) / row["threads"]
        setup = results.load([write_results(self.folder / "r.json", data)])[0]
        made = choice.choice(setup)
        mechanisms = dict(zip(setup.rows["cache"], setup.rows["mechanism"]))
        self.assertTrue(made.in_rays)
        self.assertAlmostEqual(made.microseconds_a_ray[0], 0.25, places=6)
        found = choice.answer(made, mechanisms, 64, 8, 0.2)
        self.assertEqual((found.certainty, found.how), ("measured", "rendering cornell box, a = 0.2, 64 rays"))
        lock = next(line for line in found.lines if line.kind == "one lock")
        self.assertAlmostEqual(lock.ratio[0], 1.3, places=6)
        self.assertNotIn(lock, found.tied)
        self.assertEqual({line.kind for line in (found.lines[0], *found.tied)}, {"local write", "wait-free"})
        self.assertAlmostEqual(found.lines[0].loss[0], 0, places=6)
        self.assertAlmostEqual(lock.loss[0], 1 - 1 / 1.3, places=6)
        # Past the rays that were rendered, points that miss answer at the cost of so many rays.
        far = choice.answer(made, mechanisms, 362, 8, 0.2)
        self.assertEqual(far.how, "points that miss, between 1 and 100 µs a record")
        least = choice.errors_at(made, 64)
        self.assertEqual([e.accuracy for e in least], [0.4, 0.2, 0.1])
        self.assertTrue(all(e.measured for e in least))
        self.assertFalse(choice.errors_at(made, 23)[0].measured)

    def test_the_first_page_begins_with_an_error_that_the_middle_accuracy_keeps(self):
        for median, high, begun in ((0.00789, 0.00842, 0.0085), (0.9, 1.0, 1.0), (2e-7, 3.01e-7, 3.1e-7),
                                    (0.06, math.nan, 0.06)):
            errors = pd.DataFrame([{"rays_per_record": 64, "accuracy": a, "median": median * f, "low": median * f,
                                    "high": high * f} for a, f in ((0.1, 0.5), (0.2, 1.0), (0.4, 2.0))])
            made = choice.Choice(True, [64], (1.0, 1.0, 1.0), [1], [], errors, "desk")
            self.assertAlmostEqual(choice_page.tolerable(made, 64), begun, delta=1e-9 * begun)

    def test_a_tie_is_called_one(self):
        data = model_results(caches=few_caches(), workloads=("miss_driven:cost=1",), threads=(1, 8), repetitions=9,
                             errors=False)
        random = np.random.default_rng(1)
        for row in data["benchmarks"]:
            row["items_per_second"] = row["queries"] = 1e6 * random.uniform(0.9, 1.1)
            row["real_time"], row["time_unit"] = 1.0, "s"
        setup = results.load([write_results(self.folder / "r.json", data)])[0]
        found = choice.answer(choice.choice(setup), dict(zip(setup.rows["cache"], setup.rows["mechanism"])), 1, 8, None)
        self.assertEqual(found.tied, found.lines[1:])

    def test_the_fastest_is_so_by_the_ratios_that_are_shown(self):
        # By medians 2 and 2.1 seconds, by pairs 0.95 of the time of the other in most repetitions.
        times = pd.DataFrame({"a": [1.0, 2.0, 10.0], "b": [0.95, 2.1, 9.5], "c": [3.0, 6.0, 40.0]})
        self.assertEqual(choice._by_pairs(times), ["b", "a", "c"])
        circle = pd.DataFrame({"a": [1.0, 2.0, 3.0], "b": [2.0, 3.0, 1.0], "c": [3.0, 1.0, 2.0]})
        self.assertEqual(choice._by_pairs(circle), ["a", "b", "c"])

    def test_too_few_repetitions_decide_nothing(self):
        made, mechanisms, _ = self.chosen(repetitions=2)
        found = choice.answer(made, mechanisms, 0, 8, None)
        self.assertEqual(found.repetitions, 2)
        self.assertEqual(found.tied, found.lines[1:])

    def test_scaling_laws_answer_past_the_machine_and_are_called_extrapolated(self):
        made, mechanisms, _ = self.chosen(threads=(1, 2, 3, 4, 6, 8))
        self.assertEqual(made.threads[-2:], [16, 32])
        found = choice.answer(made, mechanisms, 1, 32, None)
        self.assertEqual(found.certainty, "extrapolated")
        self.assertTrue(math.isfinite(found.lines[-1].ratio[1]))
        self.assertEqual(found.repetitions, 0)

    def test_the_simulator_answers_past_the_machine_and_is_called_simulated(self):
        made, mechanisms, setup = self.chosen()
        simulated = setup.rows[setup.rows["threads"].isin((1, 8))].copy()
        simulated = simulated[simulated["repetition_index"] == 0]
        simulated["threads"] = simulated["threads"].replace(8, 256)
        simulated["validated_to_threads"] = 8
        setup.simulated = simulated
        made = choice.choice(setup)
        self.assertEqual(made.threads, [1, 2, 4, 8, 256])
        found = choice.answer(made, mechanisms, 16, 256, None)
        self.assertEqual(found.certainty, "simulated")
        self.assertEqual(choice_page.how_sure(found), "simulated, validated to 8 threads on this machine")
        # What was measured is answered by what was measured.
        self.assertEqual(choice.answer(made, mechanisms, 16, 8, None).certainty, "measured")
        page = choice_page.section(setup, "")
        self.assertIn("simulated, validated to 8 threads on this machine", page)
        # Beyond the costs that were simulated, the nearest answers for no more than itself.
        beyond = choice.answer(made, mechanisms, 1000, 256, None)
        self.assertEqual((beyond.certainty, beyond.validated_to), ("simulated", 0))
        self.assertEqual(choice_page.how_sure(beyond), "simulated at another cost of a record, not validated")
        self.assertEqual(beyond.how, "points that miss, 64 µs a record, the nearest")
        self.assertEqual(made.notes[0], "past 8 cores the answers are simulated, whatever the tolerable error")
        setup.simulated = simulated[simulated["cache"] != "packed_local_write"]
        self.assertEqual(choice.choice(setup).notes[0], "past 8 cores the answers are simulated, whatever the tolerable "
                         "error; not simulated, and so not compared there: local write")

    def test_an_answer_is_as_far_validated_as_the_least_that_it_draws_on(self):
        measured = self.results(workloads=("miss_driven:cost=1", "miss_driven:cost=64"), threads=(1, 8))
        data = model_simulated((1, 256), 8, workloads=("miss_driven:cost=1", "miss_driven:cost=64"))
        for row in data["benchmarks"]:
            if (row["cache"], row["workload"]) == ("packed_shared_mutex", "miss_driven:cost=64"):
                row["validated_to_threads"] = 2
        for missing, host, words in (("", "model", "validated to 2 threads on this machine"),
                                     ("", "elsewhere", "validated to 2 threads on elsewhere"),
                                     ("packed_local_write", "model", "not validated")):
            changed = json.loads(json.dumps(data))
            changed["context"]["calibration"]["host_name"] = host
            for row in changed["benchmarks"]:
                if (row["cache"], row["workload"]) == (missing, "miss_driven:cost=64"):
                    del row["validated_to_threads"]
            setup, = results.load([measured, write_results(self.folder / "s.json", changed)])
            made = choice.choice(setup)
            mechanisms = dict(zip(setup.rows["cache"], setup.rows["mechanism"]))
            # The figure of the file, and every answer that draws on the cell, say the same.
            one, = simulated.load(setup.simulated_paths)
            self.assertEqual(one.said, f"simulated, {words}")
            for cost in (64, 30):
                self.assertEqual(choice_page.how_sure(choice.answer(made, mechanisms, cost, 256, None)), one.said)
            # At the other cost everything was validated.
            self.assertEqual(choice_page.how_sure(choice.answer(made, mechanisms, 1, 256, None)),
                             f"simulated, validated to 8 threads on {'this machine' if host == 'model' else host}")

    def test_simulated_rows_are_kept_apart_from_measured_ones(self):
        measured = model_results(caches=few_caches(), workloads=("miss_driven:cost=1",), threads=(1, 8), errors=False)
        simulated = model_simulated((1, 256), 8, workloads=("miss_driven:cost=1",))
        paths = [write_results(self.folder / "m.json", measured), write_results(self.folder / "s.json", simulated)]
        setup, = results.load([paths[1], paths[0]])
        self.assertEqual(setup.simulated_paths, paths[1:])
        # What a simulation says of its virtual machine is nothing to warn of, nor a difference of what was measured.
        self.assertNotIn("virtual_machine", setup.context)
        self.assertFalse([remark for remark in setup.remarks if "differ" in remark])
        self.assertEqual(len(setup.rows), len(measured["benchmarks"]))
        self.assertEqual(len(setup.simulated), len(simulated["benchmarks"]))
        self.assertEqual(sorted(setup.rows["threads"].unique()), [1, 8])
        made = choice.choice(setup)
        self.assertEqual(made.threads, [1, 8, 256])
        found = choice.answer(made, dict(zip(setup.rows["cache"], setup.rows["mechanism"])), 1, 256, None)
        self.assertEqual((found.certainty, found.repetitions, found.validated_to), ("simulated", 1, 8))
        # It has no scatter, and so no interval: what it is held to stands for that.
        self.assertTrue(math.isnan(found.lines[-1].ratio[1]))
        self.assertEqual([line for line in found.lines[1:] if line.ratio[0] <= 1.1], found.tied)
        self.assertGreater(found.lines[-1].ratio[0], 1.1)
        with self.assertRaisesRegex(results.InputError, "simulated, not measured; plots/simulated.py draws it"):
            results.load(paths[1:])
        simulated["context"]["commit"] = "other"
        setup, = results.load([paths[0], write_results(self.folder / "t.json", simulated)])
        self.assertTrue(setup.simulated.empty)
        self.assertIn("simulated rows of t.json come from a machine or build of which nothing", setup.remarks[-1])

    def test_simulated_files_of_different_settings_may_come_together(self):
        measured = self.results(workloads=kFewWorkloads[1:], threads=(1, 8))
        first = model_simulated((1, 256), 8, workloads=kFewWorkloads[1:])
        second = model_simulated((1,), 0, workloads=("miss_driven:cost=10",))
        setup, = results.load([measured, *(write_results(self.folder / f"{number}.json", data)
                                           for number, data in enumerate((first, second)))])
        made = choice.choice(setup)
        mechanisms = dict(zip(setup.rows["cache"], setup.rows["mechanism"]))
        for cost, known in ((64, True), (30, False)):
            found = choice.answer(made, mechanisms, cost, 256, None)
            self.assertEqual(found.certainty, "simulated")
            self.assertEqual(math.isfinite(found.lines[0].loss[0]), known, cost)

    def test_other_virtual_machines_and_costs_are_no_repetitions(self):
        measured = self.results(workloads=("miss_driven:cost=1",), threads=(1, 8))
        paths = []
        for number, context in enumerate(({}, {"virtual_machine": {"cores_per_complex": 4}},
                                          {"calibration": {"host_name": "model", "date": "2025-01-03T10"}})):
            data = model_simulated((1, 256), 8, workloads=("miss_driven:cost=1",))
            data["context"] |= context
            for row in data["benchmarks"]:
                row["items_per_second"] /= 1 + 9 * number
                row["queries"] /= 1 + 9 * number
            paths.append(write_results(self.folder / f"machine{number}.json", data))
        alone = [results.load([measured, path])[0] for path in paths]
        for first, second in ((0, 1), (1, 0), (0, 2), (2, 1)):
            setup, = results.load([measured, paths[first], paths[second]])
            for column in ("real_time", "items_per_second"):
                self.assertEqual(list(setup.simulated[column]), list(alone[first].simulated[column]))
            self.assertIn(f"answers for more cores are those of machine{first}.json", setup.remarks[-1])
            self.assertIn(f"what machine{second}.json simulated is of another", setup.remarks[-1])
            self.assertEqual(setup.simulated_paths, [paths[first], paths[second]])
        # The one that tells of more cores answers, wherever it stands.
        few = json.loads(paths[0].read_text())
        few["benchmarks"] = [row for row in few["benchmarks"] if row["threads"] == 1]
        setup, = results.load([measured, write_results(self.folder / "few.json", few), paths[1]])
        self.assertEqual(list(setup.simulated["items_per_second"]), list(alone[1].simulated["items_per_second"]))

    def test_rows_of_a_validation_answer_nothing(self):
        measured = self.results(workloads=("miss_driven:cost=1",), threads=(1, 8))
        paths = [write_results(self.folder / f"{name}.json", model_simulated((1, top), 8, several, workloads=(
            "miss_driven:cost=1",))) for name, top, several in (("simulated", 256, ()), ("validation", 8, (1, 8)))]
        setup, = results.load([measured, *paths])
        self.assertEqual(len(setup.simulated), len(json.loads(paths[0].read_text())["benchmarks"]))
        self.assertEqual(set(setup.simulated["threads"]), {1, 256})
        self.assertEqual(setup.simulated_paths, paths)

    def test_tails_are_those_of_more_threads_than_processing_units(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:2], threads=(1, 8, 32), errors=False)
        for row in data["benchmarks"]:
            slow = {"packed_global_mutex": 40, "packed_wait_free": 2}.get(row["cache"], 10)
            row["latency_query_p999_ns"] = 1000 * slow if row["threads"] == 32 else 1
        setup, = results.load([write_results(self.folder / "r.json", data)])
        threads, known = choice.tails(setup)
        self.assertEqual(threads, 32)
        self.assertAlmostEqual(known["packed_global_mutex"], 40000)
        self.assertAlmostEqual(known["packed_wait_free"], 2000)
        setup, = results.load([self.results(threads=(1, 8))])
        self.assertEqual(choice.tails(setup), (0, {}))

    def test_without_costs_there_is_no_answer_and_a_reason(self):
        setup = results.load([self.results(workloads=("read_only",))])[0]
        self.assertIn("cannot be said: neither a rendered scene", choice_page.section(setup, ""))

    def test_the_page_carries_every_answer_as_data(self):
        made, mechanisms, setup = self.chosen(errors=True, repetitions=3)
        data = choice_page.collected(setup, made)
        json.dumps(data, allow_nan=False)
        for at, x in enumerate(made.x):
            for threads in made.threads:
                found = choice.answer(made, mechanisms, x, threads, made.accuracies[0])
                key = f"{at} {threads}" + (f" {made.accuracies[0]:g}" if found.rendered else "")
                _, sure, way, _, rendered, lines = data["answers"][key]
                self.assertEqual(data["sures"][sure], choice_page.how_sure(found))
                self.assertEqual(data["ways"][way], found.how)
                self.assertEqual(data["caches"][lines[0][1]], found.lines[0].cache)
                self.assertEqual(rendered, found.rendered)

    def test_every_mechanism_has_a_kind(self):
        kinds = {m: choice.kind_of(m) for m in ("global_mutex", "global_spin", "queuing_mutex", "shared_mutex",
                                                "spin_rw_mutex", "distributed_rw", "node_lock", "local_write",
                                                "wait_free", "wait_free_snapshot", "none", "something_new")}
        self.assertEqual(set(list(kinds.values())[:3]), {"one lock"})
        self.assertEqual(set(list(kinds.values())[3:6]), {"readers-writer lock"})
        self.assertEqual(list(kinds.values())[6:], ["a lock in every node", "local write", "wait-free",
                                                    "wait-free with snapshot queries", "no synchronisation",
                                                    "something new"])


if __name__ == "__main__":
    unittest.main()
