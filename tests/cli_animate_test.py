#!/usr/bin/env python3
"""icbench animate, and frames of animated scenes, end to end."""

import signal
import subprocess
import time
import unittest

from cli_support import ICBENCH, PATIENCE, PRECIOUS, SCENE, Case, arguments_of, small_render, with_effect

PNG_END = b"IEND\xaeB\x60\x82"


def small_animation(**changes):
    """Arguments of an animation that takes milliseconds a frame."""
    return arguments_of("animate", {}, with_effect({"scene": SCENE, "size": "16x16", "rays": 4, "vpls": 32,
                                                    "frames": 3, **changes}))


class Animate(Case):
    def test_writes_every_frame_a_preview_and_what_each_cost(self):
        for format, magic in ("exr", b"\x76\x2f\x31\x01"), ("png", b"\x89PNG"):
            self.succeed(*small_animation(out=format, format=format, json="a.json", threads=2))
            names = sorted(path.name for path in (self.folder / format).iterdir())
            self.assertEqual(names, [f"frame_000{i}.{format}" for i in range(3)] + ["preview.webp"])
            for name in names[:-1]:
                self.assertEqual((self.folder / format / name).read_bytes()[:4], magic)
            preview = (self.folder / format / "preview.webp").read_bytes()
            self.assertEqual((preview[:4], preview[8:12]), (b"RIFF", b"WEBP"))
        cost = self.load("a.json")
        self.assertEqual([frame["frame"] for frame in cost["frames"]], [0, 1, 2])
        for total in "seconds", "seconds_indirect", "rays", "shadow_rays", "queries":
            self.assertAlmostEqual(cost[total], sum(frame[total] for frame in cost["frames"]), places=6)
        for frame in cost["frames"]:
            self.assertGreater(frame["seconds"], frame["seconds_indirect"])

    def test_every_integrator_animates(self):
        for integrator in ("whitted", "path", "irradiance_cache", "instant_gi", "instant_gi_interleaved",
                           "instant_caching", "temporal_instant_caching", "hash_cells"):
            with self.subTest(integrator):
                self.succeed(*small_animation(out="none", format="none", integrator=integrator, json="a.json"))
                cost = self.load("a.json")
                self.assertFalse((self.folder / "none").exists())
                self.assertEqual("records" in cost, "cach" in integrator)
                self.assertEqual("light_paths" in cost, "instant" in integrator)
                self.assertEqual("vpls" in cost, "instant" in integrator)
                self.assertEqual("cells" in cost["frames"][0], integrator == "hash_cells")

    def test_nothing_changes_so_temporal_caching_keeps_everything(self):
        self.succeed(*small_animation(scene="white_furnace", format="none", threads=1, json="a.json",
                                      integrator="temporal_instant_caching", **{"light-samples": 1}))
        first, *others = self.load("a.json")["frames"]
        self.assertGreater(first["records"], 0)
        for frame in others:
            self.assertEqual(frame["light_paths_retraced"], 0)
            self.assertLess(frame["shadow_rays"], 16 * 16 + 1, "one for the direct light of each pixel")
            self.assertEqual(frame["records_kept"], first["records"])
            self.assertEqual((frame["records_updated"], frame["records_dropped"]), (0, 0))

    def test_frames_of_a_still_are_told(self):
        for scene, frames, is_told in ("cornell_indirect", 2, False), ("office", 2, True), ("office", 1, False):
            done = self.run_icbench(*small_animation(scene=scene, frames=frames, format="none"))
            self.assertEqual("is a still" in done.stderr, is_told, done.stderr)

    def test_every_nth_frame_and_the_last(self):
        whole, some = "all", "some"
        self.succeed(*small_animation(frames=6, out=whole, format="exr", integrator="path", threads=2))
        for every, frames in (2, [0, 2, 4, 5]), (5, [0, 5]), (9, [0, 5]), (1, [0, 1, 2, 3, 4, 5]):
            with self.subTest(every=every):
                out = f"{some}{every}"
                self.succeed(*small_animation(frames=6, every=every, out=out, format="exr", integrator="path",
                                              json="a.json"))
                cost = self.load("a.json")
                self.assertEqual([frame["frame"] for frame in cost["frames"]], frames)
                self.assertEqual(cost["frame_count"], len(frames))
                names = sorted(path.name for path in (self.folder / out).glob("frame_*"))
                self.assertEqual(names, [f"frame_000{frame}.exr" for frame in frames])
                for name in names:
                    self.assertEqual((self.folder / out / name).read_bytes(), (self.folder / whole / name).read_bytes())

    def test_a_frame_by_itself_is_that_of_the_animation(self):
        self.succeed(*small_animation(format="exr", out="a", integrator="path", threads=2))
        self.succeed(*small_render(frame=0, spp=1, integrator="path", out="f.exr"))
        self.assertEqual((self.folder / "f.exr").read_bytes(), (self.folder / "a/frame_0000.exr").read_bytes())

    def test_a_killed_run_leaves_whole_frames_only_and_none_of_an_earlier_one(self):
        (self.folder / "a").mkdir()
        for name in "frame_0000.png", "frame_99999.png", "preview.webp":
            (self.folder / "a" / name).write_text(PRECIOUS)
        with subprocess.Popen([ICBENCH, *small_animation(frames=100000, size="64x64", out="a")], cwd=self.folder,
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as run:
            until = time.monotonic() + PATIENCE
            while not (self.folder / "a/frame_0002.png").exists() and time.monotonic() < until:
                time.sleep(0.01)
            run.send_signal(signal.SIGKILL)
        self.assertFalse((self.folder / "a/preview.webp").exists())
        frames = sorted((self.folder / "a").glob("frame_*"))
        self.assertGreaterEqual(len(frames), 3)
        for frame in frames:
            self.assertTrue(frame.read_bytes().endswith(PNG_END), frame.name)

    # Guards against: frames of two animations in one folder.
    def test_two_never_share_a_folder(self):
        arguments = small_animation(out="both", frames=100_000)
        first = subprocess.Popen([ICBENCH, *arguments], cwd=self.folder, stdout=subprocess.DEVNULL,
                                 stderr=subprocess.DEVNULL)
        self.addCleanup(first.wait)
        self.addCleanup(first.kill)
        deadline = time.monotonic() + PATIENCE
        while not (self.folder / "both" / "frame_0000.png").exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        done = self.run_icbench(*small_animation(out="both"))
        self.assert_refused(done, "another process is writing", "both")

    def test_bad_input(self):
        for option, values in {"--frames": ["0", "-1", "x"], "--every": ["0", "x"], "--format": ["gif", "", "PNG"],
                               "--vpls": ["0", "-1", "65537"], "--integrator": ["TIC"],
                               "--size": ["0x0", "5"]}.items():
            for value in values:
                with self.subTest(option=option, value=value):
                    self.refuse("animate", option, value)
        (self.folder / "file").write_text(PRECIOUS)
        for out in "file", "file/folder", "/proc/folder":
            self.refuse(*small_animation(out=out), says=[out])
        self.refuse("animate", "--cache", "sequential", "--threads", "2", says=["--threads 1"])
        self.refuse(*small_render(frame=3, scene="white_furnace", out="a.exr"), says=["--frame 3", "1 frame"])


if __name__ == "__main__":
    unittest.main()
