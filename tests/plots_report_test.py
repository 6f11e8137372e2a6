#!/usr/bin/python3
"""Tests of the report: its pages, the page on correctness, the main job around it, and what it finds."""
from __future__ import annotations

import base64
import json
import math
import os
import re
import shutil
import subprocess
import sys
import unittest
from pathlib import Path

import matplotlib.image
import numpy as np

from plots_support import (kContext, kCycle, kFewWorkloads, kPlots, kRoot, InFolder, References,
                           few_caches, model_anatomy, model_caches, model_pareto, model_preempt, model_repeatability,
                           model_results, model_simulated, model_timeline, model_verdicts, read_csv, run, write_results)

import anatomy_page
import anatomy_results
import breakdown_page
import cautions
import correctness
import correctness_page
import findings
import pareto_choice
import pareto_page
import pareto_results
import repeatability_page
import repeatability_results
import report
import results
import style
from figures import CORRECTNESS_FIGURES, FIGURES


class Report(InFolder):
    def page(self, *paths) -> str:
        self.good("report.py", *paths, "--out", self.folder / "out")
        return (self.folder / "out/report.html").read_text(encoding="utf-8")

    def test_the_page_needs_nothing_but_itself(self):
        images = self.folder / "images"
        images.mkdir()
        matplotlib.image.imsave(images / "room.png", np.zeros((4, 4)))
        (images / "room.json").write_text('{"scene": "cornell_box", "cache": "wait_free", "seconds": 0.25}')
        (images / "broken.png").write_text("no picture")
        page = self.page(self.results(errors=True, caches=few_caches(("ward", "packed"))))
        references = References(page)
        self.assertTrue(references.found)
        for reference in references.found:
            self.assertTrue(reference.startswith(("data:", "#")), reference[:80])
        self.assertFalse(references.tags & {"iframe", "link", "object", "embed"})
        self.assertIn("default-src 'none'; img-src data:;", page)
        self.assertNotRegex(page, r"@import|url\(\s*['\"]?(?!#)")
        drawings = re.findall(r"data:image/svg\+xml;base64,([A-Za-z0-9+/=]+)", page)
        self.assertGreaterEqual(len(drawings), len(FIGURES))
        for drawing in drawings:
            content = base64.b64decode(drawing).decode()
            self.assertEqual(re.findall(r'(?<!xmlns=")(?<!xmlns:xlink=")https?://[^"]*', content), [])
        self.assertIn("data:image/png;base64,", page)
        self.assertIn("cornell box, cache wait_free, 250 ms", page)
        self.assertIn("broken.png is not a picture", page)

    def test_machines_have_parts_of_their_own_and_so_has_what_was_simulated(self):
        imagined = model_simulated((1, 256), 8, measured=(256,), workloads=kFewWorkloads[1:2],
                                   caches=few_caches()[1:3])
        page = self.page(self.results("a.json"), self.results("b.json", host_name="other", complete=False),
                         write_results(self.folder / "s.json", imagined))
        self.simulated(page)
        for target in re.findall(r'href="#([^"]+)"', page):
            self.assertEqual(page.count(f'id="{target}"'), 1, target)
        self.assertIn("nothing is merged", page)
        self.assertIn('class="banner">Incomplete results (other)', page)
        self.assertIn("<code>figures/other/throughput.pdf</code>", page)
        self.assertIn("One version on each machine: commit 0123456789ab on 2 machines</h3>", page)
        self.assertIn("<code>figures/version-1/machine_throughput.pdf</code>", page)

    def simulated(self, page: str):
        """One machine alone has the part, and no figure of measurements has its rows."""
        self.assertEqual(re.findall(r'<h2 [^>]*id="([^"]*more-cores)"', page), ["model-more-cores"])
        part = page[page.index('id="model-more-cores"'):page.index('id="model-tables"')]
        for words in ("From <code>s.json</code>, up to 256 virtual cores",
                      "<b>validated to 8 threads on this machine</b>",
                      "<code>costs/calibration.json</code> (measured on model, 2025-01-02)",
                      "<code>figures/model/simulated.pdf</code>"):
            self.assertIn(words, part)
        drawings = re.findall(r'<img [^>]*src="([^"]{,30})[^>]*alt="([^"]*)"', part)
        self.assertGreaterEqual(len(drawings), 3)
        for source, title in drawings:
            self.assertTrue(source.startswith("data:image/svg+xml;base64,"), source)
            self.assertIn("simulated, validated to 8 threads on this machine", title)
        lines = re.findall(r"<tr><td>(\w+)</td><td>miss driven, 1 µs a record</td>"
                           r'<td class="n">256</td>(?:<td class="n">[\d.,]+</td>){2}<td class="n">21.0</td></tr>', part)
        self.assertEqual(sorted(lines), ["packed_global_mutex", "packed_shared_mutex"])
        self.assertIn("by 21.0 % in the median of 2 points, and by 21.0 % at most", part)
        for table in (self.folder / "out/figures").rglob("*.csv"):
            counts = {line.get("threads") for line in read_csv(table)}
            self.assertEqual("256" in counts, table.name == "simulated.csv", table)

    def test_incomplete_results_stand_out(self):
        self.assertIn('class="banner">Incomplete', self.page(self.small(complete=False)))
        self.assertNotIn('class="banner"', self.page(self.small(complete=True)))

    def test_omitted_figures_are_named_with_the_reason(self):
        page = self.page(self.results(threads=(2,), workloads=("read_only",)))
        for line in ("Speed-up: left out, only one thread count",
                     "Speed against error: left out, no row has both",
                     "where wait-free access pays: left out, no miss_driven rows"):
            self.assertIn(line, page)
        self.assertNotIn('id="speedup"', page)

    def test_the_environment_and_the_command_are_shown(self):
        page = self.page(self.small(odd_key="<i>odd</i>"))
        self.assertIn("icbench sweep --threads 1,2,4 --out results.json", page)
        for key in set(kContext) - {"command_line"}:
            self.assertIn(f"<td>{key}</td>", page)
        self.assertIn("&lt;i&gt;odd&lt;/i&gt;", page)
        self.assertNotIn("<i>odd", page)

    def test_the_page_carries_the_medians(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:1], threads=(1, 8), errors=False)
        for row in data["benchmarks"]:
            row["items_per_second"] = 123.4e6 if row["cache"] == "packed_wait_free" else 61.7e6
        page = self.page(write_results(self.folder / "results.json", data))
        self.assertIn("<td>packed_wait_free</td><td class=\"n\">123 <small>[123, 123]</small></td>", page)
        self.assertIn('<div class="value">2.00× <span>[2.00, 2.00]</span></div>', page)

    def test_no_headline_without_a_comparison(self):
        caches = model_caches(("packed",), ("wait_free",), ())
        page = self.page(self.results(caches=caches, workloads=("read_only",)))
        self.assertIn("there is no headline", page)


