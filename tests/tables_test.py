#!/usr/bin/python3
"""bench/tables on a stand-in for icbench (tables_fake_icbench.py), and its arithmetic on figures made up by
hand.

Needs a Python with the plotting libraries.
"""
import json
import os
import random
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib
from pathlib import Path
from unittest import mock

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
FAKE = ROOT / "tests" / "tables_fake_icbench.py"
LIBRARY = ROOT / "bench" / "tables_lib"
sys.path.insert(0, str(LIBRARY))

import arithmetic  # noqa: E402
import claims  # noqa: E402
import jobs  # noqa: E402
import main  # noqa: E402
import options  # noqa: E402
import pictures  # noqa: E402
import tables  # noqa: E402
from plan import Planner  # noqa: E402

SMALL = ("--quick", "--size", "4x3", "--threads", "1,2", "--accuracy", "0.2", "--icbench", str(FAKE))
# What --quick is in the tests.
SCALE = options.Scale((4, 3), frames=3, rounds=3, reference_spp=8, vpl_counts=(64, 128, 256, 512),
                      vpl_seeds=1, super_spp=4, converged_vpls=1024, converged_frames=2, few_vpls=(32, ),
                      neighbour_vpls=False, accuracies=(0.4, 0.2), cell_paths=16, curve_paths=(1, 4, 16, 64),
                      mechanism_frames=2, animated_stills=False, preview_side=16)
PATIENCE = 120  # seconds; turns a hang into a failure


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
                    ["--out"], ["--out", "/dev/null/folder"], ["--seed", "-1"], ["--igi-every", "0"]):
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
                       "--rounds", "--threads", "--accuracy", "--igi-every", "--seed", "--keep-frames", "--icbench",
                       "--no-install"):
            self.assertIn(option, done.stdout)

    def test_thread_counts(self):
        self.assertEqual(options.default_threads(2, "default"), (1, 2, 8))
        self.assertEqual(options.default_threads(6, "default"), (1, 2, 4, 6, 24))
        self.assertEqual(options.default_threads(1, "default"), (1, 4))
        self.assertEqual(options.default_threads(6, "quick"), (6, 24))


class Case(unittest.TestCase):
    """A test in a folder of its own."""
    def setUp(self):
        self.folder = Path(self.enterContext(tempfile.TemporaryDirectory(prefix="icbench-tables-test-")))
        self.out = self.folder / "out"

    def start(self, *arguments, **environment):
        """Runs bench/tables after its set-up, in a child of this process; `status` is negative where a signal
        ended it.
        """
        said = self.folder / "said"
        with open(said, "wb") as file:
            child = os.fork()
            if child == 0:
                os.dup2(file.fileno(), sys.stderr.fileno())
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
                os.environ.update(environment)
                signal.alarm(PATIENCE)
                status = 99
                with mock.patch.dict(options.kScales, quick=SCALE), \
                        mock.patch("sys.argv", ["main.py", *SMALL, "--out", str(self.out), *arguments]):
                    try:
                        status = main.main()
                    finally:
                        os._exit(status)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        return subprocess.CompletedProcess(arguments, status, stderr=said.read_text())

    def finished(self):
        """Identity of every finished job, and when it was finished."""
        records = [*(self.out / "jobs").glob("*/*/job.json"), *(self.out / "references").glob("*/*/job.json")]
        return {json.loads(r.read_text())["identity"]: r.stat().st_mtime_ns for r in records}

    def tables(self):
        return json.loads((self.out / "tables.json").read_text())

    def numbers(self):
        """All that was measured, without what tells two runs apart."""
        return {key: self.tables()[key] for key in ("scenes", "targets", "claims", "failures", "settings")}


