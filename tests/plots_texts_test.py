#!/usr/bin/python3
"""Tests of how plots/ looks and speaks: signs of caches, texts that stay within their figures, words around numbers."""
from __future__ import annotations

import itertools
import os
import subprocess
import sys
import unittest
from dataclasses import replace
from unittest import mock

import numpy as np

from plots_models import kPlots, few_caches, model_simulated
from plots_support import InFolder, write_results

import comparison
import figure
import results
import run_differences
import simulated
import style
import tables
import thesis_frame_times
import thesis_tables
from figures import FIGURES, SIMULATED_FIGURES


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


class Texts(InFolder):
    """Texts of figures stay within them, whichever font is there."""

    def drawn_with(self, layout: style.Layout):
        """The settings of a page format on a machine that has no other font."""
        with mock.patch.object(style, "_font", return_value="DejaVu Sans"):
            return style.matplotlib.rc_context(style.settings(layout))

    def test_lines_are_as_wide_as_they_may_be_and_no_text_is_lost(self):
        random = np.random.default_rng(3)
        words = " ".join("".join(random.choice(list("iWm$^_-l"), random.integers(1, 12))) for _ in range(80))
        with self.drawn_with(style.kColumn):
            for inches in (0.5, 1.0, 3.0):
                lines = figure.wrapped(words, inches, 6.2, "bold")
                self.assertEqual("".join(lines).replace(" ", ""), words.replace(" ", ""))
                for line, after in zip(lines, [*lines[1:], "W" * 99]):
                    self.assertLessEqual(figure.text_width(line, 6.2, "bold"), inches)
                    begun = after.split(" ")[0]
                    self.assertGreater(figure.text_width(f"{line} {begun}", 6.2, "bold"), inches)
                cut = figure.wrapped(words, inches, 6.2, "bold", most=2)
                self.assertEqual((cut[0], len(cut), cut[1][-1]), (lines[0], 2, "…"))
                self.assertLessEqual(figure.text_width(cut[1], 6.2, "bold"), inches)
            self.assertEqual(figure.wrapped("short", 3.0, 6.2, most=2), ["short"])
            self.assertEqual(figure.wrapped("", 3.0, 6.2), [])
            self.assertEqual(figure.wrapped("wide", 1e-3, 6.2), list("wide"))

    def test_a_line_of_a_single_long_word_is_cut_within_it(self):
        with self.drawn_with(style.kColumn):
            lines = figure.wrapped("m" * 200, 1.0, 6.2, most=2)
            self.assertRegex(lines[1], "^m{10,} …$")

    def test_signs_of_formulas_have_their_own_widths(self):
        with self.drawn_with(style.kReport):
            self.assertGreater(figure.text_width("a$x$", 9), figure.text_width("ax$", 9))

    def test_nothing_is_cut_at_the_edge_of_a_figure(self):
        setup, = results.load([self.results(caches=few_caches(("ward", "packed")), threads=(1, 2, 3, 4, 6, 8, 32),
                                            repetitions=2, errors=True)])
        one, = simulated.load([write_results(self.folder / "s.json", model_simulated(validated=0))])
        plates = []
        for drawn, of in [*((f, setup) for f in FIGURES), *((f, one) for f in SIMULATED_FIGURES)]:
            try:
                plates += drawn.build(of).plates
            except figure.Omitted:
                continue
        self.assertGreater(len(plates), 20)
        faster = self.results("faster.json", threads=(1,), host_name="other")
        found, = comparison.comparisons(results.load([self.results(threads=(1,)), faster]))
        plates += run_differences.build(found).plates  # a long label under a narrow panel
        for plate, layout in itertools.product(plates, (style.kReport, style.kColumn)):
            bare = [replace(panel, draw=lambda axes, layout: None) for panel in plate.panels[:3]]
            with self.drawn_with(layout):
                for canvas in figure.compose(replace(plate, panels=bare), layout):
                    canvas.set_dpi(600)  # or widths would be rounded to those of a screen
                    canvas.draw_without_rendering()
                    for text in canvas.findobj(style.matplotlib.text.Text):
                        box = text.get_window_extent()
                        self.assertGreaterEqual(box.x0, -1, text)
                        self.assertLessEqual(box.x1, canvas.bbox.x1 + 1, (plate.title, layout.name, text))


class Words(InFolder):
    """What is said around numbers."""

    def test_equal_counts_are_said_once(self):
        line = {"panel": "read only", "cache": "wait_free", "peak_threads": 9.0, "peak_low": 8.0, "peak_high": 10.0}
        line |= {name + end: 1.0 for name in ("gamma", "alpha", "beta") for end in ("", "_low", "_high")}
        for counts, said in (((64, 64), "at most 64 threads"), ((32, 64), "at most 32 to 64 threads")):
            laws = results.pd.DataFrame([line | {"largest_count": count} for count in counts])
            self.assertIn(said, tables.scaling_laws(laws))

    def test_names_with_a_capital_within_stay_as_they_are(self):
        for words, begun in (("relMSE of irradiance", "relMSE of irradiance"), ("bytes a record", "Bytes a record"),
                             ("the error relMSE", "The error relMSE"), ("", "")):
            self.assertEqual(style.capital(words), begun)

    def animated(self, frames: int) -> thesis_frame_times.Measured:
        """A tables.json, as far as these tests need it."""
        scene = {"title": "Box", "vpls": {"chosen": 64, "levelled_off": True}, "equal_error": None,
                 "time": {"indirect_per_frame": {"tic": [4.0, *[1.0] * (frames - 1)]}}}
        return thesis_frame_times.Measured("", "", self.folder, {
            "settings": {"converged_vpls": 1024, "converged_frames": frames}, "methods": {}, "scenes": {"box": scene}})

    def test_one_last_frame_has_no_number(self):
        self.assertIn("1,024 VPLs on the last frame.", thesis_tables.equal_error(self.animated(1)).html())
        self.assertIn("1,024 VPLs on the last 3 frames.", thesis_tables.equal_error(self.animated(3)).html())

    def test_frames_are_whole_numbers(self):
        plate, = thesis_frame_times.build(self.animated(3)).plates
        for layout in (style.kReport, style.kColumn):
            axes = style.matplotlib.figure.Figure((6, 2)).add_axes([0, 0, 1, 1])
            plate.panels[0].draw(axes, layout)
            self.assertTrue(all(float(tick).is_integer() for tick in axes.get_xticks()), axes.get_xticks())


if __name__ == "__main__":
    unittest.main()