class Pareto(InFolder):
    """What icbench pareto measured, as a part of the report."""

    def page(self, data: dict) -> str:
        path = write_results(self.folder / "pareto.json", data)
        return pareto_page.section(pareto_results.load([path])[0], "pareto", "")

    def test_files_beside_the_results_are_found_and_their_part_is_linked(self):
        small = self.small()
        write_results(self.folder / "pareto.json", model_pareto())
        self.good("report.py", small, "--out", self.folder / "out")
        page = (self.folder / "out/report.html").read_text(encoding="utf-8")
        self.assertEqual(page.count('id="pareto"'), 1)
        self.assertIn('<a href="#pareto">', page)
        self.assertIn("<code>figures/pareto.pdf</code>", page)
        for target in re.findall(r'href="#([^"]+)"', page):
            self.assertEqual(page.count(f'id="{target}"'), 1, target)
        (self.folder / "pareto.json").rename(self.folder / "pareto.previous.json")
        self.assertEqual(report._beside([small], report.kPareto), [])

    def test_a_budget_buys_the_least_error_that_it_can_pay(self):
        table = pareto_results.points(pareto_results.load(
            [write_results(self.folder / "pareto.json", model_pareto())])[0])
        part = table[table["scene"] == "cornell_box"]
        for budget in pareto_page.budgets(part):
            best = pareto_page.best_within(part, budget)
            affordable = part[part["seconds"] <= budget]
            self.assertEqual(best["relmse"], affordable["relmse"].min())
        self.assertIsNone(pareto_page.best_within(part, part["seconds"].min() / 2))

    def test_the_page_says_what_to_use(self):
        data = model_pareto(scenes=("cornell_box",), methods={"path": [(0.1, 0.5), (1.0, 0.05)],
                                                              "hash_cells": [(0.2, 0.02)]}, noise=0.0)
        page = self.page(data)
        self.assertIn("use hash cells (setting 0): relMSE 0.0200, where path tracing has 0.500 by then", page)
        self.assertIn("Bias is what 3 independent runs have in common", page)

    def several(self) -> dict[str, dict]:
        """Files of two scenes: in one a method of much spread, in the other nothing that is quick."""
        rooms = {"path": [(0.03, 0.6), (0.2, 0.1), (2.0, 0.02)], "hash_cells": [(0.05, 0.04), (0.5, 0.03)],
                 "instant_gi": [(0.06, 0.041), (0.6, 0.01)]}
        halls = {"path": [(0.4, 0.5), (4.0, 0.1)], "hash_cells": [(0.7, 0.02)]}
        return {"desk": model_pareto(scenes=("desk",), methods=rooms),
                "sibenik": model_pareto(scenes=("sibenik",), methods=halls)}

    def part(self, data: dict):
        path = write_results(self.folder / "part.json", data)
        return pareto_results.points(pareto_results.load([path])[0])

    def test_several_files_make_one_table_of_scenes_and_budgets_by_every_error(self):
        paths = [write_results(self.folder / f"pareto_{scene}.json", data) for scene, data in self.several().items()]
        found = pareto_results.load(paths)
        self.assertEqual(len(found), 1)
        page = pareto_page.section(found[0], "pareto", "<figure>")
        self.assertLess(page.index('class="budget"'), page.index("<figure>"))
        tables = re.findall(r'<div class="by" data-error="(\w+)"><h3>([^<]+)</h3>.*?<tbody>(.*?)</tbody>', page, re.S)
        self.assertEqual([error for error, _, _ in tables], ["relmse", "rmse", "flip", "hdrvdp_p75"])
        points = pareto_results.points(found[0])
        times = pareto_choice.budgets(points["seconds"])
        self.assertEqual(times, [0.03, 0.1, 0.3, 1, 3, 10] if points["seconds"].min() <= 0.03 else [0.1, 0.3, 1, 3, 10])
        for error, heading, body in tables:
            self.assertTrue(heading.startswith("If you have x seconds"))
            lines = re.findall(r"<tr>(.*?)</tr>", body, re.S)
            self.assertEqual(len(lines), 2)
            for line, (scene, part) in zip(lines, points.groupby("scene")):
                self.assertIn(f"<b>{scene}</b>", line)
                cells = [cell for span, cell in re.findall(r'<td(?: colspan="(\d+)")?>(.*?)</td>', line, re.S)
                         for _ in range(int(span or 1))]
                self.assertEqual(len(cells), len(times))
                for time, cell in zip(times, cells):
                    fast = part[part["seconds"] <= time]
                    if fast.empty:
                        self.assertEqual(cell, "–")
                        continue
                    least = fast.loc[fast[error].idxmin()]
                    self.assertIn(f"<b>{least['method'].replace('_', ' ')}</b>", cell)
                    self.assertIn(style.number(least[error]), cell)
                    self.assertIn(f"[{style.number(least[error + '_low'])}, ", cell)

    def test_what_the_runs_do_not_tell_apart_is_named_and_nothing_else(self):
        one = {"path": [(0.1, 0.1)], "hash_cells": [(0.1, 0.0999)], "instant_gi": [(0.1, 0.5)],
               "late": [(3.0, 0.0999)]}
        data = model_pareto(scenes=("desk",), methods=one, noise=0.0)
        for row in data["benchmarks"]:
            row["relmse"] *= 1 + 0.01 * (row["repetition_index"] - 1)  # runs 1 % apart: more than the two differ
        found = pareto_choice.answer(self.part(data), 1.0, "relmse")
        self.assertEqual(found.best["method"], "hash_cells")
        self.assertEqual(list(found.tied["method"]), ["path"])
        self.assertIn("≈ path</span>", self.page(data))
        for row in data["benchmarks"]:
            row["relmse"] *= 0.95 if row["method"] == "hash_cells" else 1
        self.assertTrue(pareto_choice.answer(self.part(data), 1.0, "relmse").tied.empty)

    def test_two_runs_have_a_spread_and_one_has_none(self):
        one = {"path": [(0.1, 0.1)], "hash_cells": [(0.1, 0.1)]}
        two = self.part(model_pareto(scenes=("desk",), methods=one, repetitions=2)).iloc[0]
        self.assertTrue(two["relmse_from"] < two["relmse"] < two["relmse_to"])
        single = self.part(model_pareto(scenes=("desk",), methods=one, repetitions=1))
        self.assertTrue(single["relmse_from"].isna().all())
        self.assertTrue(pareto_choice.answer(single, 1.0, "relmse").tied.empty)
        self.assertIn("ran once, so that nobody knows", self.page(model_pareto(methods=one, repetitions=1)))

    def test_of_equal_errors_the_fastest_is_named(self):
        equal = {"path": [(0.9, 0.1), (0.2, 0.1), (0.5, 0.1)]}
        part = self.part(model_pareto(scenes=("desk",), methods=equal, noise=0.0))
        self.assertEqual(pareto_choice.answer(part, 1.0, "relmse").best["seconds"], 0.2)
        self.assertIsNone(pareto_choice.answer(part, 0.1, "relmse"))

    def test_the_page_says_whether_relmse_depends_on_brightness(self):
        self.assertIn("both pictures are scaled by 1 / mean luminance", self.page(model_pareto()))
        old = model_pareto()
        for row in old["benchmarks"]:
            del row["relmse_scale"]
        self.assertIn("Some file has the relMSE of pictures as bright as they are", self.page(old))

    def test_a_file_that_cannot_be_read_costs_no_other_scene(self):
        small, out = self.small(), self.folder / "out"
        for scene, data in self.several().items():
            write_results(self.folder / f"pareto_{scene}.json", data)
        (self.folder / "pareto_office.json").write_text('{"context": {}, "benchmarks": []}')
        done = run("report.py", small, "--out", out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stderr, r"^report\.py: left out: [^\n]+pareto_office\.json: no rows[^\n]+\n$")
        page = (out / "report.html").read_text(encoding="utf-8")
        self.assertIn("<b>desk</b>", page)
        self.assertIn("<b>sibenik</b>", page)
        self.assertRegex(page, r"Left out: [^<]+pareto_office\.json")
        named = run("report.py", small, "--pareto", self.folder / "pareto_office.json", "--out", out)
        self.assertEqual(named.returncode, 2)

    def test_pictures_stand_side_by_side_with_their_errors(self):
        data = model_pareto(scenes=("cornell_box",))
        data["context"]["images"] = "shots"
        shots = self.folder / "shots"
        shots.mkdir()
        for name in ("reference", "a", "a_error"):
            matplotlib.image.imsave(shots / f"{name}.png", np.zeros((4, 4)))
        entry = {"method": "path", "setting": "spp:16", "seconds": 0.5, "relmse": 0.1, "flip": 0.25,
                 "image": "a.png", "map": "a_error.png"}
        (shots / "images.json").write_text(json.dumps(
            {"scene": "cornell_box", "exposure": 1, "reference": "reference.png",
             "budgets": [{"spp": 16, "seconds": 0.5, "pictures": [entry, {"method": "hash_cells"}]}]}))
        page = self.page(data)
        self.assertEqual(page.count("data:image/png;base64,"), 3)
        self.assertIn("16 spp; 500 ms, FLIP 0.250", page)
        self.assertIn("<b>hash cells</b>: no setting is that fast", page)

    def test_an_incomplete_run_stands_out(self):
        page = self.page(model_pareto(complete=False))
        self.assertRegex(page, r"Incomplete: this part [^<]+\(pareto\.json\)")

    def test_every_wrong_file_is_one_line_and_status_2(self):
        no_time = model_pareto()
        for row in no_time["benchmarks"]:
            del row["seconds_indirect"]
        for text in ("no json", "[]", '{"context": {}, "benchmarks": []}', '{"benchmarks": [{"name": "a"}]}',
                     '{"context": {}, "benchmarks": [{"name": "a"}]}', json.dumps(no_time)):
            (self.folder / "wrong.json").write_text(text)
            with self.assertRaisesRegex(results.InputError, r"^[^\n]+wrong\.json[^\n]+$"):
                pareto_results.load([self.folder / "wrong.json"])
        done = run("pareto.py", self.folder / "wrong.json", "--out", self.folder / "out")
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertRegex(done.stderr, r"^[^\n]+wrong\.json[^\n]+\n$")