class WholeRun(Case):
    """From the command line to the page."""
    def test_the_numbers_are_those_of_the_program_and_the_page_shows_them(self):
        done = self.start("--scenes", "cornell_box,office", "--keep-frames", "png")
        self.assertEqual(done.returncode, 0, done.stderr)
        measured = self.tables()
        self.assertTrue(measured["complete"])
        box, office = measured["scenes"]["cornell_box"], measured["scenes"]["office"]
        # Errors of IGI are 32 % / VPLs: 0.5, 0.25, 0.125 and 0.0625 points at 64, 128, 256 and 512.
        self.assertEqual(box["vpls"]["chosen"], 256)
        self.assertTrue(box["vpls"]["levelled_off"])
        # Seconds at 256 VPLs: IGI 4 * 4; IC 0.8 * 4 / 0.2; TIC that, then 0.1 * 4 / 0.2 twice.
        time = box["time"]
        self.assertAlmostEqual(time["methods"]["tic"]["seconds_indirect"]["median"], (16 + 2 + 2) / 3)
        self.assertAlmostEqual(time["indirect_over_tic"]["igi"]["median"], 16 / (20 / 3))
        self.assertAlmostEqual(time["indirect_over_tic_after_first"]["igi"]["median"], 8.0)
        self.assertAlmostEqual(time["whole_over_tic"]["igi"]["median"], 16.5 / (20 / 3 + 0.5))
        self.assertAlmostEqual(time["methods"]["rt"]["frames_per_second"]["median"], 2.0)
        self.assertEqual(time["methods"]["igi"]["seconds_indirect"]["n"], 3)
        # Hash cells trace 16 paths a pixel, 0.1 seconds each; an error of 1 % takes them as many.
        self.assertAlmostEqual(time["indirect_over_tic_after_first"]["cells"]["median"], 1.6 / 2)
        self.assertAlmostEqual(box["quality"]["cells_path_clean"]["p75"], 1.0, places=3)
        self.assertAlmostEqual(box["over_frames"]["cells"]["p75"], 0.875, places=3)
        self.assertEqual([(p["paths"], p["vpls"]) for p in box["equal_error"]["points"] if p["method"] == "cells"],
                         [(1, None), (4, None), (16, None), (64, None)])
        self.assertIsNotNone(box["equal_error"]["speedups"]["cells"])
        # The cache adds 0.02 * 0.2 to IGI's error.
        self.assertAlmostEqual(box["quality"]["tic_igi"]["p75"], 0.4, places=3)
        self.assertAlmostEqual(office["quality"]["tic_igi"]["p75"], 0.4, places=3)
        self.assertAlmostEqual(box["reference"]["halves"]["p75"], 0.2, places=3)
        # RT's error cancels: what is left is that of the VPLs and of the cache.
        self.assertAlmostEqual(box["quality"]["tic_path_clean"]["p75"], 0.525, places=3)
        self.assertAlmostEqual(box["quality"]["tic_path"]["p75"], 5.525, places=3)
        self.assertAlmostEqual(box["vpls"]["curve"][0]["p75"], 0.5, places=3)
        self.assertAlmostEqual(box["over_frames"]["tic"]["flicker"], 0.0004, places=6)
        self.assertIsNone(office["time"])
        # A lock on two threads is 2^0.25 times as fast as one thread, the others 2 times.
        rows = {(r["mechanism"], r["threads"]): r for r in office["mechanisms"]["still"]["rows"]}
        one, two, locked = 0.5 + 0.5 / 0.2, 0.5 + 0.5 / 0.2 / 2, 0.5 + 0.5 / 0.2 / 2**0.25
        self.assertAlmostEqual(rows["wf", 2]["speedup"]["median"], one / two)
        self.assertAlmostEqual(rows["lck", 2]["over_wait_free"]["median"], two / locked)
        self.assertAlmostEqual(rows["lw", 2]["redundant_share"]["median"], 1.0)
        self.assertAlmostEqual(rows["lck", 2]["lock_wait_share"]["median"], 0.25)
        # 256 / 8 + 48 bytes a record of 256 / 8 + 64.
        self.assertAlmostEqual(box["memory"]["share_of_allowed"]["median"], 80 / 96)
        verdicts = {t["name"]: t["verdict"] for t in measured["targets"]}
        self.assertEqual(verdicts["igi_over_tic/cornell_box"], "fail")
        self.assertEqual(verdicts["memory/cornell_box"], "pass")
        self.assertEqual(verdicts["perceived/office"], "fail")
        says = {c["name"]: c["verdict"] for c in measured["claims"]}
        self.assertEqual(says["shared_overhead"], "seen")
        self.assertEqual(says["no_loss_against_igi"], "not seen")
        self.assertEqual(says["static_methods"], "undecided")  # Bunnies 1 and 9 were not rendered
        self.assertEqual(len(list((self.out / "animations" / "cornell_box" / "tic").glob("frame_*.png"))), 3)
        self.assertTrue((self.out / "animations" / "cornell_box" / "tic.webp").exists())
        self.assertFalse(list(self.out.glob("jobs/*/*/frames")), "frames are dropped when a scene is done")
        self.page()

    def test_igi_of_a_few_frames_stands_for_all_and_says_so(self):
        done = self.start("--scenes", "cornell_box,office", "--frames", "5", "--igi-every", "3", "--keep-frames", "png")
        self.assertEqual(done.returncode, 0, done.stderr)
        box = self.tables()["scenes"]["cornell_box"]
        series = box["time"]["indirect_per_frame"]
        self.assertEqual([seconds is None for seconds in series["igi"]], [False, True, True, False, False])
        self.assertNotIn(None, series["tic"])
        self.assertAlmostEqual(box["time"]["methods"]["igi"]["seconds_indirect"]["median"], series["igi"][0])
        self.assertIsNone(box["over_frames"]["tic"]["flicker"])
        self.assertGreater(box["over_frames"]["tic"]["rmse"], 0)
        for method, count in ("igi", 3), ("interleaved", 3), ("tic", 5):
            frames = (self.out / "animations" / "cornell_box" / method).glob("frame_*.png")
            self.assertEqual(len(list(frames)), count, method)
        self.page()
        self.assertIn("rendered the first of every 3 frames and the last", (self.out / "tables.md").read_text())

    def page(self):
        done = subprocess.run([sys.executable, ROOT / "plots" / "thesis_page.py", self.out / "tables.json"],
                              capture_output=True, text=True, timeout=PATIENCE)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        html, markdown = (self.out / "tables.html").read_text(), (self.out / "tables.md").read_text()
        for told in ("Cornell Box", "Office", "thesis 0.43", "14.33", "fail", "not seen",
                     "made in kind on our own scenes"):
            self.assertIn(told, html)
            self.assertIn(told, markdown)
        self.assertNotRegex(html, r'<(img|script|link)[^>]+(src|href)="(?!data:)')


