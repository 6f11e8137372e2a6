#!/usr/bin/python3
"""The arithmetic of bench/tables on figures made up by hand, its pictures and its options.

Needs a Python with the plotting libraries.
"""
from __future__ import annotations

import struct
import subprocess
import tempfile
import unittest
import zlib
from pathlib import Path

import numpy as np
from PIL import Image

from tables_support import PATIENCE, ROOT

import arithmetic
import claims
import options
import pictures
import tables


class Arithmetic(unittest.TestCase):
    """Known answers."""
    def test_few_samples_give_their_range_and_two_give_none(self):
        self.assertEqual(arithmetic.interval_of([3.0, 1.0, 2.0]),
                         {"median": 2.0, "low": 1.0, "high": 3.0, "n": 3})
        self.assertEqual(arithmetic.interval_of([2.0, 4.0]),
                         {"median": 3.0, "low": None, "high": None, "n": 2})
        self.assertIsNone(arithmetic.interval_of([None, float("nan")]))

    def test_many_samples_give_order_statistics_of_95_per_cent(self):
        # P(the median lies outside the 2nd to the 8th of 9) = 2 (1 + 9) / 2^9 < 5 %; 3rd to 7th: 18 %.
        found = arithmetic.interval_of(range(1, 10))
        self.assertEqual((found["low"], found["high"]), (2, 8))
        self.assertEqual(arithmetic.interval_of(range(1, 7))["low"], 1)

    def test_ratios_are_paired_and_skip_holes(self):
        found = arithmetic.ratios([10.0, 40.0, None, 90.0, 5.0], [5.0, 10.0, 1.0, 15.0, 0.0])
        self.assertEqual((found["median"], found["low"], found["high"], found["n"]), (4.0, 2.0, 6.0, 3))

    def test_verdicts_need_the_whole_interval(self):
        wide = {"median": 2.0, "low": 1.0, "high": 3.0, "n": 3}
        for relation, target, verdict in (("at_least", 1.0, "pass"), ("at_least", 1.5, "undecided"),
                                          ("at_least", 3.1, "fail"), ("at_most", 3.0, "pass"),
                                          ("at_most", 2.0, "undecided"), ("at_most", 0.9, "fail")):
            self.assertEqual(arithmetic.decide(wide, relation, target), verdict)
        self.assertEqual(arithmetic.decide(arithmetic.interval_of([9.0, 9.0]), "at_least", 1.0), "undecided")
        self.assertEqual(arithmetic.decide(arithmetic.exact(0.0), "at_most", 0.33), "pass")
        self.assertEqual(arithmetic.worst(["pass", "undecided", "fail"]), "fail")
        self.assertEqual(arithmetic.worst([]), "undecided")

    def test_levelling_off(self):
        # 10 % of 4.0 is the wider limit: 4.4.
        curve = [(64, 9.0), (128, 4.5), (256, 4.4), (512, 4.1), (1024, 4.0)]
        self.assertEqual(arithmetic.level_off(curve), (256, True))
        # Of small errors 0.1 points is the wider limit.
        self.assertEqual(arithmetic.level_off([(64, 0.35), (128, 0.15), (256, 0.05)]), (128, True))
        # A count that is good by chance does not count when a larger one is bad.
        self.assertEqual(arithmetic.level_off([(64, 4.0), (128, 9.0), (256, 4.1), (512, 4.0)]), (256, True))
        self.assertEqual(arithmetic.level_off([(512, 4.0), (64, 9.0), (256, 8.0)]), (512, False))
        # Noise of the reference, 50 here, is not what the error falls by.
        noisy = [(64, 55.0), (128, 55.5), (256, 52.0), (512, 50.9), (1024, 50.5)]
        self.assertEqual(arithmetic.level_off(noisy), (512, True))
        self.assertRaises(ValueError, arithmetic.level_off, [])

    def test_seconds_at_an_error_follow_a_power_law_exactly(self):
        curve = [(n / 100, n**-0.5) for n in (64, 256, 1024)]  # error = 0.1 / sqrt(seconds)
        for n in (64, 100, 256, 999, 1024):
            seconds, bound = arithmetic.seconds_at_error(curve, n**-0.5)
            self.assertEqual(bound, "is")
            self.assertAlmostEqual(seconds, n / 100, places=9)

    def test_nothing_is_extrapolated(self):
        curve = [(1.0, 0.4), (2.0, 0.2), (3.0, 0.3)]  # the last one is beaten in both
        self.assertEqual(arithmetic.seconds_at_error(curve, 0.1), (2.0, "at_least"))
        self.assertEqual(arithmetic.seconds_at_error(curve, 0.5), (1.0, "at_most"))
        self.assertIsNone(arithmetic.seconds_at_error([(0.0, 0.1), (1.0, 0.0)], 0.1))

    def test_speed_up_at_equal_error_is_per_frame(self):
        ours = {"seconds": [0.5, 0.25, 0.5], "rmse": 0.1}
        rival = [{"method": "igi", "seconds": [1.0, 1.0, 2.0],
                  "rmse": 0.2}, {"method": "igi", "seconds": [4.0, 4.0, 8.0], "rmse": 0.05},
                 {"method": "ic", "seconds": [9.0, 9.0, 9.0], "rmse": 0.1}]
        found = tables.at_equal_error(rival, "igi", ours)  # halfway in logarithms: 2, 2 and 4 seconds
        self.assertEqual(found["bound"], "is")
        for key, expected in (("median", 8.0), ("low", 4.0), ("high", 8.0)):
            self.assertAlmostEqual(found["ratio"][key], expected)

    def test_a_claim_is_refuted_by_one_scene_and_left_open_by_one(self):
        def judged(*figures):
            parts = [claims._part("a scene", arithmetic.interval_of(f), "at_most", 1.0) for f in figures]
            return claims._claim("name", "says", "how", parts)["verdict"]

        self.assertEqual(judged([0.1, 0.2, 0.3], [0.5, 0.5, 1.0]), "seen")
        self.assertEqual(judged([0.1, 0.2, 0.3], [0.9, 1.0, 1.1]), "undecided")
        self.assertEqual(judged([0.9, 1.0, 1.1], [1.1, 1.2, 1.3]), "not seen")
        self.assertEqual(judged(), "undecided")