class Repeatability(InFolder):
    """What icbench repeatability measured, as a part of the report."""

    def page(self, data: dict) -> str:
        path = write_results(self.folder / "repeatability.json", data)
        return repeatability_page.section(repeatability_results.load([path])[0], "repeatability", "")

    def test_files_beside_the_results_are_found_and_their_part_is_linked(self):
        small = self.small()
        write_results(self.folder / "repeatability.json", model_repeatability())
        write_results(self.folder / "repeatability.previous.json", model_repeatability("desk"))
        self.good("report.py", small, "--out", self.folder / "out")
        page = (self.folder / "out/report.html").read_text(encoding="utf-8")
        self.assertIn('<a href="#repeatability">', page)
        self.assertIn("<code>figures/repeatability.pdf</code>", page)
        self.assertNotIn("Desk, irradiance cache", page)
        for target in re.findall(r'href="#([^"]+)"', page):
            self.assertEqual(page.count(f'id="{target}"'), 1, target)

    def test_the_page_says_how_far_and_beside_what(self):
        page = self.page(model_repeatability())
        self.assertIn("Cornell box, irradiance cache: with 8 threads a picture differs from that of one thread by "
                      "0.440 to 0.880 % of its mean, at most 22.0 % of its own error (global mutex).", page)
        self.assertIn("serves one thread", page)
        self.assertIn("0.0200 W/(m² sr) or 4.00 % of it", page)
        self.assertIn("the reference&#x27;s own, already taken off, is 0.00200", page)

    def test_a_reference_that_errs_more_than_the_pictures_is_told(self):
        data = model_repeatability()
        self.assertNotIn("are rough", self.page(data))
        for row in data["benchmarks"]:
            row["reference_rmse"] = 0.03
        self.assertIn("which is more, so that shares of the error are rough", self.page(data))

    def test_where_threads_change_nothing_the_page_says_so(self):
        self.assertIn("with 8 threads no picture differs", self.page(model_repeatability(differences={"null": 0.0})))

    def test_one_thread_alone_says_so(self):
        page = self.page(model_repeatability(differences={"sequential": None}))
        self.assertIn("measured with one thread only", page)

    def test_an_incomplete_run_stands_out(self):
        self.assertIn("Incomplete: this part", self.page(model_repeatability(complete=False)))

    def test_every_wrong_file_is_one_line_and_status_2(self):
        no_mean = model_repeatability()
        for row in no_mean["benchmarks"]:
            del row["mean"]
        for text in ("no json", "[]", '{"context": {}, "benchmarks": []}', json.dumps(no_mean)):
            (self.folder / "wrong.json").write_text(text)
            with self.assertRaisesRegex(results.InputError, r"^[^\n]+wrong\.json[^\n]+$"):
                repeatability_results.load([self.folder / "wrong.json"])