class Interrupted(Case):
    """Killed at any moment, a run loses the job that was under way."""
    def plan(self):
        return Planner(options.parse([*SMALL, "--out", str(self.out)]), {}).start("office", False)

    def store(self):
        made = jobs.Store(FAKE, self.out / "jobs", self.out / "references", "a build")
        made.fingerprints["office"] = "looks"
        return made

    def test_killed_again_and_again_a_run_ends_with_the_same_numbers(self):
        run = ("--scenes", "office", "--rounds", "1")
        self.assertEqual(self.start(*run).returncode, 0)
        undisturbed = self.numbers()
        names = set(self.finished())
        self.out = self.folder / "disturbed"
        seed = random.randrange(1 << 32)
        chance = random.Random(seed)
        calls = self.folder / "calls"
        with self.subTest(seed=seed):
            safe = {}
            for _ in range(4):
                calls.write_text("")
                done = self.start(*run, "--resume", FAKE_KILL=f"{chance.randint(2, 6)} {calls}")
                self.assertEqual(done.returncode, -signal.SIGKILL, done.stderr)
                now = self.finished()
                self.assertLessEqual(safe.items(), now.items(), "a finished job ran again")
                safe = now
            done = self.start(*run, "--resume")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertLessEqual(safe.items(), self.finished().items())
            self.assertEqual(set(self.finished()), names)
            self.assertEqual(json.dumps(self.numbers()), json.dumps(undisturbed))
            self.assertFalse(list(self.out.glob(f"**/*{jobs.kScratch}")))

    def test_a_run_goes_on_from_chosen_numbers_of_vpls(self):
        run = ("--scenes", "office", "--rounds", "1")
        self.assertEqual(self.start(*run).returncode, 0)
        in_one_go = self.numbers()
        self.out = self.folder / "in two"
        done = self.start(*run, "--choose-vpls")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertFalse(self.tables()["complete"])
        vpls = in_one_go["scenes"]["office"]["vpls"]
        self.assertEqual(self.tables()["scenes"]["office"]["vpls"], vpls)
        self.assertIn(f"office: {vpls['chosen']:,} VPLs", done.stderr)
        safe = self.finished()
        self.assertEqual(self.start(*run, "--resume").returncode, 0)
        self.assertTrue(self.tables()["complete"])
        self.assertLess(safe.items(), self.finished().items())
        self.assertEqual(json.dumps(self.numbers()), json.dumps(in_one_go))
        done = self.start(*run, "--choose-vpls", "--resume")
        self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), "finished tables are not overwritten")
        self.assertEqual(json.dumps(self.numbers()), json.dumps(in_one_go))

    def test_killed_at_every_job_in_turn_and_while_a_job_is_made_final(self):
        chain = self.plan().choice()[:8]

        def in_a_child(work):
            child = os.fork()
            if child == 0:
                work()
                os._exit(0)
            return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])

        calls = self.folder / "calls"
        for job in chain:
            if job.internal is None:
                calls.write_text("")
                with mock.patch.dict(os.environ, FAKE_KILL=f"1 {calls}"):
                    self.assertEqual(in_a_child(lambda job=job: self.store().ensure(job)), -signal.SIGKILL)
                self.assertIsNone(self.store().record(job))
            with mock.patch("os.rename", lambda *_: os._exit(7)):
                self.assertEqual(in_a_child(lambda job=job: self.store().ensure(job)), 7)
            self.assertIsNone(self.store().record(job), "a job is final by its rename alone")
            self.store().ensure(job)
            self.assertIsNotNone(self.store().record(job))
            self.assertTrue(self.store().has_files(job))

    def test_dropped_files_are_made_again_and_the_record_stays(self):
        plan, store = self.plan(), self.store()
        half = plan.halves[0]
        store.ensure(half)
        record = store.record(half)
        store.drop_files(half)
        self.assertFalse(store.has_files(half))
        store.ensure(plan.reference)
        self.assertTrue(store.has_files(half))
        self.assertEqual(json.loads((store.place(half) / "job.json").read_text()), record)


