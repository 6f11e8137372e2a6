#!/usr/bin/python3
"""The report in a real browser: headless Chromium clicks, types and presses keys in it, and looks at what it shows.

Skipped, with a word, where Chromium is not installed; everything else about the page is tested without it.
"""
from __future__ import annotations

import json
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

from plots_models import few_caches, model_pareto, model_results, model_simulated
from plots_support import write_results

import browser
import choice
import choice_page
import pareto_choice
import pareto_results
import report
import results
import style

kSkipped = 77  # the exit status that ctest takes for that
kWorkloads = ("mix_90_10:order=hot_spot", "miss_driven:cost=1", "miss_driven:cost=16", "miss_driven:cost=64")
kErrors = ["relmse", "rmse", "relmse_irradiance", "rmse_irradiance", "flip", "hdrvdp_p75"]
kRight, kLeft, kEscape, kSpace = ("ArrowRight", 39), ("ArrowLeft", 37), ("Escape", 27), (" ", 32)


class InBrowser(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        folder = Path(cls.folder.name)
        cls.data = model_results(caches=few_caches(), workloads=kWorkloads, threads=(1, 2, 4, 8, 32), repetitions=3)
        # One cache at one cost was validated less far than the others.
        imagined = model_simulated((1, 256), 8, workloads=kWorkloads[1:])
        for row in imagined["benchmarks"]:
            if (row["cache"], row["workload"]) == ("packed_shared_mutex", kWorkloads[-1]):
                row["validated_to_threads"] = 2
        # Two scenes, in one of them nothing is quick; runs so far apart that methods cannot be told apart.
        rooms = {"path": [(0.03, 0.6), (0.1, 0.2), (1.0, 0.02)], "instant_gi": [(0.04, 0.21), (0.5, 0.019)],
                 "hash_cells": [(0.035, 0.25), (0.2, 0.03)]}
        halls = {"path": [(0.4, 0.5), (4.0, 0.1)], "hash_cells": [(0.7, 0.02)]}
        compared = [write_results(folder / "pareto_desk.json", model_pareto(("desk",), rooms, noise=0.1)),
                    write_results(folder / "pareto_sibenik.json", model_pareto(("sibenik",), halls, noise=0.01))]
        cls.points = pareto_results.points(pareto_results.load(compared)[0])
        paths = [write_results(folder / "results.json", cls.data), write_results(folder / "simulated.json", imagined)]
        cls.setup = results.load(paths)[0]
        # The figures are tested elsewhere, and are most of the time that a page takes to make.
        figures, report.FIGURES[:] = report.FIGURES[:], report.FIGURES[:1]
        fronts, report.PARETO_FIGURES[:] = report.PARETO_FIGURES[:], []
        try:
            cls.page_file = report.build(paths, [], compared, [], [], folder / "out", "test")
        finally:
            report.FIGURES[:] = figures
            report.PARETO_FIGURES[:] = fronts
        cls.browser = browser.Browser()
        cls.addClassCleanup(cls.browser.__exit__)

    def setUp(self):
        self.page = self.browser.open(self.page_file)
        self.addCleanup(self.page.close)

    def text(self, selector: str) -> str:
        return self.page.value(f"document.querySelector({json.dumps(selector)}).textContent")

    def count(self, selector: str) -> int:
        return self.page.value(f"document.querySelectorAll({json.dumps(selector)}).length")

    def drawn(self) -> list[list[str]]:
        """The names of the lines of every chart, as Chart.js has them."""
        return self.page.value("""[...document.querySelectorAll(".charts canvas")].map(
            (canvas) => Chart.getChart(canvas).data.datasets.map((set) => set.label))""")

    def median(self, workload: str, cache: str, threads: int) -> float:
        rows = self.setup.rows
        mine = rows[(rows["workload"] == workload) & (rows["cache"] == cache) & (rows["threads"] == threads)]
        return float(mine["items_per_second"].median()) * 1e-6

    def test_it_opens_without_a_complaint_or_a_request(self):
        self.assertEqual(self.page.complaints(), [])
        self.assertTrue(self.text(".answer").startswith("Accuracy a ="), "it begins with an error that nothing keeps")
        self.assertEqual(self.page.value("performance.getEntriesByType('mark').map((m) => m.name)"),
                         ["icbench-choice", "icbench-explorer"])

    def test_nothing_can_be_loaded_from_elsewhere(self):
        blocked = self.page.value("""new Promise((done) => {
            document.addEventListener("securitypolicyviolation", (event) => done(event.violatedDirective));
            const image = new Image();
            image.src = "file:///nowhere.png";
        })""")
        self.assertEqual(blocked, "img-src")

    def test_charts_follow_what_is_picked(self):
        before = self.drawn()
        self.assertEqual(len(before), 2)
        self.assertIn("packed_wait_free", before[0])
        self.page.click(".explorer .caches label:last-child input")
        self.assertEqual(self.drawn(), [names[:-1] for names in before])
        self.page.click(".explorer button[data-none]")
        self.assertEqual(self.drawn(), [[], []])
        self.assertIn("Nothing of what is picked", self.text(".explorer .said"))
        self.page.click(".explorer button[data-all]")
        self.assertEqual(self.drawn(), before)
        self.page.click(".explorer .workloads label:nth-child(3) input")
        self.assertEqual(len(self.drawn()), 3)
        self.page.click(".explorer .threads label:nth-of-type(1) input")
        self.assertEqual(self.page.value("""Chart.getChart(document.querySelector(".charts canvas"))
            .data.datasets.find((set) => set.label === "packed_wait_free").data.map((p) => p.x)"""), [2, 4, 8, 32])

    def test_values_under_the_pointer(self):
        self.page.hover(".charts canvas")
        told = self.page.until("""(({body, dataPoints, opacity}) => body && opacity === 1 &&
            {lines: body.flatMap((b) => b.lines), x: dataPoints[0].raw.x})(
            Chart.getChart(document.querySelector(".charts canvas")).tooltip)""")
        self.assertIsNotNone(told, "no tooltip")
        expected = self.median(kWorkloads[0], "packed_wait_free", told["x"])
        line = next(line for line in told["lines"] if line.startswith("packed_wait_free:"))
        self.assertAlmostEqual(float(line.split()[1]), expected, delta=0.006 * expected)
        self.assertRegex(line, r"\[[\d.]+, [\d.]+\] M operations/s, n = 3$")
        values = [float(line.split()[1]) for line in told["lines"]]
        self.assertEqual(values, sorted(values, reverse=True))

    def test_values_by_the_keyboard(self):
        self.page.value("document.querySelector('.charts canvas').focus()")
        self.page.press(*kRight)
        self.assertTrue(self.text(".explorer .said").startswith("1 thread. "))
        self.page.press(*kRight)
        said = self.text(".explorer .said")
        expected = self.median(kWorkloads[0], "packed_wait_free", 2)
        self.assertTrue(said.startswith("2 threads. "), said)
        self.assertIn(f"packed_wait_free: {expected:.1f} [", said)
        self.page.press(*kLeft)
        self.assertTrue(self.text(".explorer .said").startswith("1 thread. "))
        self.page.press(*kEscape)
        self.assertEqual(self.text(".explorer .said"), "")
        self.page.value("document.querySelector('.explorer .caches input').focus()")
        checked = len(self.drawn()[0])
        self.page.press(*kSpace)
        self.assertEqual(len(self.drawn()[0]), checked - 1)

    def test_the_cost_of_a_record_as_the_axis(self):
        self.page.value("""(() => {
            const axis = document.querySelector(".explorer select[name=axis]");
            axis.value = "cost";
            axis.dispatchEvent(new Event("change", {bubbles: true}));
        })()""")
        line = self.page.value("""Chart.getChart(document.querySelector(".charts canvas"))
            .data.datasets.find((set) => set.label === "packed_wait_free").data""")
        self.assertEqual([p["x"] for p in line], [1, 16, 64])
        # One thread count is picked then: the largest that fits the processing units.
        for point, workload in zip(line, kWorkloads[1:]):
            expected = self.median(workload, "packed_wait_free", 8)
            self.assertAlmostEqual(point["y"], expected, delta=1e-3 * expected)
        self.page.click(".explorer .threads label:nth-of-type(1) input")
        self.assertEqual(self.page.value("""[...document.querySelectorAll(".explorer .threads input")]
            .filter((i) => i.checked).map((i) => i.value)"""), ["1"])

    def test_the_numbers_as_a_table(self):
        self.assertEqual(self.count(".explorer .numbers table"), 0)
        self.page.click(".explorer .numbers summary")
        self.page.until("document.querySelector('.numbers div').children.length")  # made when it is opened
        self.assertEqual(self.count(".explorer .numbers table"), 2)
        expected = self.median(kWorkloads[0], "packed_wait_free", 8)
        row = self.page.value("""[...document.querySelectorAll(".numbers tr")].find(
            (tr) => tr.cells[0].textContent === "packed_wait_free").cells[4].textContent""")
        self.assertAlmostEqual(float(row.split()[0]), expected, delta=0.006 * expected)

    def ask(self, **inputs) -> str:
        for name, value in inputs.items():
            self.page.type_over(f".question input[name={name}]", str(value))
        return self.text(".answer")

    def test_the_form_answers_as_python_does(self):
        made = choice.choice(self.setup)
        mechanisms = dict(zip(self.setup.rows["cache"], self.setup.rows["mechanism"]))
        sure = set()
        between = next(x for x in made.x if 16 < made.microseconds(x) < 64)
        for rays, cores in ((16, 2), (64, 8), (724, 4), (4096, 8), (8, 256), (between, 256), (4096, 256)):
            answer = self.ask(x=rays, cores=cores, error="")
            found = choice.answer(made, mechanisms, rays, cores, made.accuracies[0])
            self.assertIn(f"use {found.lines[0].kind} ({found.lines[0].cache})", answer)
            self.assertIn(f"on {cores} cores", answer)
            self.assertIn(f"How sure: {choice_page.how_sure(found)}: {found.how}", answer)
            sure.add(choice_page.how_sure(found))
            for line in found.lines:
                self.assertIn(line.cache, answer)
        self.assertEqual(sure, {"measured", "extrapolated, not measured",
                                "simulated, validated to 8 threads on this machine",
                                "simulated, validated to 2 threads on this machine",
                                "simulated at another cost of a record, not validated"})
        self.assertEqual(self.page.complaints(), [])

    def test_a_stricter_error_asks_for_a_finer_accuracy(self):
        errors = choice.errors_at(choice.choice(self.setup), 64)
        self.assertEqual([e.accuracy for e in errors], [0.4, 0.2, 0.1])
        for wanted, kept in ((errors[0], errors[0]), (errors[1], errors[1])):
            answer = self.ask(x=64, cores=8, error=f"{wanted.relmse[2] * 1.01:.6f}")
            self.assertTrue(answer.startswith(f"Accuracy a = {kept.accuracy:g}:"), answer[:80])
        self.assertIn("No accuracy measured keeps relMSE within", self.ask(error="0.0000001"))

    def test_what_is_not_known_is_said(self):
        self.assertIn("There is evidence for 4 and 8 cores, none for 6", self.ask(x=64, cores=6, error=""))
        self.assertIn("There is evidence for 8 and 256 cores, none for 96", self.ask(cores=96))
        answer = self.ask(cores=1000)
        self.assertIn("Nothing is known for 1000 cores: the most that there is evidence for is 256", answer)
        self.assertIn("Say how many", self.ask(x=""))
        self.assertIn("the nearest worked out", self.ask(x=100, cores=8))

    def buy(self, seconds, metric=0) -> list[str]:
        """The lines of the answer for so many seconds."""
        self.page.value(f"""(() => {{
            const select = document.querySelector(".budget select");
            select.value = "{metric}";
            select.dispatchEvent(new Event("input", {{bubbles: true}}));
        }})()""")
        self.page.type_over(".budget input[name=seconds]", str(seconds))
        return self.page.value("""[...document.querySelectorAll(".budget .answer tbody tr")].map(
            (line) => [...line.cells].map((cell) => cell.textContent).join("|"))""")

    def test_any_number_of_seconds_is_answered_as_the_tables_would(self):
        tied = 0
        for metric, error in enumerate(kErrors):
            for seconds in (0.01, 0.034, 0.045, 0.15, 0.37, 0.9, 2.5, 77):
                lines = self.buy(seconds, metric)
                said = self.text(".budget .answer")
                if seconds < 0.02:
                    self.assertIn(f"With {seconds} s, nothing that was measured is fast enough", said)
                for line, (scene, part) in zip(lines, self.points.groupby("scene"), strict=True):
                    found = pareto_choice.answer(part, seconds, error)
                    self.assertTrue(line.startswith(scene), line)
                    if not found:
                        self.assertIn("nothing is that fast: path (setting 0) takes", line)
                        continue
                    cells = line.split("|")
                    name, best = pareto_choice.name(found.best), found.best
                    self.assertEqual(cells[1], f"{name}{pareto_results.setting_words(best['setting'])}")
                    value = style.interval(best[error], best[f"{error}_from"], best[f"{error}_to"])
                    self.assertEqual(cells[2], value + (" *" if pareto_choice.own_error(best, error) else ""))
                    others = [f"{pareto_choice.name(o)} ({pareto_results.setting_words(o['setting'])})"
                              for _, o in found.tied.iterrows()]
                    self.assertEqual(cells[4], ", ".join(others) or "none")
                    tied += bool(others)
        self.assertGreater(tied, 0)
        self.assertIn("Nothing that was measured takes that long", self.text(".budget .answer"))
        self.buy("")
        self.assertIn("Say how many seconds", self.text(".budget .answer"))
        self.assertEqual(self.page.complaints(), [])

    def visible_tables(self) -> list[str]:
        return self.page.value("""[...document.querySelectorAll(".by")].filter((e) => e.checkVisibility()).map(
            (e) => e.dataset.error)""")

    def test_the_picked_error_shows_its_table_and_paper_has_all(self):
        for metric, error in enumerate(kErrors):
            self.buy(1, metric)
            self.assertEqual(self.visible_tables(), [error])
        self.page.ask("Emulation.setEmulatedMedia", media="print")
        self.assertEqual(self.visible_tables(), kErrors)
        self.assertFalse(self.page.value("document.querySelector('.budget form').checkVisibility()"))

    def test_narrow_windows_do_not_scroll_sideways(self):
        for width in (360, 700, 1400):
            self.page.resize(width, 800)
            fits = self.page.until("document.documentElement.scrollWidth <= innerWidth")
            self.assertTrue(fits, f"scrolls sideways in a window of {width}")

    def opened(self, **model) -> browser.Page:
        """A page of other results."""
        with tempfile.TemporaryDirectory() as folder, mock.patch.object(report, "FIGURES", report.FIGURES[:1]):
            path = write_results(Path(folder) / "results.json", model_results(errors=False, **model))
            page = self.browser.open(report.build([path], [], [], [], [], Path(folder), "test"))
        self.addCleanup(page.close)
        return page

    def test_what_is_picked_and_not_drawn_is_said(self):
        names = [f"read_only:records={count}" for count in range(1, 14)]
        page = self.opened(caches=few_caches()[:1], workloads=names, threads=(1,), repetitions=1)
        page.value("""document.querySelectorAll(".explorer input[name=workloads]:not(:checked)").forEach((box) => {
            box.checked = true;
            box.dispatchEvent(new Event("change", {bubbles: true}));
        })""")
        self.assertEqual(page.value("""document.querySelectorAll(".charts canvas").length"""), 12)
        said = page.value("""document.querySelector(".explorer .said").textContent""")
        self.assertEqual(said, "The first 12 of 13 workloads are drawn.")

    def test_long_names_do_not_make_it_scroll_sideways(self):
        caches = [cache | {"cache": f"{cache['cache']}_of_a_name_that_goes_on_and_on_and_on"} for cache in few_caches()]
        opened = self.opened(caches=caches, workloads=kWorkloads[:2], threads=(1, 8, 32), repetitions=3)
        for width in (360, 1280):
            opened.resize(width, 800)
            fits = opened.until("document.documentElement.scrollWidth <= innerWidth")
            self.assertTrue(fits, f"scrolls sideways in a window of {width}")

    def test_paper_has_the_table_and_no_form(self):
        self.page.ask("Emulation.setEmulatedMedia", media="print")
        self.page.value("dispatchEvent(new Event('beforeprint'))")
        shown = self.page.value("""Object.fromEntries([".question", ".explorer", ".choices", "figure img"].map(
            (s) => [s, document.querySelector(s).checkVisibility()]))""")
        self.assertEqual(shown, {".question": False, ".explorer": False, ".choices": True, "figure img": True})

    def test_without_scripts_everything_stands_as_tables_and_figures(self):
        self.page.ask("Emulation.setScriptExecutionDisabled", value=True)
        self.page.go_to(self.page_file)
        self.page.ask("Emulation.setScriptExecutionDisabled", value=False)
        shown = self.page.value("""Object.fromEntries([".explorer", ".choices", "figure img"].map(
            (s) => [s, document.querySelector(s).checkVisibility()]))""")
        self.assertEqual(shown, {".explorer": False, ".choices": True, "figure img": True})
        self.assertIn("With scripts allowed", self.text("noscript"))
        self.assertEqual(self.visible_tables(), kErrors)
        self.assertFalse(self.page.value("document.querySelector('.budget form').checkVisibility()"))


if __name__ == "__main__":
    if not browser.chromium():
        print("skipped: Chromium is not installed (apt-get install chromium), so nobody clicked in the report")
        sys.exit(kSkipped)
    unittest.main()
