#!/usr/bin/python3
"""Tests of the page on speed against error."""
from __future__ import annotations

import json
import re
import unittest

import matplotlib.image
import numpy as np

from plots_models import model_pareto
from plots_support import InFolder, run, write_results

import pareto
import pareto_choice
import pareto_page
import pareto_results
import report
import results
import style


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

    def test_pictures_of_other_settings_are_no_runs_of_one(self):
        def file(name, **changes):
            data = model_pareto(scenes=("cornell_box",))
            data["benchmarks"] = [row | changes for row in data["benchmarks"]]
            return write_results(self.folder / name, data)

        first, wide = file("pareto.json"), file("pareto_wide.json", width=128)
        for name, value in ("width", 128), ("threads", 3), ("reference_spp", 8), ("frame", 4):
            with self.assertRaisesRegex(results.InputError, f"{name} of cornell_box is {value} here and .*; draw"):
                pareto_results.load([first, file("other.json", **{name: value})])
        (self.folder / "other.json").unlink()
        found, left_out = pareto_results.load_what_can_be(pareto_results.load, [first, wide])
        self.assertEqual([one.paths for one in found], [[first.resolve()]])
        self.assertIn("width of cornell_box", left_out[0])
        again = file("again.json", seed=99)
        self.assertEqual(len(pareto_results.load([first, again])[0].rows), 2 * len(found[0].rows))

    def test_a_scene_without_error_has_no_figure_and_a_page(self):
        small = self.small()
        data = model_pareto(scenes=("cornell_box",))
        for row in data["benchmarks"]:
            row |= {name: 0.0 for name in row if name in pareto_results.kErrors}
        write_results(self.folder / "pareto.json", data)
        done = self.good("report.py", small, "--out", self.folder / "out")
        self.assertIn("figure pareto: left out", done.stdout)
        self.assertIn('id="pareto"', (self.folder / "out/report.html").read_text(encoding="utf-8"))

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

    def test_an_error_that_no_row_of_a_scene_has_is_a_dash(self):
        data = model_pareto(scenes=("desk", "office"), noise=0.0)
        for row in data["benchmarks"]:
            if row["scene"] == "desk":
                row["flip"] = None
        desk, office = self.page(data).split("for the least FLIP")[1:]
        lines = [re.findall("<td.*?</td>", line) for line in re.findall("<tr>(.*?)</tr>", desk.split("</table>")[0])]
        self.assertGreater(len(lines), 2)
        self.assertEqual({line[5] for line in lines}, {"<td>–</td>"})
        self.assertNotIn("<td>–</td>", office.split("</table>")[0])

    def test_levels_of_interpolation_stand_side_by_side_at_equal_settings(self):
        made = {"irradiance_cache": 900, "irradiance_cache_occlusion": 400}
        data = model_pareto(scenes=("desk",), methods={"path": [(0.1, 0.5)]} | {m: [(0.2, 0.04)] * 5 for m in made},
                            noise=0.0)
        for row in data["benchmarks"]:
            if row["method"] == "path":
                continue
            # One setting, of the most rays, is of one level alone.
            number = int(row["name"].rpartition(":")[2])
            a, rays = ((0.2, 64), (0.4, 64), (0.2, 256), (0.4, 256), (0.4, 1024))[number]
            if rays == 1024 and row["method"] != "irradiance_cache":
                rays = 512
            row["name"] = f"pareto/desk/{row['method']}/accuracy:{a}/rays_per_record:{rays}"
            row["records"] = made[row["method"]] + rays + round(10 * a)
        page = self.page(data)
        part = page[page.index("What each level of interpolation is worth, at 256 rays a record"):]
        lines = [re.sub("<[^>]+>", " ", line).split() for line in re.findall(r"<tr><td>.*?</tr>", part)]
        self.assertEqual(lines[0][:3] + lines[0][5:6], ["split", "sphere", "1,160", "1,158"])
        self.assertIn("660", lines[1])
        self.assertIn("658", lines[1])
        alone = model_pareto(scenes=("desk",), methods={"path": [(0.1, 0.5)], "irradiance_cache": [(0.2, 0.04)]})
        self.assertNotIn("What each level", self.page(alone))

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
        self.assertEqual([error for error, _, _ in tables],
                         ["relmse", "rmse", "relmse_irradiance", "rmse_irradiance", "flip", "hdrvdp_p75"])
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

    def test_a_table_has_room_for_times_however_far_apart(self):
        columns = lambda *seconds: pareto_choice.columns(pareto_choice.pd.Series(seconds))
        self.assertEqual(columns(0.1, 5.0), [0.1, 0.3, 1, 3, 10])
        self.assertEqual(columns(0.002, 90.0), [0.01, 0.1, 1, 10, 100])
        self.assertEqual(columns(1e-6, 90.0), [1e-4, 1e-3, 0.01, 0.1, 1, 10, 100])

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

    def test_values_of_another_kind_than_expected_cost_no_scene(self):
        data = model_pareto(scenes=("cornell_box",))
        data["benchmarks"][0] |= {"threads": "all", "seed": [1, 2], "newer": {"a": 1}}
        data["benchmarks"][1] |= {"flip": [0.1], "relmse": {}}
        found, left_out = pareto_results.load_what_can_be(pareto_results.load, [write_results(self.folder / "pareto.json", data)])
        self.assertEqual((len(found[0].rows), left_out), (len(data["benchmarks"]) - 1, []))

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

    def test_a_picture_that_is_not_described_costs_no_others(self):
        data = model_pareto(scenes=("cornell_box",))
        data["context"]["images"] = "shots"
        shots = self.folder / "shots"
        shots.mkdir()
        for name in ("a", "a_error"):
            matplotlib.image.imsave(shots / f"{name}.png", np.zeros((4, 4)))
        whole = {"method": "path", "setting": "spp:16", "seconds": 0.5, "flip": 0.25, "image": "a.png",
                 "map": "a_error.png"}
        for absent in "setting", "seconds", "flip":
            (shots / "images.json").write_text(json.dumps(
                {"scene": "cornell_box", "budgets": [{"spp": 16, "seconds": 0.5, "pictures": [
                    whole, {key: value for key, value in whole.items() if key != absent}]}]}))
            page = self.page(data)
            self.assertEqual(page.count("data:image/png;base64,"), 2)
            self.assertEqual(page.count("the picture cannot be read"), 1)

    def test_a_setting_without_error_costs_no_figure_and_is_told(self):
        for error in "flip", "hdrvdp_p75":
            for sized in (True, False) if error == "hdrvdp_p75" else (True,):
                data = model_pareto(scenes=("cornell_box",))
                fastest = min(row["seconds_indirect"] for row in data["benchmarks"])
                for row in data["benchmarks"]:
                    if row["method"] == "path" and row["name"].endswith("setting:0"):
                        row |= {error: 0.0, "seconds_indirect": 0.5 * fastest}
                    if not sized:
                        del row["height"]
                found, = pareto_results.load([write_results(self.folder / "pareto.json", data)])
                plate, = (plate for plate in pareto.build(found).plates if plate.slug == error)
                drawn = error == "hdrvdp_p75" and sized
                self.assertIn("is drawn as half a pixel" if drawn else "is not drawn", plate.footnote)
                self.good("pareto.py", self.folder / "pareto.json", "--out", self.folder / "out")

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


if __name__ == "__main__":
    unittest.main()
