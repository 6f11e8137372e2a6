#!/usr/bin/python3
"""Tests of what the report says of several runs, and of what a reader can choose in it."""
from __future__ import annotations

import json
import math
import unittest

import numpy as np
import pandas as pd

from plots_models import kFewWorkloads, few_caches, model_results
from plots_support import InFolder, run, write_results

import comparison
import comparison_page
import explorer
import interactive
import machine_differences
import machine_throughput
import results
import style


class Comparison(InFolder):
    """Two runs whose caches differ by known factors."""
    kFactors = {"packed_wait_free": 1.1, "packed_global_mutex": 0.8}

    def file(self, name: str, changed: bool = False, **options):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:2], threads=(1, 2, 8), errors=False,
                             repetitions=9, **options)
        random = np.random.default_rng(8 if changed else 9)
        for row in data["benchmarks"]:
            factor = self.kFactors.get(row["cache"], 1.0) if changed else 1.0
            row["items_per_second"] *= factor * math.exp(random.normal(0, 0.01))
            row["queries"] = row["items_per_second"] * row["real_time"] * 1e-3
            row["time_unit"] = "ms"
        return write_results(self.folder / name / "results.json", data)

    def compared(self, **second) -> comparison.Comparison:
        setups = results.load([self.file("a"), self.file("b", True, **{"commit": "fedcba9876543210"} | second)])
        found = comparison.comparisons(setups)
        self.assertEqual(len(found), 1)
        return found[0]

    def test_known_factors_are_found_whether_paired_or_not(self):
        for seed in (42, 43):
            one = self.compared(seed=seed)
            self.assertEqual((one.one_machine, one.paired), (True, seed == 42))
            table = one.overall[one.overall["metric"] == "items_per_second"].set_index(["cache", "threads"])
            for (cache, threads), line in table.iterrows():
                truth = self.kFactors.get(cache, 1.0)
                self.assertAlmostEqual(line["ratio"], truth, delta=0.03 * truth)
                self.assertTrue(line["low"] - 0.015 <= truth <= line["high"] + 0.015, (cache, threads))
                if cache in self.kFactors:
                    self.assertEqual(line["verdict"], "better" if truth > 1 else "worse")

    def test_the_same_rows_differ_in_nothing(self):
        again = json.loads(self.file("a").read_text())
        again["context"]["commit"] = "fedcba9876543210"
        setups = results.load([self.folder / "a/results.json", write_results(self.folder / "c.json", again)])
        one = comparison.comparisons(setups)[0]
        self.assertTrue((one.cells["ratio"] == 1).all())
        self.assertTrue((one.cells["verdict"] == "undecided").all())

    def test_runs_of_one_program_differ_by_chance_no_more_often_than_intervals_say(self):
        random = np.random.default_rng(7)

        def made() -> pd.DataFrame:
            return pd.DataFrame([{"cache": cache, "panel": f"panel {panel}", "threads": threads,
                                  "repetition_index": repetition, "run": 0, "take": 0,
                                  "rate": math.exp(random.normal(0, 0.05))}
                                 for cache in ("a", "b") for panel in range(4) for threads in range(1, 101)
                                 for repetition in range(7)])
        for paired in (True, False):
            lines, draws = comparison._of_metric(made(), made(), "rate", paired)
            for some in (lines, comparison._overall(lines, draws, "rate")):
                decided = np.mean([not line["low"] <= 1 <= line["high"] for line in some])
                self.assertLess(decided, 0.06, (paired, len(some)))

    def of_few_repetitions(self, repetitions: int) -> comparison.Comparison:
        """A second run twice as fast as the first, of few repetitions."""
        paths = []
        for commit in ("0" * 16, "1" * 16):
            data = json.loads(self.file("a").read_text())
            data["context"]["commit"] = commit
            data["benchmarks"] = [r for r in data["benchmarks"] if r["repetition_index"] < repetitions]
            for row in data["benchmarks"]:
                row["items_per_second"] *= 2 if commit[0] == "1" else 1
                row["queries"] *= 2 if commit[0] == "1" else 1
            paths.append(write_results(self.folder / f"{commit}.json", data))
        one = comparison.comparisons(results.load(paths))[0]
        self.assertTrue((one.cells["ratio"] > 0).all())
        return one

    def test_all_repetitions_of_pooled_files_count(self):
        paths = []
        for commit, part in ("0", (0, 2)), ("0", (3, 5)), ("1", (0, 2)), ("1", (3, 5)):
            data = json.loads(self.file("a").read_text())
            data["context"]["commit"] = 16 * commit
            data["benchmarks"] = [row for row in data["benchmarks"] if part[0] <= row["repetition_index"] <= part[1]]
            for row in data["benchmarks"]:
                row["repetition_index"] -= part[0]
                row["queries"] *= 1 + int(commit)
                row["items_per_second"] *= 1 + int(commit)
            paths.append(write_results(self.folder / f"{commit}{part[0]}.json", data))
        cells = comparison.comparisons(results.load(paths))[0].cells
        cells = cells[cells["metric"] == "items_per_second"]
        self.assertEqual(set(cells["n"]), {6})
        for ratio in cells["ratio"]:  # of pairs of the same rows
            self.assertAlmostEqual(ratio, 2.0)
        self.assertEqual(set(cells["verdict"]), {"better"})

    def test_fewer_than_six_repetitions_decide_nothing(self):
        for repetitions in (2, 3, 5):
            one = self.of_few_repetitions(repetitions)
            for table in (one.cells, one.overall):
                self.assertTrue((table["verdict"] == "undecided").all())
                self.assertEqual(table["low"].isna().all(), repetitions < 3)
            self.assertIn("fewer than 6 repetitions, too few for a verdict", comparison_page.section(one, ""))
        faster = self.of_few_repetitions(6).cells
        self.assertTrue((faster.loc[faster["metric"] == "items_per_second", "verdict"] == "better").all())

    def test_a_repetition_is_not_left_out_for_what_it_counted(self):
        # Of counts around 0 those above are no sample: the second of these has fewer.
        def made(counts) -> pd.DataFrame:
            return pd.DataFrame([{"cache": "a", "panel": panel, "threads": 2, "repetition_index": i, "run": 0,
                                  "take": 0, "redundant_records": count + shift}
                                 for panel, shift in (("around none", 0), ("some", 100))
                                 for i, count in enumerate(counts)])
        first, second = made((-9, -8, -6, -5, 1, 2, 3)), made((-40, -30, -25, -20, -15, 4, 9))
        for paired in (True, False):
            line, = comparison._of_metric(first, second, "redundant_records", paired)[0]
            self.assertEqual((line["panel"], line["first"], line["second"]), ("some", 95, 80))

    def test_machines_are_told_apart(self):
        paths = [self.file("a"), self.file("b", True, commit="fedcba9876543210"), self.file("c", host_name="other"),
                 self.file("d", host_name="other", commit="fedcba9876543210")]
        found = comparison.comparisons(results.load(paths))
        self.assertEqual([(one.label, one.one_machine) for one in found],
                         [("model: commit fedcba987654 over commit 0123456789ab", True),
                          ("other: commit fedcba987654 over commit 0123456789ab", True),
                          ("other over model", False)])
        self.assertIn(("host_name", "model", "other"), found[2].differing)
        self.assertIn("Two machines", comparison_page.section(found[2], ""))

    def test_a_change_on_several_machines_has_a_panel_a_machine_and_no_mean_over_them(self):
        paths = [self.file("a"), self.file("b", True, commit="fedcba9876543210"),
                 self.file("c", host_name="other", cores=2), self.file("d", host_name="other", cores=2,
                                                                       commit="fedcba9876543210")]
        setups = results.load(paths)
        found = comparison.comparisons(setups)
        change, = comparison.same_changes(found)
        self.assertEqual(change.label, "commit fedcba987654 over commit 0123456789ab on 2 machines")
        built = machine_differences.build(change)
        self.assertEqual([[panel.title for panel in plate.panels] for plate in built.plates],
                         [["model, 8 threads", "other, 2 threads"]] * 3)
        first, second = (one.cells[one.cells["metric"] == "items_per_second"] for one in change.parts)
        for name, cells in (("model", first), ("other", second)):
            mine = built.table[built.table["machine"] == name]
            self.assertEqual(list(mine["ratio"]), list(cells["ratio"]))
        # The dots of a panel are those of its machine alone.
        for panel, one in zip(built.plates[0].panels, change.parts):
            axes = style.matplotlib.figure.Figure().add_axes([0, 0, 1, 1])
            panel.draw(axes, style.kReport)
            threads = comparison.full_threads(one)
            known = one.overall[(one.overall["metric"] == "items_per_second") & (one.overall["threads"] == threads)]
            dots = [line.get_xdata()[0] for line in axes.lines if line.get_marker() == "o"]
            self.assertEqual(sorted(dots), sorted(known["ratio"]))
        # Another change on the second machine is no change of both.
        other = self.file("e", host_name="other", commit="1" * 16)
        self.assertEqual(comparison.same_changes(comparison.comparisons(results.load([*paths[:3], other]))), [])
        alone = run("machine_differences.py", *paths[:2])
        self.assertEqual((alone.returncode, alone.stderr.count("\n")), (2, 1))

    def test_a_version_on_several_machines_has_a_panel_a_machine(self):
        paths = [self.file("a"), self.file("b", commit="fedcba9876543210"), self.file("c", host_name="other"),
                 self.file("d", host_name="other", compiler="another"), self.file("e", host_name="third", commit=None)]
        version, = comparison.one_versions(results.load(paths))
        self.assertEqual(version.label, "commit 0123456789ab on 2 machines")
        built = machine_throughput.build(version)
        names = ["model", "other, compiler GNU 12.2.0", "other, compiler another"]
        self.assertEqual([[panel.title for panel in plate.panels] for plate in built.plates], [names] * 2)
        self.assertIn("the builds of this version differ in compiler", built.notes)
        for name, setup in zip(names, version.setups):
            medians = setup.rows.groupby(["panel", "cache", "threads"])["items_per_second"].median()
            mine = built.table[built.table["machine"] == name].set_index(["panel", "cache", "threads"])["median"]
            self.assertEqual(mine.to_dict(), medians.to_dict())
        alone = run("machine_throughput.py", *paths[:2])
        self.assertEqual((alone.returncode, alone.stderr.count("\n")), (2, 1))

    def test_cells_of_one_run_alone_are_counted(self):
        data = json.loads(self.file("b", True, commit="fedcba9876543210").read_text())
        data["benchmarks"] = [r for r in data["benchmarks"] if r["threads"] != 2]
        setups = results.load([self.file("a"), write_results(self.folder / "b.json", data)])
        one = comparison.comparisons(setups)[0]
        self.assertEqual(one.alone, (8, 0))  # four caches that many threads may use, two workloads
        self.assertIn("8 cells were measured by the first run alone, 0 by", comparison_page.section(one, ""))

    def test_placements_are_not_compared_with_one_another(self):
        def placed(name, commit, *placements):
            data = json.loads(self.file(name, commit=commit).read_text())
            data["benchmarks"] = [row | {"placement": p} for p in placements for row in data["benchmarks"]]
            return write_results(self.folder / f"{name}.json", data)

        compact, scatter = placed("a", "a" * 40, "compact"), placed("b", "b" * 40, "scatter")
        one, = comparison.comparisons(results.load([compact, scatter]))
        self.assertTrue(one.cells.empty)
        self.assertIn("cells were measured by the first run alone", comparison_page.section(one, ""))
        # Nor is what both measured missed where one measured another as well.
        both = placed("c", "c" * 40, "compact", "scatter")
        one, = comparison.comparisons(results.load([compact, both]))
        self.assertTrue(one.cells["panel"].str.endswith(", compact").all())
        self.assertEqual(one.alone[0], 0)
        alike = comparison.comparisons(results.load([compact, placed("d", "d" * 40, "compact")]))[0]
        self.assertFalse(alike.cells["panel"].str.contains("compact").any())

    def test_the_page_names_the_largest_differences(self):
        page = comparison_page.section(self.compared(), "")
        self.assertIn("chance alone would make about", page)
        self.assertRegex(page, r"<td>packed_global_mutex</td>.*?class=\"n bad\">0\.[78]")
        self.assertRegex(page, r"<td>packed_wait_free</td>.*?class=\"n good\">1\.[01]")
        self.assertIn("<td>commit</td>", page)

    def test_relmse_is_named_as_it_is_everywhere(self):
        cells = pd.DataFrame([{"verdict": "undecided", "low": 0.9, "n": 9}])
        for some in (cells, cells.assign(n=2)):
            self.assertRegex(comparison_page._sentence(some, "relmse"), r"^<p>(<b>)?relMSE")

    def test_the_figure_needs_two_runs(self):
        alone = run("run_differences.py", self.file("a"))
        self.assertEqual((alone.returncode, alone.stderr.count("\n")), (2, 1))
        self.assertIn("one machine and build; a comparison needs two", alone.stderr)
        self.good("run_differences.py", self.file("a"), self.file("b", True, commit="fedcba9876543210"), "--out",
                  self.folder / "out")
        self.assertTrue((self.folder / "out/run_differences.pdf").exists())