class Correctness(InFolder):
    def verdicts(self, name="correctness.json", **sections) -> Path:
        return write_results(self.folder / name, model_verdicts(**sections))

    def changed(self, section: str, which: dict, **change) -> Path:
        """Verdicts with the entries of `section` that agree with `which` changed."""
        data = model_verdicts()
        matching = [e for e in data[section] if which.items() <= e.items()]
        self.assertTrue(matching)
        for entry in matching:
            entry |= change
        return write_results(self.folder / "correctness.json", data)

    def page(self, *arguments) -> str:
        small = self.small()
        self.good("report.py", small, *arguments, "--out", self.folder / "out")
        return (self.folder / "out/report.html").read_text(encoding="utf-8")

    def section(self) -> str:
        """The page's section without its figures."""
        found = correctness.read(self.folder / "correctness.json")
        return correctness_page.section(found, "correctness", {}, [])

    def holds(self, page: str, *parts: str):
        missing = [part for part in parts if part not in page]
        self.assertEqual(missing, [])

    def judge(self, path: Path) -> subprocess.CompletedProcess:
        return run("correctness.py", path)

    def test_a_sound_file_passes_and_fills_every_part(self):
        path = self.verdicts()
        self.assertEqual(self.judge(path).returncode, 0)
        page = self.page()
        self.assertEqual(page.count('class="banner"') + page.count('class="alarm"'), 0)
        self.holds(page, 'id="correctness"', 'id="correctness-promises"', 'id="correctness-witness"',
                   'id="correctness-steps"', '<div class="value">15 of 15</div>',
                   '<div class="value">4,000</div>', "with 1,500 overlapping pairs",
                   '<div class="value">2 of 2</div>', "2 of them by a schedule that can be replayed",
                   "1 scenario: every interleaving; 1 scenario: all interleavings with up to 3 preemptions",
                   "linearizable (not promised, <code>a:1201</code>)",
                   "after 17 schedules, replay <code>b:77</code>", "nothing concurrent was tested: sequential",
                   "which it does not promise, was seen violating it in 7 of 8 rounds",
                   "which it does not promise, was seen violating it after 17 schedules (replay b:77)",
                   '<td class="n">400</td>', "bound: 20 and 4 a level", "37 of 41",
                   "others wait while it holds the lock", "Processors &lt;other&gt; than this one.")
        self.assertEqual(References(page).tags & {"iframe", "link", "object", "embed"}, set())
        for target in re.findall(r'href="#([^"]+)"', page):
            self.assertEqual(page.count(f'id="{target}"'), 1, target)

    def test_schedules_judged_by_several_checks_count_once(self):
        # Three caches, two scenarios each.
        self.verdicts()
        self.holds(self.section(), f'<div class="value">{3 * 5321:,}</div>')

    def test_the_matrix_tells_the_four_states_apart(self):
        path = self.changed("checks", {"cache": "global_mutex", "check": "regular"}, verdict="violated")
        found = correctness.read(path)
        state = {(cell.cache, cell.check): cell.state for cell in found.cells}
        self.assertEqual(state["wait_free", "integrity"], "held")
        self.assertEqual(state["global_mutex", "regular"], "BROKEN")
        self.assertEqual(state["wait_free", "linearizable"], "violated")
        self.assertEqual(state["sequential", "frame"], "not seen")
        self.good("promises.py", path, "--out", self.folder)
        table = {(line["cache"], line["check"]): line for line in read_csv(self.folder / "promises.csv")}
        self.assertEqual({key: line["state"] for key, line in table.items()}, state)
        self.assertEqual(table["wait_free", "linearizable"]["violated_in_schedules"], "True")
        self.assertEqual(float(table["wait_free", "linearizable"]["schedules"]), 5321)

    def test_a_promise_broken_in_a_history_is_an_alarm(self):
        path = self.changed("checks", {"cache": "wait_free_snapshot", "check": "linearizable"},
                            verdict="violated", violations=3, witness="the witness of it")
        done = self.judge(path)
        self.assertEqual(done.returncode, 1)
        self.assertIn("wait_free_snapshot promises linearizable and broke it (histories)", done.stdout)
        page = self.page()
        banner = '<div class="banner">Broken promise: wait_free_snapshot promises linearizable'
        self.assertEqual(page.count(banner), 2)  # at the top, too
        self.holds(page, '<div class="value">14 of 15</div>', "BROKEN: linearizable 3",
                   "<pre>the witness of it</pre>")

    def test_a_promise_broken_in_a_schedule_or_a_step_count_is_an_alarm(self):
        path = self.changed("schedules", {"cache": "wait_free", "check": "regular", "threads": 2},
                            verdict="violated", replay="c:5", witness="lost")
        self.assertIn("wait_free promises regular and broke it (schedules)", self.judge(path).stdout)
        self.holds(self.section(), "BROKEN: regular, <code>c:5</code>", "regular in a schedule, replay c:5")
        path = self.changed("progress", {"cache": "wait_free", "operation": "insert"}, verdict="violated",
                            most_steps=99)
        self.assertEqual(self.judge(path).returncode, 1)
        self.holds(self.section(), "wait_free promises a wait-free insert and broke that", "BROKEN</b>")

    def test_a_stress_that_sees_no_fault_is_too_weak(self):
        path = self.changed("controls", {"control": "wait_free"}, seen=False, rounds_violated=0)
        done = self.judge(path)
        self.assertEqual(done.returncode, 1)
        self.assertIn("too weak: wait_free was not seen violating linearizable in 8 rounds", done.stdout)
        self.holds(self.section(), '<div class="banner">The stress was too weak')
        path = self.changed("explored_controls", {"control": "wait_free"}, caught=False)
        self.assertIn("too weak: wait_free was not seen violating linearizable in 17 schedules",
                      self.judge(path).stdout)
        self.changed("explored_controls", {"control": "relaxed_publication"}, caught=False)
        self.holds(self.section(), "relaxed_publication was caught neither by histories nor by schedules",
                   "NOT CAUGHT")
        path = self.changed("progress_controls", {"control": "in_order"}, seen=False)
        self.assertIn("too weak: in_order was not seen to violate by the check of progress",
                      self.judge(path).stdout)
        self.holds(self.section(), "waits for those before it", "NOT SEEN")

    def test_older_files_lack_sections_and_the_page_says_so(self):
        path = self.verdicts(schedules=None, explored_controls=None, progress=None, not_examined=None)
        self.assertEqual(self.judge(path).returncode, 0)  # what this processor cannot show is excused
        page = self.page()
        self.assertEqual(page.count("was written by an icstress that did not examine it"), 2)
        self.holds(page,
                   "interleavings one by one, broken caches by schedule, step bounds and stopped threads",
                   "The fault of relaxed_publication: this processor does not show it",
                   "does not list what icstress left out", "<td>not examined</td>",
                   "Steps against interference: left out")
        self.assertEqual(page.count('class="banner"'), 0)

    def test_without_verdicts_the_page_says_how_to_get_them(self):
        page = self.page()
        self.assertEqual(page.count('id="correctness"'), 1)
        self.holds(page, "icstress --json")

    def test_verdicts_may_lie_elsewhere_and_be_several(self):
        folder = self.folder / "elsewhere"
        first = write_results(folder / "a.json", model_verdicts())
        second = write_results(folder / "b.json", model_verdicts(progress=None))
        page = self.page("--correctness", first, "--correctness", second, "--correctness", first)
        for anchor in ("correctness", "correctness-2", "correctness-2-promises"):
            self.assertEqual(page.count(f'id="{anchor}"'), 1, anchor)
        self.assertTrue((self.folder / "out/figures/correctness-2/promises.pdf").exists())

    def test_bounds_may_be_words_numbers_or_absent(self):
        self.assertEqual(correctness.bound_of({"bound": "4 a level", "bound_steps": 60}), (60, "4 a level"))
        self.assertEqual(correctness.bound_of({"bound": "", "bound_steps": 0}), (None, ""))
        self.assertEqual(correctness.bound_of({"bound": 60}), (60, ""))
        self.assertEqual(correctness.bound_of({"bound": None}), (None, ""))
        self.good("steps.py", self.verdicts(), "--out", self.folder)
        lines = read_csv(self.folder / "steps.csv")
        self.assertEqual({(line["cache"], line["bound"]) for line in lines if line["operation"] == "insert"},
                         {("sequential", ""), ("global_mutex", ""), ("wait_free", "60"),
                          ("wait_free_snapshot", "60")})
        self.assertEqual(len(lines), 4 * 2 * 5)

    def test_the_witness_is_drawn_from_its_stamps(self):
        path = self.verdicts()
        self.good("witness.py", path, "--out", self.folder)
        lines = read_csv(self.folder / "witness.csv")
        self.assertEqual([(line["thread"], line["call"], line["return"]) for line in lines],
                         [("1", "129", "130"), ("3", "153", "154"), ("0", "117", "204")])
        self.assertEqual([line["reason"] for line in lines],
                         ["returned before the next was called", "was seen by the next",
                          "did not see the first"])
        self.holds(self.section(), "It was seen by operation 3, so it comes before operation 3.",
                   "It did not see operation 1, so it comes before operation 1.")
        pending = correctness.steps_of(kCycle.replace("154]", "never]"))
        self.assertIsNone(pending[1].end)
        self.assertEqual(correctness.steps_of("something else\n  entirely"), [])

    def test_figures_are_one_column_wide_with_truetype_fonts(self):
        path = self.verdicts()
        for figure in CORRECTNESS_FIGURES:
            self.good(f"{figure.name}.py", path, "--out", self.folder)
            pdf = (self.folder / f"{figure.name}.pdf").read_bytes()
            self.assertIn(b"/FontFile2", pdf, figure.name)
            self.assertNotIn(b"/Type3", pdf, figure.name)
            for box in re.findall(rb"/MediaBox \[ ?0 0 ([0-9.]+) ([0-9.]+)", pdf):
                self.assertAlmostEqual(float(box[0]), 3.3 * 72, 1)

    def test_a_wrong_file_is_one_line_and_status_2(self):
        wrong = {"text": "not json", "list": "[]", "nothing": "{}", "controls": '{"checks": []}',
                 "empty": '{"checks": [], "controls": []}',
                 "entry": json.dumps(model_verdicts(checks=[3])),
                 "verdict": json.dumps(model_verdicts(checks=[model_verdicts()["checks"][0]
                                                              | {"verdict": "maybe"}])),
                 "type": json.dumps(model_verdicts(schedules=[{"cache": 1}])),
                 "pairs": json.dumps(model_verdicts(progress=[model_verdicts()["progress"][0]
                                                              | {"steps_by_interference": [[1]]}])),
                 "strings": json.dumps(model_verdicts(not_examined=[1]))}
        for name, content in wrong.items():
            with self.subTest(name):
                path = self.folder / f"{name}.json"
                path.write_text(content)
                with self.assertRaisesRegex(results.InputError, rf"^[^\n]+{name}\.json[^\n]+$"):
                    correctness.read(path)
        path = self.folder / "text.json"
        for script, *arguments in (("correctness.py", path), ("promises.py", path),
                                   ("report.py", self.results(), "--correctness", path)):
            done = run(script, *arguments)
            self.assertEqual((done.returncode, done.stdout), (2, ""))
            self.assertRegex(done.stderr, r"^[^\n]+text\.json[^\n]+\n$")
        self.assertEqual(run("correctness.py", self.folder / "absent.json").returncode, 2)
        self.assertEqual(run("correctness.py").returncode, 2)


