#!/usr/bin/python3
"""Tests of the page on correctness."""
from __future__ import annotations

import json
import re
import subprocess
import unittest
from pathlib import Path

from plots_models import kCycle, model_verdicts
from plots_support import InFolder, References, read_csv, run, write_results

import correctness
import correctness_page
import results
from figures import CORRECTNESS_FIGURES


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

    def test_a_fault_that_no_scenario_reaches_is_said_and_histories_suffice(self):
        explored = [c for c in model_verdicts()["explored_controls"] if c["control"] != "publish_before_fill"]
        self.assertEqual(self.judge(self.verdicts(explored_controls=explored)).returncode, 0)
        self.holds(self.section(), "not explored<span class=\"under\">no scenario does what its fault takes",
                   '<div class="value">2 of 2</div>', "1 of them by a schedule that can be replayed")

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


if __name__ == "__main__":
    unittest.main()