class Interactive(InFolder):
    def test_data_cannot_end_their_element(self):
        made = interactive.data("d", {"<b>": "</script><!-- & -->"})
        self.assertEqual(made.count("<"), 2)
        inner = made[made.index(">") + 1:made.rindex("<")]
        self.assertEqual(json.loads(inner), {"<b>": "</script><!-- & -->"})

    def test_the_explorer_has_every_median(self):
        setup = results.load([self.results()])[0]
        made = explorer.collected(setup)
        cells, throughput = made["cells"], made["metrics"][0]
        self.assertEqual(len(cells["p"]), len(setup.rows.drop_duplicates(["panel", "cache", "threads"])))
        medians = setup.rows.groupby(["panel", "cache", "threads"])["items_per_second"].median()
        for p, c, t, m in zip(cells["p"], cells["c"], cells["t"], throughput["m"]):
            expected = medians[made["panels"][p], made["caches"][c]["name"], t] * 1e-6
            self.assertAlmostEqual(m, expected, delta=1e-3 * expected)
        self.assertEqual(made["families"]["cost"], [["miss driven", [[1, 1], [64, 2]]]])

    def test_without_the_library_the_page_says_so(self):
        setup = results.load([self.results()])[0]
        known, interactive.kLibraries = interactive.kLibraries, ("/nowhere/chart.min.js",)
        try:
            self.assertIn("libjs-chart.js is not installed", explorer.section(setup, ""))
            scripts = interactive.scripts()
        finally:
            interactive.kLibraries = known
        self.assertIn("icbench-choice", scripts)
        self.assertNotIn("icbench-explorer", scripts)


if __name__ == "__main__":
    unittest.main()