class Pictures(unittest.TestCase):
    """OpenEXR as icbench writes it."""
    def setUp(self):
        self.folder = Path(self.enterContext(tempfile.TemporaryDirectory()))
        self.picture = np.random.default_rng(1).random((37, 5, 3)).astype(np.float32) * 100

    def test_what_is_written_is_read(self):
        (self.folder / "a.exr").write_bytes(pictures.encode(self.picture))
        np.testing.assert_array_equal(pictures.read(self.folder / "a.exr"), self.picture)

    def test_zip_blocks_of_floats_and_halves(self):
        for code, kind in ((1, "<f2"), (2, "<f4")):
            (self.folder / "z.exr").write_bytes(zipped(self.picture, code, kind))
            np.testing.assert_array_equal(pictures.read(self.folder / "z.exr"),
                                          self.picture.astype(kind).astype(np.float32))

    def test_damaged_files_are_named(self):
        whole = zipped(self.picture, 2, "<f4")
        for data in (b"", b"no picture at all", whole[:200], whole[:-40]):
            (self.folder / "bad.exr").write_bytes(data)
            with self.assertRaisesRegex(pictures.PictureError, "bad.exr"):
                pictures.read(self.folder / "bad.exr")

    def test_weighted_sum(self):
        for name, factor in (("a.exr", 1), ("b.exr", 3)):
            (self.folder / name).write_bytes(pictures.encode(self.picture * np.float32(factor)))
        pictures.write_sum({"a.exr": 0.5, "b.exr": -1.0}, "sum.exr", self.folder)
        np.testing.assert_allclose(pictures.read(self.folder / "sum.exr"), -2.5 * self.picture, rtol=1e-6)

    def test_a_preview_of_some_frames_is_as_long_as_that_of_all(self):
        frames = {}
        for number in (0, 3, 4):
            frames[number] = self.folder / f"{number}.exr"
            frames[number].write_bytes(pictures.encode(np.full((4, 3, 3), 0.2 * (number + 1), np.float32)))
        pictures.write_preview(frames, 1.0, 16, self.folder / "some.webp")
        shown = []
        with Image.open(self.folder / "some.webp") as preview:
            for frame in range(preview.n_frames):
                preview.seek(frame)
                preview.load()
                shown.append(preview.info["duration"])
        self.assertEqual(shown, [120, 40, 40])