class Stopped(InFolder):
    """What happens to others when a thread is held, timelines, and where time goes, as parts of the report."""

    def test_files_beside_the_results_are_taken_up(self):
        path = self.small()
        write_results(self.folder / "preempt.json", model_preempt())
        write_results(self.folder / "timeline.json", model_timeline())
        self.results("breakdown.json", workloads=("miss_driven:cost=4",), threads=(1, 2), repetitions=1)
        self.good("report.py", path)
        page = (self.folder / "report.html").read_text()
        for figure in ("preemption", "timeline", "time_breakdown"):
            self.assertTrue((self.folder / "figures" / f"{figure}.csv").exists(), figure)
        workloads = {line["workload"] for line in read_csv(self.folder / "figures/breakdown/time_breakdown.csv")}
        self.assertEqual(workloads, {"miss_driven:cost=4"})
        self.assertRegex(page, r'<a href="#(breakdown-[^"]+)">Where the time goes</a>(?s:.*)<h2 id="\1">Where the time goes')
        self.assertIn(">When a thread is held</h2>", page)
        self.assertIn(">Timeline: a/b/threads:2</h2>", page)
        # The mutex: half of the others' time, and a longest query of 11 ms; nobody else waits.
        self.assertRegex(page, r'<td>packed_global_mutex</td><td class="n">50[^<]*<small>')
        self.assertRegex(page, r'<td>packed_wait_free</td><td class="n">0 ')

    def breakdown(self, counted: dict, **said) -> str:
        """The part of the page; `counted` by one operation."""
        data = model_results(caches=few_caches()[1:], workloads=kFewWorkloads[1:2], threads=(1, 8, 32), repetitions=3,
                             errors=False, **said)
        for row in data["benchmarks"]:
            row |= {name: each * (1 + row["repetition_index"]) * (row["queries"] + row["inserts"])
                    for name, each in counted.items()}
        setup, = results.load([write_results(self.folder / "breakdown.json", data)])
        return breakdown_page.section(setup, "a", "", False)

    def test_what_the_hardware_counted_stands_beside_the_breakdown(self):
        page = self.breakdown({"cycles": 1500, "line_transfers": 0.5},
                              hardware_counters={"events": ["cycles"], "note": "l1d_misses: not offered"})
        for threads in (1, 8):
            self.assertIn(f'<td>packed_wait_free</td><td class="n">{threads}</td><td class="n">3,000 <small>[1,500, '
                          '4,500]</small></td><td class="n">1.00 <small>[0.500, 1.50]</small></td>', page)
        self.assertNotIn('<td class="n">32</td>', page)
        self.assertEqual(page.count('<th class="n">'), 3)
        self.assertEqual(page.count("L1d_misses: not offered."), 1)

    def test_where_the_hardware_counted_nothing_the_page_says_why(self):
        page = self.breakdown({}, hardware_counters={"events": [], "note": "no hardware counters: no permission"})
        self.assertNotIn("<table", page)
        self.assertEqual(page.count("No hardware counters: no permission."), 1)
        self.assertNotIn("counter", self.breakdown({}))