class Failures(Case):
    """A job that fails is named with its command and stops nothing but what reads its files."""
    def test_a_failing_method_leaves_the_others_and_resume_mends_it(self):
        run = ("--scenes", "office", "--rounds", "1")
        done = self.start(*run, FAKE_FAIL="instant_gi_interleaved")
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertRegex(
            done.stderr, r"failed: \S*icbench\S* render --scene office --integrator instant_gi_interleaved .*"
            r"status 2: icbench: made to fail")
        quality = self.tables()["scenes"]["office"]["quality"]
        self.assertIsNone(quality["interleaved_path"])
        self.assertAlmostEqual(quality["tic_igi"]["p75"], 0.4, places=3)
        self.assertTrue(self.tables()["failures"])
        before = self.finished()
        done = self.start(*run, "--resume")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertLess(before.items(), self.finished().items())
        self.assertAlmostEqual(self.tables()["scenes"]["office"]["quality"]["interleaved_path"]["p75"], 5.125,
                               places=3)

    def test_a_scene_that_cannot_be_compared_does_not_stop_the_next(self):
        done = self.start("--scenes", "bunnies_1,office", "--rounds", "1",
                          FAKE_FAIL="--scene bunnies_1 --integrator instant_gi ")
        self.assertEqual(done.returncode, 1)
        measured = self.tables()
        self.assertIsNone(measured["scenes"]["bunnies_1"]["vpls"]["chosen"])
        self.assertIsNotNone(measured["scenes"]["office"]["quality"]["tic_igi"])

    def test_finished_jobs_are_not_overwritten_unasked(self):
        (self.out / "jobs" / "office" / "job").mkdir(parents=True)
        (self.out / "jobs" / "office" / "job" / "job.json").write_text("{}")
        done = self.start("--scenes", "office")
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"\A[^\n]*--resume[^\n]*\n\Z")

    def test_unknown_scenes_and_programs_are_refused_in_one_line(self):
        for arguments, says in ((["--scenes", "atlantis"], "atlantis"), (["--icbench",
                                                                          "/none/icbench"], "/none/icbench")):
            done = self.start(*arguments)
            self.assertEqual(done.returncode, 2)
            self.assertRegex(done.stderr, r"\A[^\n]+\n\Z")
            self.assertIn(says, done.stderr)
            self.assertFalse(self.out.exists())


