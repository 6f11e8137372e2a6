#!/usr/bin/env python3
"""The icbench program and bad input: one line, exit status 2, every file as it was."""

import base64
import itertools
import json
import os
import resource
import struct
import subprocess
import unittest
import unittest.mock

from cli_support import (ICBENCH, PATIENCE, PRECIOUS, SANITIZED, SCENE, Case, small_capture, small_pareto, small_render,
                         small_repeatability, small_sweep)


class BadInput(Case):
    """One line, status 2, and every file as it was."""

    def setUp(self):
        super().setUp()
        for name in "results.json", "render.exr", "out.json":
            (self.folder / name).write_text(PRECIOUS)

    def test_a_machine_that_is_not_there(self):
        with unittest.mock.patch.dict(os.environ, {"HWLOC_SYNTHETIC": "package:2 core:64 pu:2"}):
            self.refuse(*small_sweep(), says=["HWLOC_SYNTHETIC", "another machine"])

    def test_unknown_names_with_the_nearest_offered(self):
        for arguments, nearest in (
                (["swep"], "sweep"),
                (["list", "cachs"], "caches"),
                (["list", "--jsn", "caches"], "--json"),
                (["sweep", "--cahces", "null"], "--caches"),
                (["render", "--sceen=cornell_box"], "--scene"),
                (["sweep", "--caches", "null,wait-free"], "wait_free"),
                (["sweep", "--workloads", "red_only"], "read_only"),
                (["sweep", "--workloads", "read_only:recods=3"], "records"),
                (["sweep", "--workloads", "read_only:scene=cornel_box"], "cornell_box"),
                (["sweep", "--workloads", "read_only:order=hotspot"], "hot_spot"),
                (["sweep", "--workloads", "cornell_box:tiles=mortn"], "morton"),
                (["sweep", "--workloads", "cornell_box:integrator=paht"], "path"),
                (["render", "--scene", "cornel_box"], "cornell_box"),
                (["render", "--integrator", "iradiance_cache"], "irradiance_cache"),
                (["render", "--cache", "waitfree"], "wait_free"),
                (["pareto", "--methods", "path,hash_cell"], "hash_cells"),
                (["pareto", "--grid", "corse"], "coarse"),
                (["pareto", "--scene", "cornel_box"], "cornell_box"),
                (["pareto", "--cache", "waitfree"], "wait_free"),
                (["repeatability", "--caches", "wait_free,waitfree_snapshot"], "wait_free_snapshot"),
                (["repeatability", "--integrator", "instant_cachin"], "instant_caching"),
                (["sweep", "--caches", "wait"], "wait_free"),
                (["compare", "a", "b", "--metrics", "rmse,relmes"], "relmse")):
            with self.subTest(arguments):
                self.refuse(*arguments, says=["unknown", f"did you mean '{nearest}'?"])

    def test_arguments_that_nobody_expects(self):
        for arguments, part in ((["sweep", "now"], "now"), (["list", "caches", "scenes"], "scenes"),
                                (["--threads", "2", "sweep"], "--threads"), (["foo", "sweep"], "foo"),
                                (["list"], "WHAT"), (["compare", "a.exr"], "B"),
                                (["sweep", "--out"], "--out needs a value"), (["a\nb"], "a b"),
                                (["sweep", "--seed", "1", "--seed", "2"], "--seed is given more than once"),
                                (["compare", "a", "b", "--metrics", "rmse,rmse"], "--metrics names rmse twice")):
            with self.subTest(arguments):
                self.refuse(*arguments, says=[part])

    def test_numbers_out_of_range(self):
        numbers = {
            "--threads": ["0", "-1", "10000", "1.5", "", "x", "0x2", " 2"],
            "--seed": ["-1", "1.5", "x", "18446744073709551616"],
        }
        sweep = {
            "--threads": ["1,,2", ",1", "1,", "2,2", "1 2"],
            "--repetitions": ["0", "-1", "1.5", "x", ""],
            "--latency-every": ["-1", "x", "4294967295"],
            "--reference-spp": ["0", "1"],
            "--placement": ["foo", ""],
            "--caches": ["", "null,", "null,null", "all,null"],
            "--workloads": ["", ","],
        }
        render = {
            "--size": ["0x0", "0x5", "5", "1x", "x1", "1x1x1", "99999999x1", "-4x4", "4x-4", "1.5x2", ""],
            "--spp": ["0", "-1", "x"],
            "--rays": ["0", "-1", "1.5"],
            "--accuracy": ["0", "-1", "nan", "2", "x", "0.0019"],
            "--exposure": ["0", "-1", "nan", "inf", ""],
            "--cell-size": ["0", "-1", "nan", "1e9"],
            "--residual": ["0", "-0.1", "1.01", "nan", ""],
            "--paths": ["0", "-1", "1.5"],
            "--tiles": ["foo"],
            "--placement": ["foo"],
        }
        pareto = {
            "--size": ["0x0", "5"],
            "--methods": ["", "path,", "path,path"],
            "--repetitions": ["0", "x"],
            "--reference-spp": ["1", "0"],
            "--frame": ["-1", "100", "1.5"],
        }
        repeatability = {
            "--threads": ["1,,2", "2,2"],
            "--caches": ["", "null,null"],
            "--repetitions": ["0", "x"],
            "--reference-spp": ["1", "0"],
            "--frame": ["-1", "100"],
            "--accuracy": ["0", "2"],
        }
        for command, options in ("sweep", [numbers, sweep]), ("render", [numbers, render]), (
                "pareto", [numbers, pareto]), ("repeatability", [numbers, repeatability]):
            for option, values in itertools.chain.from_iterable(o.items() for o in options):
                for value in values:
                    with self.subTest(command=command, option=option, value=value):
                        self.refuse(command, option, value)

    def test_workload_parameters(self):
        for workload in ("read_only:records=0", "read_only:records=16777217", "read_only:records=1.5",
                         "read_only:operations=0", "read_only:cost=1", "miss_driven:cost=-1",
                         "miss_driven:cost=nan", "miss_driven:records=5", "read_only:a=0", "read_only:a=2",
                         "read_only:a=nan", "read_only:a=", "read_only:a", "read_only:=3", "read_only:",
                         "read_only::a=0.1", "read_only:a=0.1:a=0.2", "read_only:order=foo",
                         "read_only:scene=", "mix_50_50:operations=268435456", "cornell_box:size=0x0",
                         "cornell_box:size=5",
                         "cornell_box:size=1x", "cornell_box:size=16385x1", "cornell_box:rays=0",
                         "cornell_box:spp=0", "cornell_box:tiles=foo", "cornell_box:integrator=whitted",
                         "cornell_box:records=5", ":a=0.3"):
            with self.subTest(workload):
                self.refuse("sweep", "--workloads", workload, says=["workload"])
        self.refuse("sweep", "--workloads", "read_only:a=0.3,read_only:a=0.30", says=["twice"])

    def test_single_thread_caches_with_many_threads(self):
        self.refuse("sweep", "--caches", "sequential,brute_force", "--threads", "2", says=["--threads 1"])
        self.refuse("render", "--cache", "sequential", "--threads", "2", says=["--threads 1"])

    def test_caches_that_cannot_be_tidied(self):
        tidied = "read_only:layout=tidied"
        self.refuse("sweep", "--caches", "local_write", "--workloads", tidied, says=["layout=tidied"])
        self.refuse("preempt", "--caches", "local_write", "--workload", tidied, says=["local_write", "layout"])
        self.refuse("simulate", "--workloads", tidied, says=["layout=as_inserted"])

    def test_leaks_are_guarded_against_or_not(self):
        self.refuse("render", "--leak-guard", "--no-leak-guard", says=["--leak-guard", "excludes", "--no-leak-guard"])

    def test_residuals_that_cannot_be_kept(self):
        for arguments, part in ((["--unbiased"], "--unbiased needs --residual"),
                                (["--residual-out", "a.exr"], "--residual-out needs --residual"),
                                (["--residual", "1", "--residual-out", "a.png"], "must end in .exr"),
                                (["--residual", "1", "--residual-out", "missing/a.exr"], "missing"),
                                (["--residual", "1", "--residual-out", "render.exr"], "the file of --out too"),
                                (["--residual", "1", "--unbiased", "--out", "a.png"], "negative values")):
            with self.subTest(arguments):
                self.refuse("render", *arguments, says=[part])

    def test_caches_that_cannot_be_loaded_or_saved(self):
        self.succeed(*small_render(out="a.exr"), "--save-cache", "room.cache")
        whole = (self.folder / "room.cache").read_bytes()
        (self.folder / "damaged.cache").write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
        (self.folder / "cut.cache").write_bytes(whole[:-44])
        for arguments, part in ((["--load-cache", "missing.cache"], "missing.cache"),
                                (["--load-cache", "damaged.cache"], "checksum"),
                                (["--load-cache", "cut.cache"], "bytes where"),
                                (["--load-cache", "a.exr"], "no file of a cache"),
                                (["--load-cache", "room.cache", "--scene", "wobble"],
                                 f"holds records of {SCENE}, frame 0, not of wobble"),
                                (["--load-cache", "room.cache", "--frame", "1"], f"not of {SCENE}, frame 1"),
                                (["--load-cache", "room.cache", "--interpolation", "gradients"], "--load-cache"),
                                (["--save-cache", "b.cache", "--leak-guard"], "--no-leak-guard"),
                                (["--save-cache", "b.cache", "--interpolation", "bounded"], "--no-leak-guard"),
                                (["--save-cache", "b.cache", "--integrator", "path"], "--save-cache"),
                                (["--save-cache", "b.cache", "--integrator", "temporal_instant_caching"],
                                 "--save-cache"),
                                (["--save-cache", "./render.exr"], "the file of --out too"),
                                (["--save-cache", "nowhere/b.cache"], "nowhere")):
            with self.subTest(arguments):
                scene = [] if "--scene" in arguments else ["--scene", SCENE]
                self.refuse("render", "--size", "16x16", *scene, *arguments, says=[part])
        self.assertFalse((self.folder / "b.cache").exists())

    def test_files_that_would_be_lost(self):
        self.succeed(*small_render(out="a.exr"))
        self.succeed(*small_capture(out="a.trace"))
        (self.folder / "linked.trace").symlink_to("a.trace")
        replay = ["--workloads", "trace:file=a.trace", "--caches", "packed_wait_free"]
        for arguments, said in ((small_render(out="b.exr", json="./b.exr"), "--out too"),
                                (small_render(out="b.exr", json="b.cache") + ["--save-cache", "./b.cache"], "--json too"),
                                (small_capture(out="b.trace", json="b.trace"), "--out too"),
                                (["trace", "replay", "a.trace", "--json", "a.trace"], "the trace"),
                                (["trace", "info", "linked.trace", "--json", "a.trace"], "the trace"),
                                (["sweep", *replay, "--out", "linked.trace"], "a workload's trace"),
                                (small_sweep(out="b.json", timeline="../" + self.folder.name + "/b.json"), "--out too"),
                                (["simulate", *replay, "--calibration", "c.json", "--out", "c.json"], "--out too"),
                                (["compare", "a.exr", "a.exr", "--json", "a.exr"], "overwrite what is read, A"),
                                (["animate", "--scene", "a.gltf", "--json", "a.gltf"], "overwrite what is read"),
                                (["compare", "a.exr", "a.exr", "--map", ".", "--json", "rmse.exr"], "--json too"),
                                (["pareto", "--scene", "a.gltf", "--out", "a.gltf"], "overwrite what is read"),
                                (["pareto", "--out", "images.json", "--images", "."], "--out too"),
                                (["repeatability", "--scene", "a.gltf", "--out", "a.gltf"], "overwrite what is read")):
            with self.subTest(arguments):
                self.refuse(*arguments, says=[said])

    def test_figures_or_maps_among_frames(self):
        frames = ["animate", "--scene", SCENE, "--size", "8x8", "--rays", "1", "--frames", "1"]
        self.refuse(*frames, "--out", ".", "--json", "frame_0000.png", says=["a file of --out too"])
        self.refuse(*frames, "--out", ".", "--json", "preview.webp", says=["a file of --out too"])
        for folder in "errors/rmse", "other":
            self.succeed(*frames, "--format", "exr", "--out", folder)
        for arguments in (["--map", "errors"], ["--json", "other/frame_0000.exr"]):
            self.refuse("compare", "errors/rmse", "other", "--metrics", "rmse", *arguments, says=["name another"])

    def test_names_that_are_empty(self):
        for arguments in (small_render(json=""), small_render(residual=1, **{"residual-out": ""}),
                          [*small_render(), "--save-cache", ""], [*small_render(), "--load-cache", ""],
                          ["compare", "a.exr", "a.exr", "--map", ""], ["sweep", "--timeline", ""],
                          ["trace", "replay", "a.trace", "--json", ""], ["pareto", "--images", ""],
                          ["simulate", "--calibration", ""], ["simulate", "--transfer", ""]):
            self.refuse(*arguments, says=["needs a name"])

    def test_names_that_are_no_text(self):
        name = os.fsdecode(b"\xff.exr")
        for arguments in small_render(out=name, json="a.json"), ["compare", name, name, "--json", "b.json"]:
            done = self.run_icbench(*arguments, errors="replace")
            self.assertEqual(done.returncode, 0, done.stderr)
        for file in "a.json", "b.json":
            self.assertIn("\ufffd.exr", (self.folder / file).read_text(encoding="utf-8"))

    def test_frames_of_another_animation(self):
        short = ["animate", "--scene", SCENE, "--size", "8x8", "--rays", "1", "--every", "50", "--out", "frames"]
        self.succeed(*short, "--frames", "2")
        self.succeed(*short, "--frames", "2")
        before = self.contents()
        self.assert_refused(self.run_icbench(*short, "--frames", "1"), "frame_0001.png there is of another animation")
        self.assertEqual(self.contents(), before)

    def test_scenes_seen_or_lit_from_where_no_ray_reaches(self):
        triangle = base64.b64encode(struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)).decode()
        light = {"KHR_lights_punctual": {"light": 0}}
        for eye, lamp, said in ([0, 0, 5], [1e30, 0, 5], "point light 0"), ([0, 1e19, 5], [0, 0, 5], "the camera"):
            scene = {
                "asset": {"version": "2.0"},
                "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64," + triangle}],
                "bufferViews": [{"buffer": 0, "byteLength": 36}],
                "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
                "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
                "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
                "nodes": [{"mesh": 0}, {"camera": 0, "translation": eye}, {"extensions": light, "translation": lamp}],
            }
            (self.folder / "far.gltf").write_text(json.dumps(scene))
            with self.subTest(said):
                self.refuse(*small_render(scene="far.gltf"), says=["far.gltf", said + " has a coordinate of"])

    def test_an_error_is_one_line_where_there_would_be_notes(self):
        (self.folder / "bare.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        self.assertIn("note: has no camera", self.run_icbench(*small_render(scene="bare.obj", out="a.exr")).stderr)
        self.refuse(*small_render(scene="bare.obj", frame=99), says=["--frame 99", "has 1 frame"])
        self.refuse(*small_render(scene="bare.obj", vpls=4, frame=99), says=["--frame 99"])

    def test_what_cannot_be_simulated(self):
        (self.folder / "costs.json").write_text('{"format": "icbench calibration of simulations"}')
        for arguments, part in ((["--cores", "0"], "--cores"), (["--cores", "1,1"], "twice"),
                                (["--cores", "1025"], "1 to 1024"), (["--caches", "waitfree"], "wait_free"),
                                (["--caches", "sequential", "--cores", "2"], "--cores 1"),
                                (["--workloads", "cornell_box"], "icbench trace capture"),
                                (["--workloads", "trace:file=missing.trace"], "missing.trace"),
                                (["--calibration", "results.json"], "no JSON"),
                                (["--calibration", "costs.json"], "another version"),
                                (["--calibration", "."], "is a folder"),
                                (["--calibration", "/proc/none/costs.json"], "cannot be made"),
                                (["--transfer", "1,2"], "three numbers"), (["--transfer", "1,2,-3"], "three numbers"),
                                (["--transfer", "1,3,2"], "farther away"),
                                (["--hand-over", "1"], "two numbers"), (["--hand-over", "1,1e9"], "from 0 to 1e6"),
                                (["--complex", "3", "--socket", "8"], "multiple"), (["--out", "."], "a folder")):
            options = {"--calibration": "none.json", "--out": "out.json"} | dict(zip(arguments[::2], arguments[1::2]))
            with self.subTest(arguments):
                self.refuse("simulate", *(word for option in options.items() for word in option), says=[part])
        self.refuse("simulate", "--validate", "--cores", "0", "--calibration", "none.json", says=["--cores"])
        for what_if in (["--hand-over", "1,2"], ["--transfer", "1,2,3"]):
            self.refuse("simulate", "--validate", *what_if, "--calibration", "none.json", says=[what_if[0]])

    def test_traces_that_cannot_be_captured_or_read(self):
        self.succeed(*small_capture(out="a.trace"))
        whole = (self.folder / "a.trace").read_bytes()
        (self.folder / "damaged.trace").write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
        (self.folder / "cut.trace").write_bytes(whole[:-7])
        for arguments, part in ((["info", "missing.trace"], "missing.trace"),
                                (["info", "damaged.trace"], "checksum"),
                                (["replay", "cut.trace"], "cut off"),
                                (["replay", "results.json"], "no trace"),
                                (["info", "."], "no regular file"),
                                (["info"], "file"),
                                (["replay"], "see icbench trace replay --help"),
                                ([], "capture, info or replay"),
                                (["captur"], "did you mean 'capture'?"),
                                (["info", "a.trace", "b"], "unexpected argument 'b'; see icbench trace info --help"),
                                (["replay", "a.trace", "--scale", "-1"], "--scale '-1'"),
                                (["replay", "a.trace", "--scale", "nan"], "--scale 'nan'"),
                                (["replay", "a.trace", "--caches", "waitfree"], "did you mean 'wait_free'?"),
                                (["replay", "a.trace", "--threads", "0"], "--threads '0'"),
                                (["replay", "a.trace", "--cache", "sequential", "--threads", "2"], "--threads 1"),
                                (["replay", "a.trace", "--json", "nowhere/a.json"], "nowhere"),
                                (["capture", "--integrator", "path"], "uses no cache"),
                                (["capture", "--deterministic"], "--deterministic"),
                                (["capture", "--frames", "0"], "--frames '0'"),
                                (["capture", "--out", "nowhere/a.trace"], "nowhere"),
                                (["capture", "--out", "."], "folder")):
            with self.subTest(arguments):
                self.refuse("trace", *arguments, says=[part])
        for workload, part in (("trace", "names no file"), ("trace:file=missing.trace", "missing.trace"),
                               ("trace:file=damaged.trace", "checksum"), ("trace:fil=a.trace", "'file'"),
                               ("trace:file=a.trace:scale=-1", "scale=-1")):
            with self.subTest(workload):
                self.refuse("sweep", "--workloads", workload, "--out", "new.json", says=[part])
        self.assertEqual(self.run_icbench(*small_capture(out="/dev/full")).returncode, 2)

    def test_repeatability_is_of_integrators_with_a_cache(self):
        for integrator in "path", "hash_cells":
            self.refuse("repeatability", "--integrator", integrator, says=["uses no cache", "irradiance_cache"])

    def test_outputs_that_cannot_be_written(self):
        (self.folder / "folder.exr").mkdir()
        self.succeed(*small_render(out="picture.exr"))
        places = ["missing/a.exr", "folder.exr", "results.json/a.exr"]
        if os.geteuid() != 0:
            (self.folder / "locked").mkdir(mode=0o555)
            (self.folder / "locked.exr").write_text(PRECIOUS)
            (self.folder / "locked.exr").chmod(0o444)
            places += ["locked/a.exr", "locked.exr"]
        for place in places:
            for arguments in (small_sweep(out=place), small_render(out=place),
                              small_render(json=place), small_pareto(out=place),
                              small_repeatability(out=place),
                              ["compare", "picture.exr", "picture.exr", "--json", place]):
                with self.subTest(arguments):
                    before = self.contents()
                    self.assert_refused(self.run_icbench(*arguments), place)
                    self.assertEqual(self.contents(), before)
        self.refuse(*small_sweep(out=""), says=["--out"])
        self.refuse(*small_sweep(out="/proc/a.json"), says=["/proc/a.json"])
        self.refuse(*small_render(out="/proc/a.exr"), says=["/proc/a.exr"])
        self.refuse(*small_render(out="a.jpg"), says=[".exr or .png"])
        self.refuse(*small_sweep(out="/dev/null"), "--resume", says=["cannot resume"])
        self.refuse(*small_pareto(out="a.json", images="results.json"), says=["--images"])
        self.refuse(*small_pareto(out="a.json", images="shots", methods="hash_cells"), says=["add path"])

    def test_full_disks(self):
        for name in "full.exr", "full.png":
            (self.folder / name).symlink_to("/dev/full")
        self.succeed(*small_render(out="picture.exr"))
        for arguments in (small_sweep(out="/dev/full"),
                          small_sweep(out="full.exr"),
                          small_render(out="full.exr"),
                          small_render(out="full.png"),
                          ["compare", "picture.exr", "picture.exr", "--json", "/dev/full"]):
            with self.subTest(arguments):
                before = self.contents()
                self.assert_refused(self.run_icbench(*arguments), arguments[-1], "No space left")
                self.assertEqual(self.contents(), before)
        done = self.run_icbench(*small_render(out="kept.exr", json="/dev/full"))
        self.assert_refused(done, "/dev/full")
        self.assertTrue((self.folder / "kept.exr").exists(), "a picture that was computed is kept")

    def test_standard_output_that_cannot_be_written(self):
        for arguments in (["list", "workloads"], ["list", "caches", "--json"], ["--help"],
                          ["sweep", "--help"]):
            with open("/dev/full", "w") as full:
                done = self.run_icbench(*arguments, capture_output=False, stdout=full, stderr=subprocess.PIPE)
            self.assert_refused(done)
            closed = subprocess.run(["sh", "-c", '"$0" "$@" >&-', ICBENCH, *arguments], cwd=self.folder,
                                    stderr=subprocess.PIPE, text=True, timeout=PATIENCE)
            self.assert_refused(closed, "standard output")

    # Guards against: a log on a full disk costing the picture.
    def test_notes_that_nobody_can_hear_cost_no_picture(self):
        (self.folder / "bare.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        with open("/dev/full", "w") as full:
            done = self.run_icbench(*small_render(scene="bare.obj", out="a.exr"), capture_output=False,
                                    stdout=subprocess.DEVNULL, stderr=full)
        self.assertEqual(done.returncode, 0)
        self.succeed("compare", "a.exr", "a.exr")

    def test_places_that_cannot_take_a_file_are_told_before_the_work(self):
        (self.folder / "loop.exr").symlink_to("loop.exr")
        self.refuse(*small_render(out="loop.exr"), says=["leads nowhere"])
        self.refuse(*small_render(out="a.exr"), "--save-cache", "c" * 246, says=["too long"])
        gone = 'mkdir gone && cd gone && rmdir ../gone && exec "$0" "$@"'
        done = subprocess.run(["sh", "-c", gone, ICBENCH, *small_render(scene=SCENE, out="a.exr")], cwd=self.folder,
                              capture_output=True, text=True, timeout=PATIENCE)
        self.assert_refused(done, "working directory is gone")

    def test_closed_streams_never_end_up_in_files(self):
        arguments = small_render(out="a.exr", json="a.json")
        done = subprocess.run(["sh", "-c", '"$0" "$@" <&- >&- 2>&-', ICBENCH, *arguments],
                              cwd=self.folder, timeout=PATIENCE)
        self.assertEqual(done.returncode, 2)
        self.assertEqual(self.load("a.json")["width"], 16)
        self.succeed("compare", "a.exr", "a.exr")

    @unittest.skipIf(SANITIZED, "sanitizers need their terabytes of address space")
    def test_too_little_memory(self):
        limit = 600 << 20
        for arguments in (small_sweep(workloads=f"{SCENE}:size=16384x16384", out="a.json"),
                          small_sweep(workloads="miss_driven:operations=200000000", out="a.json"),
                          small_sweep(threads=8192, out="a.json"),
                          small_render(size="16384x16384", out="a.exr"),
                          small_render(size="8192x8192", integrator="whitted", out="a.exr"),
                          small_render(threads=8192, out="a.exr")):
            with self.subTest(arguments):
                done = self.run_icbench(
                    *arguments,
                    preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)))
                self.assert_refused(done)

    # Guards against: asking a scene that Embree had no memory for.
    @unittest.skipIf(SANITIZED, "sanitizers need their terabytes of address space")
    def test_memory_that_ends_in_the_middle(self):
        for limit in range(200 << 20, 400 << 20, 10 << 20):
            with self.subTest(limit):
                done = self.run_icbench(
                    *small_sweep(out="a.json"),
                    preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)))
                self.assertIn(done.returncode, (0, 2), done.stderr)

    @unittest.skipIf(SANITIZED, "sanitizers need their terabytes of address space")
    def test_a_cache_that_does_not_fit_is_named_before_anything_is_measured(self):
        (self.folder / "a.json").write_text("precious")
        limit = 3 << 30
        done = self.run_icbench(
            *small_sweep(workloads="read_only:records=50:operations=10,read_only:records=1000000:operations=10",
                         caches="brute_force,packed_wait_free", out="a.json"),
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)))
        self.assert_refused(done, "read_only:records=1000000", "packed_wait_free", "capacity")
        self.assertEqual((self.folder / "a.json").read_text(), "precious")


if __name__ == "__main__":
    unittest.main()
