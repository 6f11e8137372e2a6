#!/usr/bin/python3
"""Runs of bench/tables on a stand-in for icbench (tables_fake_icbench.py): whole ones, interrupted ones, and ones in
which something fails.

Needs a Python with the plotting libraries.
"""
from __future__ import annotations

import fcntl
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import unittest
from pathlib import Path
from unittest import mock

from tables_support import FAKE, PATIENCE, ROOT, SMALL, Case

import jobs
import options
from main import files_named_by
from plan import Planner


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
        rays = box["memory"]["shadow_rays_per_frame_after_first"]
        self.assertAlmostEqual(rays["tic"], rays["igi"])
        for method, count in ("igi", 3), ("interleaved", 3), ("tic", 5):
            frames = (self.out / "animations" / "cornell_box" / method).glob("frame_*.png")
            self.assertEqual(len(list(frames)), count, method)
        self.page()
        self.assertIn("rendered the first of every 3 frames and the last", (self.out / "tables.md").read_text())
        # Frames of earlier settings are none of the later ones'.
        self.assertEqual(self.start("--scenes", "cornell_box", "--frames", "5", "--igi-every", "4", "--keep-frames", "png",
                                    "--resume").returncode, 0)
        frames = (self.out / "animations" / "cornell_box" / "igi").glob("frame_*.png")
        self.assertEqual(sorted(frame.name for frame in frames), ["frame_0000.png", "frame_0004.png"])

    def test_the_load_is_that_of_others_as_the_run_began(self):
        for loads, arguments, told in (([9.0, 40.0], (), 9.0), ([0.5, 40.0], ("--resume",), 9.0),
                                       ([30.0, 40.0], ("--resume",), 30.0)):
            said = iter(loads)
            with mock.patch("os.getloadavg", lambda said=said: (next(said, 40.0), 1.0, 1.0)):
                self.assertEqual(self.start("--scenes", "office", *arguments).returncode, 0)
            self.assertEqual(self.tables()["machine"]["load_avg"], [told, 1.0, 1.0])
        subprocess.run([sys.executable, ROOT / "plots" / "thesis_page.py", self.out / "tables.json"],
                       stdout=subprocess.DEVNULL, timeout=PATIENCE, check=True)
        self.assertIn("The load was 30.0 when the run began", (self.out / "tables.html").read_text())

    def test_what_is_finished_is_not_rendered_again(self):
        run = ("--scenes", "cornell_box,office", "--rounds", "1", "--resume")
        self.assertEqual(self.start(*run).returncode, 0)
        numbers = self.numbers()
        done = self.start(*run, FAKE_FAIL=" --json ")
        self.assertEqual((done.returncode, "failed" in done.stderr), (0, False), done.stderr)
        self.assertEqual(json.dumps(self.numbers()), json.dumps(numbers))
        # Where a picture has to be made again and cannot, the other scene goes on.
        (self.out / "pictures" / "cornell_box" / "tic.png").unlink()
        done = self.start(*run, FAKE_FAIL="animate --scene cornell_box")
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertEqual([failure["job"] for failure in self.tables()["failures"]], ["pictures"])
        self.assertIn("pictures", self.tables()["scenes"]["office"])

    def test_pictures_that_a_killed_run_has_overwritten_are_made_again(self):
        run = ("--scenes", "office", "--rounds", "1", "--resume")
        self.assertEqual(self.start(*run).returncode, 0)
        picture = self.out / "pictures" / "office" / "path.png"
        made = picture.read_bytes()

        def killed(_, path):
            path.write_bytes(b"cut short")
            os._exit(7)

        with mock.patch("pictures.write_image", killed):
            self.assertEqual(self.start(*run, "--vpls", "64").returncode, 7)
        self.assertEqual(picture.read_bytes(), b"cut short")
        self.assertEqual(self.start(*run).returncode, 0)
        self.assertEqual(picture.read_bytes(), made)

    def test_times_of_another_machine_are_not_used(self):
        run = ("--scenes", "office", "--rounds", "1")
        self.assertEqual(self.start(*run).returncode, 0)
        before = self.finished()
        with mock.patch("main.identity_of_machine", lambda: "another"):
            done = self.start(*run, "--resume")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("finished jobs of another program or machine", done.stderr)
        self.assertIsNone(self.tables()["scenes"]["office"]["reference"]["seconds"])
        self.assertGreater(len(self.finished()), len(before) + 5)

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
        self.cut_short(html, markdown)

    def cut_short(self, html, markdown):
        """Where a page has no room the earlier one stays."""
        (self.out / "tables.html").write_text(html + "<!-- earlier -->")
        size = len(html.encode()) // 2
        done = subprocess.run([sys.executable, ROOT / "plots" / "thesis_page.py", self.out / "tables.json"],
                              capture_output=True, text=True, timeout=PATIENCE,
                              preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)))
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"\A[^\n]*File too large: '[^\n]*/tables\.html'\n\Z")
        self.assertEqual((self.out / "tables.html").read_text(), html + "<!-- earlier -->")
        self.assertEqual((self.out / "tables.md").read_text(), markdown)
        self.assertEqual(list(self.out.glob(".*.scratch")), [])


class Interrupted(Case):
    """Killed at any moment, a run loses the job that was under way."""
    def plan(self):
        return Planner(options.parse([*SMALL, "--out", str(self.out)]), {}).start("office", False)

    def store(self):
        made = jobs.Store(FAKE, self.out / "jobs", self.out / "references", "a build")
        made.fingerprints["office"] = "looks"
        return made

    def test_what_a_scene_looks_like_tells_its_results_apart(self):
        one, other = self.store(), self.store()
        other.fingerprints["office"] = "other looks"
        for job in self.plan().choice():
            self.assertNotEqual(one.identity(job), other.identity(job), job.label)

    def test_a_scene_file_is_known_with_the_files_that_it_names(self):
        file = self.folder / "room.gltf"
        file.write_text('{"buffers": [{"uri": "b%20c.bin"}], "images": [{"uri": "maps/x.png"}, {"uri": "gone.png"}]}')
        (self.folder / "maps").mkdir()
        for name in ("b c.bin", "maps/x.png", "beside.bin"):
            (self.folder / name).write_bytes(b"x")
        self.assertEqual(files_named_by(file), [self.folder / "b c.bin", self.folder / "maps/x.png"])

    def test_buffers_within_a_scene_file_name_nothing(self):
        file = self.folder / "hall.gltf"
        zeros = b"A" * 2**21  # in base64; a search of quadratic time takes hours
        file.write_bytes(b'{"uri": "data:application/octet-stream;base64,' + zeros + b'=="}, {"uri": "beside.bin"}, '
                         + b"%00.b " + b"x" * 300 + b".y")
        (self.folder / "beside.bin").write_bytes(b"x")
        signal.alarm(PATIENCE)
        self.addCleanup(signal.alarm, 0)
        self.assertEqual(files_named_by(file), [self.folder / "beside.bin"])

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

    def test_references_are_made_by_one_run_at_a_time(self):
        references = self.folder / "shared"
        references.mkdir()
        with open(references / ".lock", "w", encoding="utf-8") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            done = self.start("--scenes", "office", "--references", str(references))
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"\A[^\n]*another run is writing to '[^\n]*shared'[^\n]*--references\n\Z")

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
        shutil.copy(ROOT / "plots" / "files.py", self.root / "plots")
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