class Script(Case):
    """bench/tables itself, in a copy of the repository where cmake only says that it was called."""
    def setUp(self):
        super().setUp()
        self.root = self.folder / "copy"
        shutil.copytree(ROOT / "bench" / "tables_lib", self.root / "bench" / "tables_lib")
        for name in ("tables", "setup", "packages.txt"):
            shutil.copy(ROOT / "bench" / name, self.root / "bench" / name)
        (self.root / "plots").mkdir()
        (self.root / "plots" / "thesis_page.py").write_text("")
        self.built = self.folder / "built"
        cmake = self.folder / "stubs" / "cmake"
        cmake.parent.mkdir()
        cmake.write_text(f"#!/bin/sh\ntouch '{self.built}'\nexit 1\n")
        cmake.chmod(0o755)

    def script(self, *arguments):
        self.built.unlink(missing_ok=True)
        path = os.pathsep.join((str(self.folder / "stubs"), str(Path(sys.executable).parent), os.environ["PATH"]))
        command = [self.root / "bench" / "tables", "--no-install", "--quick", "--out", self.out, *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE,
                              env={**os.environ, "PATH": path, "ICBENCH_PYTHON": sys.executable})

    def refuse(self, *arguments, says):
        done = self.script(*arguments)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertRegex(done.stderr, r"\A[^\n]+\n\Z")
        self.assertIn(says, done.stderr)
        self.assertFalse(self.built.exists(), "something was built first")
        self.assertFalse(self.out.exists())

    def have_built(self, text):
        program = self.root / "build" / "release" / "bin" / "icbench"
        program.parent.mkdir(parents=True, exist_ok=True)
        program.write_text(text)
        program.chmod(0o755)

    def test_unknown_scenes_are_refused_before_anything_is_built_by_the_program_that_is_there(self):
        self.refuse("--scenes", "atlantis", "--icbench", FAKE, says="'atlantis'")
        self.refuse("--scenes", "office", f"--icbench={self.folder / 'none'}", says="none")
        self.have_built(FAKE.read_text())
        self.refuse("--scenes", "office,atlantis", says="'atlantis'")

    def test_without_a_program_that_can_tell_one_is_built_first(self):
        for make in (lambda: None, lambda: self.have_built("#!/bin/sh\nexit 1\n")):
            make()
            done = self.script("--scenes", "atlantis")
            self.assertEqual(done.returncode, 2)
            self.assertTrue(self.built.exists(), done.stderr)

    def test_a_program_that_is_named_is_not_built(self):
        done = self.script("--scenes", "office", "--size", "4x3", "--choose-vpls", "--icbench", FAKE)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertFalse(self.built.exists())


if __name__ == "__main__":
    unittest.main()