class Anatomy(InFolder):
    """What anatomy measured, as a part of the report."""

    def page(self, data: dict) -> str:
        path = write_results(self.folder / "anatomy.json", data)
        return anatomy_page.section(anatomy_results.load([path])[0], "anatomy", "")

    def test_a_file_beside_the_results_is_found_and_its_part_is_linked(self):
        small = self.small()
        write_results(self.folder / "anatomy.json", model_anatomy())
        self.good("report.py", small, "--out", self.folder / "out")
        page = (self.folder / "out/report.html").read_text(encoding="utf-8")
        self.assertIn('<a href="#anatomy">Why the winner wins</a>', page)
        for figure in ("anatomy_time", "anatomy_map", "anatomy_roofline"):
            self.assertIn(f"<code>figures/{figure}.pdf</code>", page)

    def test_the_page_says_what_each_step_is_worth_and_what_bounds_it(self):
        page = self.page(model_anatomy())
        self.assertIn("At random points a packed query is 5.00 times as fast as one to Ward&#x27;s structure. It reads "
                      "20.0 cache lines instead of 90.0, and 8.00 whole records instead of 60.0, of which 6.00 are "
                      "valid. Step by step: one path instead of many 2.50, small copies instead of whole records 1.14, "
                      "vectors 1.75 times.", page)
        self.assertIn("is another 5.00 times as fast", page)

    def test_the_page_says_how_long_memory_takes_where_that_was_measured(self):
        self.assertRegex(self.page(model_anatomy()), r"takes 10\.0 .*ns on this machine from a block of 1\.00 MiB and "
                                                     r"160 .*ns from one of 64\.0 MiB")
        without = model_anatomy()
        without["benchmarks"] = [row for row in without["benchmarks"] if "block_bytes" not in row]
        self.assertNotIn("from a block of", self.page(without))

    def test_the_page_says_what_stands_against_what_is_asked(self):
        # Medians are 1.02 times the model's figures. Asked: 2040 / 12 ns, in which 8 instructions a nanosecond are 1,360;
        # 816 / 3, in which they are 2,176; and 1.25 * 387.6, which 408 ns are within.
        page = self.page(model_anatomy())
        for what, cells in (("12.0 times as fast as Ward&#x27;s structure", ["170", "408", "1,360", "1,000", "250"]),
                            ("3.00 times as fast as one path", ["272", "408", "2,176", "1,000", "250"]),
                            ("at most 1.25 times as long as frozen", ["484", "408", "3,876", "1,000", "250"])):
            line = re.search(rf"<tr><td>{re.escape(what)}<span class=\"under\">random points</span></td>(.*?)</tr>", page)
            self.assertIsNotNone(line, what)
            self.assertEqual(re.findall(r'<td class="n">(.*?)</td>', line[1]), cells)
        self.assertIn("waiting: it executes 2.45 of 8.00 instructions a nanosecond", page)
        self.assertIn("nothing: it is reached", page)
        self.assertIn("counted by valgrind-3.19.0, lines with a last level of 4.00 MiB", page)
        # At 1.6 lines from memory a query not always waits twice; at 8 it does, for 2 * 160 ns of 267.
        self.assertNotIn("to wait twice", page)
        data = model_anatomy()
        for row in data["benchmarks"]:
            if "lines_from_memory" in row:
                row["lines_from_memory"] *= 10.0
        self.assertIn("for its cells and then for the records that they name, takes 320 ns, unless queries overlap", self.page(data))
        # Where instructions have no room, and where those who know the records beforehand take as long.
        for part, change, why in (("packed_wait_free", {"instructions": 1400.0}, "its instructions alone"),
                                  ("told", {"ns_per_query": 200.0}, "a query that is told the valid records takes longer")):
            data = model_anatomy()
            for row in data["benchmarks"]:
                if row.get("part") == part:
                    row |= {name: value for name, value in change.items() if name in row}
            self.assertIn(why, self.page(data))
            self.assertNotIn(why, page)

    def test_where_nothing_was_counted_the_page_says_nothing_of_instructions(self):
        data = model_anatomy()
        for row in data["benchmarks"]:
            row.pop("instructions", None)
        self.assertNotIn("there is room for", self.page(data))
        path = write_results(self.folder / "anatomy.json", data)
        self.assertIn("bench/instructions counts them", self.good("anatomy_roofline.py", path, "--out", self.folder).stdout)

    def test_the_page_names_the_scene(self):
        self.assertIn("100,000 records in cornell_box, one thread", self.page(model_anatomy()))
        other = model_anatomy(configuration={"command": "anatomy", "scene": "office"})
        self.assertIn("100,000 records in office, one thread", self.page(other))

    def test_the_map_leaves_nothing_out_of_its_table(self):
        path = write_results(self.folder / "anatomy.json", model_anatomy())
        self.good("anatomy_map.py", path, "--out", self.folder)
        table = read_csv(self.folder / "anatomy_map.csv")
        self.assertEqual([(sum(line["part"] == part for line in table)) for part in ("wait_free", "packed_wait_free")],
                         [60, 8])
        self.assertEqual(sum(line["valid"] == "True" for line in table), 12)

    def test_wrong_files_are_refused(self):
        data = model_anatomy()
        for row in data["benchmarks"]:
            row.pop("ns_per_query", None)
        path = write_results(self.folder / "wrong.json", data)
        with self.assertRaisesRegex(results.InputError, 'no "ns_per_query"'):
            anatomy_results.load([path])