def zipped(picture, code, kind):
    """An OpenEXR file by its specification: 16 lines a block, even bytes before odd ones, differences,
    deflate.
    """
    height, width, _ = picture.shape

    def attribute(name, type_, data):
        return name + b"\0" + type_ + b"\0" + struct.pack("<i", len(data)) + data

    channels = b"".join(c + b"\0" + struct.pack("<iiii", code, 0, 1, 1) for c in (b"B", b"G", b"R")) + b"\0"
    head = struct.pack("<II", 20000630, 2) + attribute(b"channels", b"chlist", channels) + \
        attribute(b"compression", b"compression", b"\3") + \
        attribute(b"dataWindow", b"box2i", struct.pack("<4i", 0, 0, width - 1, height - 1)) + b"\0"
    blocks = []
    for first in range(0, height, 16):
        raw = picture[first:first + 16, :, ::-1].transpose(0, 2, 1).astype(kind).tobytes()
        split = np.frombuffer(raw[0::2] + raw[1::2], np.uint8).astype(int)
        steps = np.concatenate([split[:1], np.diff(split) + 128]).astype(np.uint8).tobytes()
        packed = zlib.compress(steps)
        packed = packed if len(packed) < len(raw) else raw
        blocks.append(struct.pack("<ii", first, len(packed)) + packed)
    offsets, at = [], len(head) + 8 * len(blocks)
    for block in blocks:
        offsets.append(at)
        at += len(block)
    return head + struct.pack(f"<{len(offsets)}Q", *offsets) + b"".join(blocks)


class Options(unittest.TestCase):
    """Wrong ones end with status 2 and one line, before anything is made."""
    def test_wrong_options(self):
        for bad in (["--size", "12"], ["--size", "0x9"], ["--frames", "1"], ["--frames", "x"],
                    ["--threads", "1,1"], ["--threads", "9000"], ["--threads", ""], ["--accuracy", "nan"],
                    ["--accuracy", "0"], ["--scenes", "a,,b"], ["--keep-frames", "exr"], ["--rounds", "0"],
                    ["--wrong"], ["--qui"], ["--reference-spp", "129"], ["--reference-spp", "0"], ["stray"],
                    ["--out"], ["--out", "/dev/null/folder"], ["--seed", "-1"], ["--igi-every", "0"],
                    ["--vpls", "0"], ["--vpls", "65536"], ["--vpls", "64,64"], ["--vpls", "many"], ["--out", ""],
                    ["--references", ""], ["--scenes", ""], ["--accuracy", ""], ["--out", "a\udcff"]):
            with self.subTest(bad), self.assertRaises(options.BadUsage) as caught:
                options.parse(bad)
            self.assertNotIn("\n", str(caught.exception))

    def test_the_command_refuses_before_it_sets_up_or_builds(self):
        done = subprocess.run([ROOT / "bench" / "tables", "--no-install", "--size", "wide"],
                              capture_output=True, text=True, timeout=PATIENCE)
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"\Abench/tables: --size 'wide' [^\n]+\n\Z")
        self.assertEqual(done.stdout, "")

    def test_help(self):
        done = subprocess.run([ROOT / "bench" / "tables", "--help"], capture_output=True, text=True,
                              timeout=PATIENCE)
        self.assertEqual(done.returncode, 0)
        for option in ("--quick", "--resume", "--out", "--references", "--scenes", "--size", "--frames",
                       "--rounds", "--threads", "--accuracy", "--igi-every", "--vpls", "--seed", "--keep-frames",
                       "--icbench", "--no-install"):
            self.assertIn(option, done.stdout)

    def test_numbers_of_virtual_lights(self):
        self.assertEqual(options.parse([]).scale.vpl_counts[-1], 16384)
        few = options.parse(["--vpls", "512,64"]).scale
        self.assertEqual((few.vpl_counts, few.converged_vpls), ((64, 512), 32768))
        many = options.parse(["--vpls", "32768,16384"]).scale
        self.assertEqual((many.vpl_counts, many.converged_vpls), ((16384, 32768), 65536))
        self.assertEqual(options.parse(["--quick", "--vpls", "4096"]).scale.converged_vpls, 8192)

    def test_thread_counts(self):
        self.assertEqual(options.default_threads(2, "default"), (1, 2, 8))
        self.assertEqual(options.default_threads(6, "default"), (1, 2, 4, 6, 24))
        self.assertEqual(options.default_threads(1, "default"), (1, 4))
        self.assertEqual(options.default_threads(6, "quick"), (6, 24))


if __name__ == "__main__":
    unittest.main()