class MainJob(InFolder):
    """bench/run around programs that hand out what was made before."""

    def setUp(self):
        super().setUp()
        self.root, self.out = self.folder / "root", self.folder / "results"
        (self.root / "bench").mkdir(parents=True)
        for name in ("run", "setup", "packages.txt"):
            shutil.copy(kRoot / "bench" / name, self.root / "bench" / name)
        (self.root / "plots").symlink_to(kPlots)
        self.program("../../../../tools/cmake", "")
        compared = write_results(self.folder / "compared.json", model_pareto())
        repeated = write_results(self.folder / "repeated.json", model_repeatability())
        imagined = write_results(self.folder / "imagined.json", model_simulated((1, 4), 0, workloads=kFewWorkloads[:1]))
        self.program("anatomy", f'cp {write_results(self.folder / "apart.json", model_anatomy())} "$OUT"')
        self.program("icbench", f'[[ $1 != sweep ]] || cp {self.small("made.json")} "$OUT"\n'
                                f'[[ $1 != simulate ]] || cp {imagined} "$OUT"\n'
                                '[[ " $* " != *" --validate "* ]] || exit 1\n'  # figures were far off
                                f'[[ $1 != pareto ]] || cp {compared} "$OUT"\n'
                                f'[[ $1 != repeatability ]] || cp {repeated} "$OUT"')

    def program(self, name: str, body: str):
        """A program that runs `body` with $OUT set to the value of its --out or --json."""
        path = self.root / "build/release/bin" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        (self.folder / "root/build/release/bin").mkdir(parents=True, exist_ok=True)
        path.write_text('#!/usr/bin/env bash\necho "${0##*/} $1" >>"$CALLS"\n'
                        'for i in "$@"; do [[ $last != --out && $last != --json ]] || OUT=$i; last=$i; done\n'
                        f"{body}\n")
        path.chmod(0o755)

    def job(self) -> subprocess.CompletedProcess:
        self.calls = self.folder / "calls"
        self.calls.write_text("")
        environment = os.environ | {"ICBENCH_PYTHON": sys.executable, "CALLS": str(self.calls),
                                    "PATH": f"{self.folder / 'tools'}:{os.environ['PATH']}"}
        return subprocess.run([self.root / "bench/run", "--quick", "--no-install", "--out", self.out],
                              capture_output=True, text=True, env=environment, check=False)

    def verdicts(self, broken: bool) -> Path:
        data = model_verdicts()
        if broken:
            data["checks"][0] |= {"verdict": "violated", "violations": 1}
        return write_results(self.folder / "verdicts.json", data)

    def test_a_sound_run_ends_with_the_report(self):
        self.program("icstress", f'cp {self.verdicts(False)} "$OUT"')
        done = self.job()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout.splitlines()[-1], str(self.out / "report.html"))
        page = (self.out / "report.html").read_text()
        self.assertIn('id="correctness-promises"', page)
        self.assertIn('id="pareto-pareto"', page)
        self.assertIn('id="repeatability-repeatability"', page)
        self.assertIn("icbench pareto", self.calls.read_text())
        self.assertIn("icbench repeatability", self.calls.read_text())
        self.assertIn("icbench preempt", self.calls.read_text())
        self.assertEqual(self.calls.read_text().count("icbench simulate"), 2)
        self.assertIn("more-cores", page)
        self.assertEqual(json.loads((self.out / "run.json").read_text()) | {"start": "", "end": ""},
                         {"mode": "quick", "commit": "unknown", "start": "", "end": ""})

    def test_a_scene_that_fails_loses_nothing_and_is_taken_up_again(self):
        self.program("icstress", f'cp {self.verdicts(False)} "$OUT"')
        program = self.root / "build/release/bin/icbench"
        sound = program.read_text()
        program.write_text(sound.replace("\n[[ $1 != sweep ]]", '\necho "$*" >>"$CALLS"\n'
                                         '[[ $1 != pareto || " $* " != *" cornell_box "* ]] || exit 1\n[[ $1 != sweep ]]'))
        done = self.job()
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("not measured on cornell_box;", done.stderr)
        self.assertEqual(done.stdout.splitlines()[-1], str(self.out / "report.html"))
        self.assertIn("<b>sibenik</b>", (self.out / "report.html").read_text())
        self.assertIn("icbench simulate", self.calls.read_text())
        self.assertTrue((self.out / "pareto_sibenik.json").exists())
        self.assertFalse((self.out / "run.json").exists())
        program.write_text(sound.replace("\n[[ $1 != sweep ]]", '\necho "$*" >>"$CALLS"\n[[ $1 != sweep ]]'))
        done = self.job()
        self.assertEqual(done.returncode, 0, done.stderr)
        for scene in ("cornell_box", "sibenik"):
            self.assertRegex(self.calls.read_text(),
                             f"pareto --scene {scene} .*--out [^ ]*pareto_{scene}.json .*--resume")
        self.assertTrue((self.out / "run.json").exists())
        self.assertTrue((self.out / "pareto_sibenik.json").exists())

    def test_a_broken_promise_hides_nothing_and_ends_with_status_1(self):
        self.program("icstress", f'cp {self.verdicts(True)} "$OUT"; exit 1')
        done = self.job()
        self.assertEqual(done.returncode, 1)
        self.assertIn("not every cache was shown to be correct", done.stderr)
        self.assertEqual(done.stdout.splitlines()[-1], str(self.out / "report.html"))
        self.assertIn('class="banner">Broken promise', (self.out / "report.html").read_text())

    def test_verdicts_of_another_run_are_not_taken_for_those_of_a_crash(self):
        self.program("icstress", f'cp {self.verdicts(False)} "$OUT"')
        self.assertEqual(self.job().returncode, 0)
        self.program("icstress", "kill -SEGV $$")
        self.assertEqual(self.job().returncode, 1)
        self.assertTrue((self.out / "correctness.previous.json").exists())
        self.assertNotIn('id="correctness-promises"', (self.out / "report.html").read_text())

    def test_a_resumed_run_keeps_its_verdicts_and_what_they_say(self):
        self.program("icstress", f'cp {self.verdicts(True)} "$OUT"; exit 1')
        plots = self.root / "plots"
        plots.unlink()  # no plots, no report: the run ends unfinished
        self.assertEqual(self.job().returncode, 1)
        self.assertFalse((self.out / "run.json").exists())
        start = (self.out / ".unfinished").read_text().splitlines()[1]
        plots.symlink_to(kPlots)
        done = self.job()
        self.assertEqual(json.loads((self.out / "run.json").read_text())["start"], start)
        self.assertNotIn("icstress", self.calls.read_text())
        self.assertEqual(done.returncode, 1)
        self.assertIn("broken promise: sequential promises integrity", done.stderr)
        self.assertTrue((self.out / "report.html").exists())


class Findings(InFolder):
    def setup_of(self, **options) -> results.Setup:
        return results.load([self.results(**options)])[0]

    def test_warnings_are_those_of_the_run(self):
        calm = self.setup_of(threads=(1, 8), repetitions=8, noise=0.001)
        self.assertEqual(cautions.cautions(calm), [])
        wild = self.setup_of(threads=(1, 32), noise=0.5, governor="unknown", hypervisor="kvm", complete=False,
                             equal_speed_pus=False, load_avg=[3.0, 2.0, 1.0])
        text = " ".join(w.text for w in cautions.cautions(wild))
        for word in ("incomplete", "virtual machine (kvm)", "governor is unknown", "not equally fast",
                     "not idle",
                     "Oversubscribed: 32", "Noisy:", "three to five repetitions"):
            self.assertIn(word, text)
        self.assertTrue(cautions.cautions(wild)[0].grave)

    def test_a_tie_is_undecided(self):
        caches = few_caches()
        data = model_results(caches=caches, workloads=kFewWorkloads[:1], threads=(8,), errors=False)
        for i, row in enumerate(data["benchmarks"]):
            row["items_per_second"] = 1e6 * (1 + 0.1 * math.sin(i))
        setup = results.load([write_results(self.folder / "results.json", data)])[0]
        self.assertIn("Undecided", findings.of_throughput(setup, "packed", 8).text)

    def test_what_strictness_costs_is_the_ratio_of_the_two(self):
        caches = model_caches(("ward",), ("global_mutex", "wait_free", "wait_free_snapshot"), ())
        data = model_results(caches=caches, workloads=kFewWorkloads, threads=(8,), errors=False)
        for row in data["benchmarks"]:
            rate = {"global_mutex": 1e6, "wait_free": 4e6, "wait_free_snapshot": 3e6}[row["cache"]]
            row |= {"items_per_second": rate, "real_time": row["queries"] / rate * 1e3}
        setup = results.load([write_results(self.folder / "results.json", data)])[0]
        found = findings.of_strictness(setup, 8)
        self.assertEqual(found.value, "0.750× [0.750, 0.750]")
        self.assertIn("of wait_free_snapshot, whose queries are atomic snapshots, over that of wait_free",
                      found.text)
        self.assertNotIn("Undecided", found.text)
        self.assertIn(found, findings.findings(setup))
        self.assertIsNone(findings.of_strictness(self.setup_of(), 8))  # only one of the two was measured

    def test_error_at_equal_time_is_the_ratio_at_the_caches_time(self):
        rows = []
        for repetition in range(3):
            shared = {"threads": 1, "scene": "box", "workload_kind": "ray_traced",
                      "repetition_index": repetition,
                      "real_time": 1.0, "time_unit": "s"}
            for spp in (1, 100):  # relMSE 1 / seconds
                rows.append(shared | {"name": f"pareto/path:{spp}/none/threads:1", "cache": "none",
                                      "spp": spp,
                                      "workload": f"box:path:spp={spp}", "integrator": "path",
                                      "structure": "none",
                                      "mechanism": "none", "seconds_indirect": float(spp),
                                      "relmse": 1.0 / spp})
            rows.append(shared | {"name": "pareto/box/wait_free/threads:1", "cache": "wait_free",
                                  "structure": "ward",
                                  "workload": "box:rays=8", "mechanism": "wait_free",
                                  "integrator": "irradiance_cache",
                                  "seconds_indirect": 10.0, "relmse": 0.02})
        path = write_results(self.folder / "results.json", {"context": kContext, "benchmarks": rows})
        found = findings.of_error(results.load([path])[0], "ward", 1)
        self.assertEqual(found.value, "5.00× [5.00, 5.00]")


if __name__ == "__main__":
    unittest.main()
