#!/usr/bin/env python3
"""The icbench program end to end, as a user runs it."""

import itertools
import json
import math
import os
import statistics
import subprocess
import tempfile
import unittest
from pathlib import Path

from cli_support import (ICBENCH, PATIENCE, PRECIOUS, SCENE, Case, key_of, small_pareto, small_render,
                         small_repeatability, write_white_png)

# A room for Radiance's readers, with the light of its lamp to be filled in.
ROOM = """# view -vp 2 .2 1.5 -vd 0 1 0 -vu 0 0 1 -vh 60 -vv 60
void plastic walls 0 0 5 .7 .6 .5 0 0
void light glow 0 0 3 {0} {0} {0}
walls polygon floor 0 0 12 0 0 0  4 0 0  4 4 0  0 4 0
walls polygon ceiling 0 0 12 0 0 3  0 4 3  4 4 3  4 0 3
walls polygon left 0 0 12 0 0 0  0 4 0  0 4 3  0 0 3
walls polygon right 0 0 12 4 0 0  4 0 3  4 4 3  4 4 0
walls polygon back 0 0 12 0 4 0  4 4 0  4 4 3  0 4 3
walls sphere ball 0 0 4 2.5 2.5 .5 .5
glow ring lamp 0 0 8 2 2 2.9  0 0 -1  0 .5
"""


class Sweep(Case):
    """One sweep over every kind of workload, looked at from all sides."""

    CACHES = ["null", "sequential", "global_mutex", "node_lock", "local_write", "wait_free"]
    THREADS = [1, 2, 8]
    SYNTHETIC = ["read_only:records=2000:operations=2000", "insert_only:records=2000",
                 "mix_90_10:records=2000:operations=2000", "miss_driven:cost=0:operations=2000"]
    RAY_TRACED = SCENE + ":rays=4:size=32x32"
    PATH = SCENE + ":integrator=path:spp=1:size=32x32"
    CELLS = SCENE + ":integrator=hash_cells:spp=1:size=32x32"
    REPETITIONS = 2
    PERCENTILES = ["p10", "p25", "p50", "p75", "p90", "p95", "p99", "p999", "max"]

    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory(prefix="icbench-cli-") as folder:
            done = subprocess.run(
                [ICBENCH, "sweep", "--caches", ",".join(cls.CACHES), "--threads", "1,2,8", "--workloads",
                 ",".join([*cls.SYNTHETIC, cls.RAY_TRACED, cls.PATH, cls.CELLS]), "--repetitions", str(cls.REPETITIONS),
                 "--reference-spp", "2", "--latency-every", "4", "--out", "out.json"],
                cwd=folder, capture_output=True, text=True, timeout=PATIENCE)
            if done.returncode != 0:
                raise AssertionError(done.stderr)
            cls.left_behind = os.listdir(folder)
            results = json.loads((Path(folder) / "out.json").read_text())
        cls.context, cls.rows = results["context"], results["benchmarks"]

    def cached_rows(self, *workloads, keeps=True):
        rows = [r for r in self.rows if r["workload"] in workloads and (r["cache"] != "null" or not keeps)]
        self.assertTrue(rows)
        return rows

    def test_leaves_one_complete_file(self):
        self.assertEqual(self.left_behind, ["out.json"])
        self.assertIs(self.context["complete"], True)

    def test_context_tells_where_the_results_come_from(self):
        google_benchmark = {"date", "host_name", "executable", "num_cpus", "mhz_per_cpu",
                            "cpu_scaling_enabled", "caches", "load_avg", "library_build_type"}
        ours = {"schema_version", "commit", "compiler", "compiler_flags", "cpu_model", "governor", "pin_map",
                "seed", "command_line", "configuration", "work_calibration", "tick_rate"}
        self.assertLessEqual(google_benchmark | ours, self.context.keys())
        self.assertEqual(self.context["command_line"][1], "sweep")

    def test_one_entry_per_point_and_repetition(self):
        expected = set()
        for workload, threads in itertools.product([*self.SYNTHETIC, self.RAY_TRACED], self.THREADS):
            for cache in self.CACHES:
                if cache != "sequential" or threads == 1:
                    expected.add(f"sweep/{workload}/{cache}/threads:{threads}")
        expected |= {f"sweep/{uncached}/none/threads:{threads}" for threads in self.THREADS
                     for uncached in (self.PATH, self.CELLS)}
        keys = [key_of(row) for row in self.rows]
        self.assertEqual(len(keys), len(set(keys)))
        self.assertEqual(set(keys), set(itertools.product(expected, range(self.REPETITIONS))))

    def test_fields_of_every_entry(self):
        always = {"name", "run_name", "run_type", "repetitions", "repetition_index", "threads", "iterations",
                  "real_time", "cpu_time", "time_unit", "items_per_second", "cache", "workload", "structure",
                  "mechanism", "placement", "oversubscribed", "utilisation"}
        cached = {"queries", "hits", "inserts", "records", "lock_wait_share", "cas_attempts", "cas_failures",
                  "nodes_discarded"}
        ray_traced = {"scene", "integrator", "width", "height", "rays", "seconds_indirect", "rmse", "relmse",
                      "mean_ratio"}
        for row in self.rows:
            fields = set(always)
            if row["workload"] not in (self.PATH, self.CELLS):
                fields |= cached
                if row["records"]:
                    fields.add("bytes_per_record")
                for operation, count in ("query", row["queries"]), ("insert", row["inserts"]):
                    if count >= 1000:  # so many that some were certainly timed
                        fields |= {f"latency_{operation}_{p}_ns" for p in self.PERCENTILES}
            if row["workload"] in (self.RAY_TRACED, self.PATH, self.CELLS):
                fields |= ray_traced
            if row["workload"] in (self.SYNTHETIC[3], self.RAY_TRACED) and row["cache"] != "null":
                fields.add("redundant_records")
            self.assertLessEqual(fields, row.keys(), row["name"])
            self.assertEqual(row["iterations"], 1)
            self.assertEqual(row["name"],
                             f"sweep/{row['workload']}/{row['cache']}/threads:{row['threads']}")

    def test_times_and_shares_are_possible(self):
        units = self.context["allowed"]["units"]
        for row in self.rows:
            with self.subTest(row["name"]):
                self.assertGreater(row["real_time"], 0)
                self.assertGreater(row["utilisation"], 0)
                self.assertLessEqual(row["utilisation"], 1)
                self.assertEqual(row["oversubscribed"], row["threads"] > units)
                self.assertLessEqual(0, row.get("lock_wait_share", 0))
                self.assertLessEqual(row.get("lock_wait_share", 0), 1)
                self.assertGreaterEqual(row.get("bytes_per_record", 44), 44)
                for operation in "query", "insert":
                    latencies = [row.get(f"latency_{operation}_{p}_ns", 0)
                                 for p in self.PERCENTILES]
                    self.assertEqual(latencies, sorted(latencies))

    def test_operations_add_up_to_the_rate(self):
        for row in self.rows:
            if row["cache"] == "null":
                continue  # refuses its inserts
            operations = row["queries"] + row["inserts"] if "queries" in row else 32 * 32
            self.assertAlmostEqual(row["items_per_second"] * 1e-3 * row["real_time"], operations, places=3)

    def test_counts_fit_the_workload(self):
        for row in self.cached_rows(self.SYNTHETIC[0]):
            self.assertEqual((row["queries"], row["inserts"], row["records"]), (2000, 0, 2000))
        for row in self.cached_rows(self.SYNTHETIC[1]):
            self.assertEqual((row["queries"], row["inserts"], row["records"]), (0, 2000, 2000))
        for row in self.cached_rows(self.SYNTHETIC[2]):
            self.assertEqual((row["queries"], row["inserts"], row["records"]), (1800, 200, 2200))
        for row in self.cached_rows(self.SYNTHETIC[3], self.RAY_TRACED):
            self.assertEqual(row["inserts"], row["queries"] - row["hits"])
            self.assertEqual(row["records"], row["inserts"])
            self.assertGreater(row["hits"], 0)
        for row in self.cached_rows(self.SYNTHETIC[3]):
            self.assertEqual(row["queries"], 2000)
        for row in self.rows:
            self.assertLessEqual(row.get("hits", 0), row.get("queries", 0))

    def test_null_never_hits_and_keeps_nothing(self):
        for row in self.rows:
            if row["cache"] == "null":
                self.assertEqual((row["hits"], row["records"]), (0, 0))

    def test_every_cache_and_thread_count_finds_the_same(self):
        for repetition in range(self.REPETITIONS):
            hits = {row["hits"] for row in self.cached_rows(self.SYNTHETIC[0])
                    if row["repetition_index"] == repetition}
            self.assertEqual(len(hits), 1)

    def test_one_thread_needs_no_redundant_records(self):
        for row in self.cached_rows(self.SYNTHETIC[3], self.RAY_TRACED):
            if row["threads"] == 1:
                self.assertEqual(row["redundant_records"], 0, row["name"])

    def test_local_write_repeats_work(self):
        for row in self.cached_rows(self.SYNTHETIC[3]):
            if row["cache"] == "local_write" and row["threads"] == 8:
                self.assertGreater(row["redundant_records"], 0)

    def test_only_locks_are_waited_for_and_only_atomics_exchanged(self):
        for row in self.rows:
            if row["cache"] in ("null", "sequential", "local_write", "wait_free"):
                self.assertEqual((row["lock_wait_share"], row["lock_acquisitions"]), (0, 0), row["name"])
            if row["cache"] == "global_mutex":
                self.assertEqual(row["lock_acquisitions"], row["queries"] + row["inserts"])
            if row["cache"] in ("null", "sequential", "global_mutex"):
                self.assertEqual((row["cas_failures"], row["nodes_discarded"]), (0, 0), row["name"])
            self.assertLessEqual(row.get("cas_failures", 0), row.get("cas_attempts", 0))
        for row in self.cached_rows(self.SYNTHETIC[1]):
            if row["cache"] == "wait_free":
                self.assertGreater(row["cas_attempts"], 0)


class Render(Case):
    def test_writes_a_picture_and_what_it_cost(self):
        for name, magic in ("a.exr", b"\x76\x2f\x31\x01"), ("a.png", b"\x89PNG"):
            self.succeed(*small_render(threads=2, out=name, json="a.json"))
            self.assertEqual((self.folder / name).read_bytes()[:4], magic)
        cost = self.load("a.json")
        asked = {"scene": SCENE, "integrator": "irradiance_cache", "cache": "wait_free", "threads": 2,
                 "width": 16, "height": 16, "spp": 1}
        self.assertEqual({key: cost[key] for key in asked}, asked)
        self.assertGreater(cost["seconds"], 0)
        self.assertGreater(cost["seconds_indirect"], 0)
        self.assertLess(cost["seconds_indirect"], cost["seconds"])
        self.assertEqual(cost["records"], cost["queries"] - cost["hits"])
        self.assertGreaterEqual(cost["rays"], 4 * cost["records"])

    def test_without_a_cache_none_is_reported(self):
        self.succeed(*small_render(integrator="whitted", out="a.exr", json="a.json"))
        self.assertFalse({"cache", "records", "queries"} & self.load("a.json").keys())

    def test_threads_and_tile_order_change_no_bit(self):
        pictures = set()
        for threads, tiles in (1, "morton"), (3, "morton"), (2, "random"):
            self.succeed(*small_render(size="40x24", integrator="path", threads=threads, tiles=tiles,
                                       out="a.exr"))
            pictures.add((self.folder / "a.exr").read_bytes())
        self.assertEqual(len(pictures), 1)

    def test_deterministic_pictures_depend_on_neither_threads_nor_cache(self):
        pictures, records = set(), set()
        for threads, cache in (1, "wait_free"), (5, "packed_local_write"):
            self.succeed(*small_render(size="48x32", threads=threads, cache=cache, out="a.exr", json="a.json"),
                         "--deterministic", "--overture")
            pictures.add((self.folder / "a.exr").read_bytes())
            cost = self.load("a.json")
            records.add(cost["records"])
            self.assertTrue(cost["deterministic"] and cost["overture"])
        self.assertEqual((len(pictures), len(records)), (1, 1))

    def test_a_loaded_cache_spares_the_work(self):
        for options in {"integrator": "irradiance_cache"}, {"integrator": "instant_caching", "vpls": 8}:
            plain = small_render(threads=1, cache="packed_wait_free", out="a.exr", json="a.json", **options)
            self.succeed(*plain, "--save-cache", "room.cache")
            cold = self.load("a.json")
            self.succeed(*plain, "--load-cache", "room.cache", "--save-cache", "again.cache")
            warm = self.load("a.json")
            self.assertGreater(cold["records"], 0)
            self.assertEqual((warm["records_loaded"], warm["records"], warm["hits"]),
                             (cold["records"], cold["records"], warm["queries"]))
            size = (self.folder / "room.cache").stat().st_size
            self.assertEqual(size, 160 + 44 * cold["records"])
            self.assertEqual((self.folder / "again.cache").stat().st_size, size)
        # Another picture of the same room, by another cache: with new records only where there were none.
        self.succeed(*small_render(size="32x32", threads=2, cache="global_mutex", out="b.exr", json="b.json"),
                     "--load-cache", "room.cache")
        more = self.load("b.json")
        self.assertEqual(more["records"], cold["records"] + more["queries"] - more["hits"])

    def test_one_thread_repeats_itself_and_the_seed_matters(self):
        def picture(seed):
            self.succeed(*small_render(threads=1, seed=seed, out="a.exr"))
            return (self.folder / "a.exr").read_bytes()

        self.assertEqual(picture(1), picture(1))
        self.assertNotEqual(picture(1), picture(2))

    def test_white_furnace_is_white(self):
        """Radiance is 1 everywhere there, whoever computes it."""
        width, height = 24, 16
        write_white_png(self.folder / "white.png", width, height)
        for integrator in "path", "irradiance_cache":
            self.succeed(*small_render(scene="white_furnace", integrator=integrator, size=f"{width}x{height}",
                                       spp=16, rays=64, threads=2, out="f.exr"))
            self.succeed("compare", "white.png", "f.exr", "--json", "f.json")
            figures = self.load("f.json")
            self.assertAlmostEqual(figures["mean_ratio"], 1, delta=0.02)
            self.assertLess(figures["rmse"], 0.2)

    def residual_of(self, **changes):
        """What the JSON tells, of a scene with mirrors and glass."""
        self.succeed(*small_render(scene="cornell_specular", json="a.json", **{"residual": 1, **changes}))
        return self.load("a.json")

    def test_with_its_residual_every_method_has_the_light_of_path_tracing(self):
        """Every pixel drawn, what is added makes the mean that of the same paths, whatever was there."""
        # With no indirect light of its own, all of it is missing.
        truth = self.residual_of(integrator="whitted")
        self.assertEqual(truth["indirect_mean"], 0)
        self.assertIsNone(truth["residual_mean_share"])
        for integrator in ("irradiance_cache", "instant_caching", "temporal_instant_caching", "hash_cells",
                           "instant_gi", "instant_gi_interleaved"):
            with self.subTest(integrator):
                mine = self.residual_of(integrator=integrator, accuracy=0.4, vpls=16)
                self.assertGreater(mine["indirect_mean"], 0)
                self.assertAlmostEqual(mine["indirect_mean"] + mine["residual_mean"], truth["residual_mean"],
                                       delta=1e-5 * truth["residual_mean"])
        self.assertGreater(mine["residual_samples"], 0)
        self.assertGreater(mine["residual_rays"], 0)
        blocks = mine["residual_blocks"]
        self.assertEqual([blocks["edge"], blocks["columns"], blocks["rows"]], [2, 8, 8])
        self.assertEqual([len(blocks["mean"]), len(blocks["standard_error"])], [64, 64])
        self.assertAlmostEqual(statistics.mean(blocks["mean"]), mine["residual_mean"], delta=1e-6)
        self.assertAlmostEqual(statistics.mean(mine["residual_mean_rgb"]), mine["residual_mean"], delta=1e-6)

    def test_path_tracing_lacks_nothing(self):
        f = self.residual_of(integrator="path", spp=64)
        self.assertLess(abs(f["residual_mean"]), 4 * f["residual_standard_error"])
        self.assertLess(4 * f["residual_standard_error"], 0.1 * f["indirect_mean"])

    def test_unbiased_pictures_agree(self):
        """All direct light is the same, and all indirect light that of the same paths."""
        rmse = {}
        for unbiased in (), ("--unbiased",):
            for name, changes in ("a", {"rays": 4}), ("b", {"integrator": "instant_caching", "vpls": 8}):
                self.succeed(*small_render(scene="cornell_specular", residual=1, out=f"{name}.exr", **changes),
                             *unbiased)
            self.succeed("compare", "a.exr", "b.exr", "--metrics", "rmse", "--json", "f.json")
            rmse[unbiased] = self.load("f.json")["rmse"]
        self.assertLess(rmse["--unbiased",], 1e-5)
        self.assertGreater(rmse[()], 0.01)

    def test_threads_change_no_bit_of_the_layer_where_the_picture_does_not_race(self):
        for threads in 1, 3:
            self.succeed(*small_render(scene="cornell_specular", size="40x24", integrator="hash_cells", residual=0.3,
                                       threads=threads, spp=3, out=f"{threads}.exr",
                                       **{"residual-out": f"layer_{threads}.exr"}))
        read = lambda name: (self.folder / name).read_bytes()
        self.assertEqual(read("layer_1.exr"), read("layer_3.exr"))
        self.assertEqual(read("1.exr"), read("3.exr"))

    def test_the_residual_changes_no_bit_of_the_picture(self):
        for name, extra in ("a.exr", ()), ("b.exr", ("--residual", "0.5")):
            self.succeed(*small_render(scene="cornell_specular", threads=1, out=name), *extra)
        self.assertEqual((self.folder / "a.exr").read_bytes(), (self.folder / "b.exr").read_bytes())

    def test_given_options_without_effect_are_named_in_one_line(self):
        small = ("--size", "16x16", "--spp", "1", "--out", "a.exr")
        for integrator, given, said in (
                ("whitted", ["--vpls", "3"], "--vpls has"),
                ("path", ["--cache", "wait_free", "--accuracy", "0.2", "--interpolation", "gradients",
                          "--deterministic", "--overture", "--rays", "4", "--leak-guard", "--cell-size", "4"],
                 "--cache, --accuracy, --interpolation, --deterministic, --overture, --rays, --leak-guard, --cell-size "
                 "have"),
                ("instant_gi", ["--vpls", "4", "--rays", "4"], "--rays has"),
                ("instant_caching", ["--vpls", "4", "--paths", "2", "--accuracy", "0.2"], "--paths has"),
                ("irradiance_cache", ["--rays", "4", "--leak-guard", "--vpls", "4"], "--vpls has"),
                ("hash_cells", ["--paths", "2", "--cell-size", "4", "--no-leak-guard"], "--no-leak-guard has"),
                ("whitted", [], None)):
            with self.subTest(integrator, given=given):
                done = self.run_icbench("render", "--integrator", integrator, *small, *given)
                self.assertEqual(done.returncode, 0)
                self.assertEqual([line for line in done.stderr.splitlines() if "effect" in line],
                                 [f"icbench: {said} no effect on {integrator}"] if said else [])

    def test_leaks_are_guarded_against_where_records_overlap_unless_told_otherwise(self):
        for level, given, guarded in (("gradients", [], False), ("gradients", ["--leak-guard"], True),
                                      ("split_sphere", [], False), ("geometric_hessian", [], True),
                                      ("occlusion_hessian", [], True), ("occlusion_hessian", ["--no-leak-guard"], False)):
            with self.subTest(level, given=given):
                self.succeed(*small_render(size="32x32", rays=64, interpolation=level, json="a.json"), *given)
                cost = self.load("a.json")
                self.assertIs(cost["leak_guard"], guarded)
                self.assertEqual(cost["leak_tests"] > 0, guarded)

    def test_overwrites_its_own_pictures(self):
        (self.folder / "a.png").write_text(PRECIOUS)
        self.succeed(*small_render(out="a.png"))
        self.assertEqual((self.folder / "a.png").read_bytes()[:4], b"\x89PNG")
        self.assertEqual(os.listdir(self.folder), ["a.png"])


class Compare(Case):
    def test_equal_pictures_have_no_error(self):
        self.succeed(*small_render(out="a.exr"))
        said = self.succeed("compare", "a.exr", "a.exr", "--metrics", "rmse,relmse,mean_ratio",
                            "--json", "c.json")
        self.assertEqual(said, "rmse 0\nrelmse 0\nmean_ratio 1\n")
        figures = self.load("c.json")
        self.assertEqual((figures["rmse"], figures["relmse"], figures["mean_ratio"]), (0, 0, 1))

    def test_different_pictures_have_one(self):
        for seed in 1, 2:
            self.succeed(*small_render(seed=seed, out=f"{seed}.exr"))
        self.succeed("compare", "1.exr", "2.exr", "--json", "c.json")
        self.assertGreater(self.load("c.json")["rmse"], 0)

    def test_folders_are_compared_frame_by_frame(self):
        for folder, seeds in ("a", (1, 1)), ("b", (1, 2)):
            os.mkdir(self.folder / folder)
            for frame, seed in enumerate(seeds):
                self.succeed(*small_render(seed=seed, out=f"{folder}/frame_{frame:04}.exr"))
        said = self.succeed("compare", "a", "b", "--metrics", "rmse,flip,hdrvdp", "--json", "c.json", "--map", "maps")
        self.assertEqual(said.splitlines()[0], "frame_0000.exr  rmse 0  flip 0  hdrvdp.p75 0  hdrvdp.p95 0")
        figures = self.load("c.json")
        first, second = figures["frames"]
        self.assertEqual((first["rmse"], first["flip"], first["hdrvdp"]), (0, 0, {"p75": 0, "p95": 0}))
        self.assertAlmostEqual(figures["flip"], second["flip"] / 2, delta=1e-9)
        self.assertAlmostEqual(figures["flicker"], second["rmse"], delta=1e-6 * second["rmse"])
        self.assertEqual(sorted(os.listdir(self.folder / "maps/hdrvdp")),
                         [f"frame_000{i}.{kind}" for i in (0, 1) for kind in ("exr", "png")])


class Help(Case):
    COMMANDS = ["list", "sweep", "simulate", "render", "animate", "compare", "preempt", "trace"]
    TRACE_COMMANDS = ["capture", "info", "replay"]

    def test_without_arguments_help_goes_to_standard_error(self):
        done = self.run_icbench()
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertEqual(done.stderr, self.succeed("--help"))

    def test_help_is_there_and_fits_the_screen(self):
        for arguments in ([], *([command] for command in self.COMMANDS),
                          *(["trace", command] for command in self.TRACE_COMMANDS)):
            for option in "--help", "-h":
                text = self.succeed(*arguments, option)
                self.assertIn("Usage: " + " ".join(["icbench", *arguments]), text)
                self.assertLessEqual(max(map(len, text.splitlines())), 100, text)
        for command in self.COMMANDS:
            self.assertIn(command, self.succeed("--help"))

    def test_version(self):
        self.assertRegex(self.succeed("--version"), r"\Aicbench \d+\.\d+\.\d+, commit \w+.*\n\Z")

    def test_lists(self):
        known = {"caches": "wait_free", "scenes": "cornell_box", "integrators": "path",
                 "workloads": "miss_driven", "metrics": "rmse"}
        for what, name in known.items():
            rows = json.loads(self.succeed("list", what, "--json"))
            self.assertIn(name, [row["name"] for row in rows])
            text = self.succeed("list", what).splitlines()
            self.assertEqual([line.split()[0] for line in text], ["name", *(row["name"] for row in rows)])

    def test_every_workload_can_be_named_with_its_listed_parameters(self):
        rows = json.loads(self.succeed("list", "workloads", "--json"))
        names = [":".join([row["name"], *row["parameters"].split()]) for row in rows]
        # Parsed before the cache's name, which is refused.
        self.refuse("sweep", "--workloads", ",".join(names), "--caches", "nul", says=["did you mean 'null'?"])


class Pareto(Case):
    """Speed against error of a few methods on a few pixels, looked at from all sides."""

    METHODS = ["path", "hash_cells", "instant_caching", "temporal_instant_caching"]
    SETTINGS = 5 + 6 + 4 + 4

    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory(prefix="icbench-cli-") as folder:
            done = subprocess.run(
                [ICBENCH, *small_pareto(methods=",".join(cls.METHODS), repetitions=3, threads=1,
                                        **{"reference-spp": 64}, out="p.json", images="shots")],
                cwd=folder, capture_output=True, text=True, timeout=PATIENCE)
            if done.returncode != 0:
                raise AssertionError(done.stderr)
            results = json.loads((Path(folder) / "p.json").read_text())
            cls.left_behind = sorted(os.listdir(folder))
            cls.shots = {path.name: path.stat().st_size for path in (Path(folder) / "shots").iterdir()}
            cls.index = json.loads((Path(folder) / "shots/images.json").read_text())
        cls.printed = done.stdout
        cls.context, cls.rows = results["context"], results["benchmarks"]

    def of(self, method):
        return [row for row in self.rows if row["method"] == method]

    def medians(self, field):
        values = {}
        for row in self.rows:
            values.setdefault(row["name"], []).append(row[field])
        return {name: statistics.median(v) for name, v in values.items()}

    def test_one_entry_per_setting_and_repetition(self):
        self.assertEqual(self.left_behind, ["p.json", "shots"])
        self.assertIs(self.context["complete"], True)
        self.assertEqual(len({key_of(row) for row in self.rows}), len(self.rows))
        names = {row["name"] for row in self.rows}
        self.assertEqual(len(names), self.SETTINGS)
        self.assertEqual(len(self.rows), 3 * self.SETTINGS)
        self.assertIn(f"pareto/{SCENE}/hash_cells/cell_size:8/spp:16", names)
        self.assertIn(f"pareto/{SCENE}/instant_caching/accuracy:0.1/vpls:64", names)

    def test_fields_of_every_entry(self):
        always = {"scene", "method", "integrator", "cache", "width", "height", "frame", "seed", "seconds",
                  "seconds_indirect", "rays", "rmse", "relmse", "relmse_scale", "full_relmse_scale", "flip",
                  "hdrvdp_p75", "hdrvdp_p95", "mean_ratio",
                  "full_rmse", "full_relmse", "full_flip", "full_mean_ratio", "reference_spp", "reference_rmse",
                  "rmse_irradiance", "relmse_irradiance", "reference_rmse_irradiance", "reference_relmse_irradiance",
                  "reference_relmse", "full_reference_relmse", "below_reference", "real_time", "cpu_time", "threads"}
        own = {"path": {"spp"}, "hash_cells": {"spp", "cell_size", "records"},
               "instant_caching": {"vpls", "accuracy", "records"},
               "temporal_instant_caching": {"vpls", "accuracy", "records"}}
        for row in self.rows:
            fields = always | own[row["method"]]
            fields |= {"bias", "deviation", "bias_runs"} if row["repetition_index"] else set()
            self.assertLessEqual(fields, row.keys(), row["name"])
            parameters = "/".join(f"{part.split(':')[0]}:{row[part.split(':')[0]]}"
                                  for part in row["name"].split("/")[3:])
            self.assertEqual(row["name"], f"pareto/{SCENE}/{row['method']}/{parameters}")
            self.assertGreater(row["seconds"], row["seconds_indirect"])
            self.assertEqual(row["below_reference"], row["relmse"] < 2 * row["reference_relmse"])
            self.assertGreater(row["rmse_irradiance"], math.pi * row["rmse"])  # no surface reflects all light
            # Relative errors of a pixel are those of its surface's irradiance.
            self.assertLess(abs(math.log(row["relmse_irradiance"] / row["relmse"])), math.log(2))
            self.assertEqual(row["cache"], "wait_free" if "caching" in row["method"] else "none")
            self.assertEqual(row.get("interpolation"), "split_sphere" if "caching" in row["method"] else None)

    def test_errors_are_squared_bias_and_variance_and_the_references_own(self):
        for name in {row["name"] for row in self.rows}:
            mine = sorted((row for row in self.rows if row["name"] == name), key=lambda r: r["repetition_index"])
            last = mine[-1]
            self.assertEqual(last["bias_runs"], 3)
            if last["bias"] > 0:
                mean = statistics.fmean(row["rmse"] ** 2 for row in mine)
                parts = last["bias"] ** 2 + last["deviation"] ** 2 + last["reference_rmse"] ** 2
                self.assertAlmostEqual(parts / mean, 1, places=6)

    def test_more_samples_are_nearer(self):
        for few, many in (("path/spp:1", "path/spp:64"), ("hash_cells/cell_size:8/spp:1", "path/spp:64"),
                          ("path/spp:1", "hash_cells/cell_size:8/spp:1")):
            error = self.medians("rmse")
            self.assertLess(error[f"pareto/{SCENE}/{many}"], error[f"pareto/{SCENE}/{few}"])
        for row in self.of("path"):
            if row["spp"] >= 64:
                self.assertAlmostEqual(row["mean_ratio"], 1, delta=0.1)

    def test_standard_output_is_one_valid_document(self):
        results = json.loads(self.succeed(*small_pareto(methods="path", size="8x8", out="/dev/stdout")))
        self.assertEqual(len(results["benchmarks"]), 5)

    def test_the_warm_frame_traces_less(self):
        rays = self.medians("rays")
        for name in rays:
            if "/temporal_instant_caching/" in name:
                self.assertLess(rays[name], 0.9 * rays[name.replace("/temporal_", "/")])

    def test_the_front_is_what_no_other_point_beats_in_both(self):
        seconds, error = self.medians("seconds_indirect"), self.medians("relmse")
        front = {n for n in seconds if not any(seconds[o] < seconds[n] and error[o] < error[n] for o in seconds)}
        lines = [line.split() for line in self.printed.splitlines() if "pareto/" in line]
        self.assertEqual({line[-1] for line in lines}, front)
        self.assertEqual([float(line[0]) for line in lines], sorted(float(line[0]) for line in lines))

    def test_pictures_are_the_best_that_the_budget_pays(self):
        seconds, error = self.medians("seconds_indirect"), self.medians("relmse")
        self.assertGreater(self.shots["reference.png"], 0)
        self.assertEqual([budget["spp"] for budget in self.index["budgets"]], [16, 64])
        for budget in self.index["budgets"]:
            limit = seconds[f"pareto/{SCENE}/path/spp:{int(budget['spp'])}"]
            self.assertEqual(sorted(p["method"] for p in budget["pictures"]), sorted(self.METHODS))
            for picture in budget["pictures"]:
                mine = [error[n] for n, s in seconds.items() if f"/{picture['method']}/" in n and s <= limit]
                self.assertEqual("image" in picture, bool(mine))
                if mine:
                    chosen = f"pareto/{SCENE}/{picture['method']}/{picture['setting']}"
                    self.assertEqual(error[chosen], min(mine))
                    self.assertLessEqual(seconds[chosen], limit)
                    self.assertGreater(min(self.shots[picture["image"]], self.shots[picture["map"]]), 0)

    def test_relmse_does_not_depend_on_how_bright_the_light_is(self):
        """Every method, in a room and in the same with 1,000 times the light: with the epsilon as it is for pictures
        about as bright as white, the dark one's would be its squared error.
        """
        def room(light):
            (self.folder / "room.rad").write_text(ROOM.format(light))
            self.succeed(*small_pareto(scene="room.rad", methods="all", size="12x12", threads=1,
                                       **{"reference-spp": 16}, out="r.json"))
            return {row["name"]: row for row in self.load("r.json")["benchmarks"]}

        dim, bright = room(0.02), room(20)
        self.assertEqual(dim.keys(), bright.keys())
        self.assertLess(next(iter(dim.values()))["reference_rmse"], 0.01)
        for name, row in dim.items():
            self.assertAlmostEqual(row["relmse_scale"] / bright[name]["relmse_scale"], 1000, delta=0.1)
            self.assertAlmostEqual(bright[name]["rmse"] / row["rmse"], 1000, delta=1, msg=name)
            for field in "relmse", "full_relmse", "reference_relmse", "full_reference_relmse":
                self.assertAlmostEqual(bright[name][field] / row[field], 1, delta=1e-3, msg=(name, field))
            # The epsilon weighs little: each pixel counts by its own brightness.
            self.assertGreater(row["relmse"], 20 * row["rmse"] ** 2, name)

    def test_errors_do_not_depend_on_threads_where_nothing_is_raced_for(self):
        self.succeed(*small_pareto(repetitions=3, threads=3, **{"reference-spp": 64}, out="many.json"))
        fields = ["rmse", "relmse", "flip", "mean_ratio", "full_rmse", "rays", "reference_relmse", "seed"]
        many = {key_of(row): [row[f] for f in fields] for row in self.load("many.json")["benchmarks"]}
        one = {key_of(row): [row[f] for f in fields] for row in self.of("path") + self.of("hash_cells")}
        self.assertEqual(one, many)
        seeds = {row["repetition_index"]: row["seed"] for row in self.rows}
        self.assertEqual(len(set(seeds.values())), 3, "runs are to be independent")


class Repeatability(Case):
    """Pictures of one seed by every cache, with one thread and with three."""

    KINDS = ["rms_to_single", "rms_to_last_run", "rms_to_fewer_threads"]

    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory(prefix="icbench-cli-") as folder:
            listed = subprocess.run([ICBENCH, "list", "caches", "--json"], capture_output=True, text=True,
                                    timeout=PATIENCE, check=True)
            cls.caches = {cache["name"]: cache for cache in json.loads(listed.stdout)}
            done = subprocess.run(
                [ICBENCH, *small_repeatability(caches=",".join(cls.caches), repetitions=3, out="r.json",
                                               **{"reference-spp": 64})],
                cwd=folder, capture_output=True, text=True, timeout=PATIENCE)
            if done.returncode != 0:
                raise AssertionError(done.stderr)
            results = json.loads((Path(folder) / "r.json").read_text())
        cls.printed, cls.said = done.stdout, done.stderr
        cls.context, cls.rows = results["context"], results["benchmarks"]

    def test_every_cache_on_every_number_of_threads_and_those_for_one_with_one(self):
        self.assertIs(self.context["complete"], True)
        expected = set()
        for name, cache in self.caches.items():
            for threads in (1,) if cache["single_thread"] else (1, 3):
                expected |= {(f"repeatability/{SCENE}/irradiance_cache/{name}/threads:{threads}", i)
                             for i in range(3)}
            self.assertEqual(f"note: {name} serves one thread" in self.said, cache["single_thread"], name)
        self.assertEqual(sorted(map(key_of, self.rows)), sorted(expected))
        for name, _ in expected:
            self.assertIn(name, self.printed)

    def test_with_one_thread_nothing_is_left_to_chance(self):
        for row in self.rows:
            if row["threads"] != 1:
                continue
            with self.subTest(row["name"]):
                self.assertEqual(row["rms_to_single"], 0)
                self.assertEqual(row.get("rms_to_last_run", 0), 0)
                self.assertEqual(row["redundant_records"], 0)
                self.assertEqual("rms_to_last_run" in row, row["repetition_index"] > 0)
                self.assertNotIn("rms_to_fewer_threads", row)

    def test_without_a_cache_threads_change_nothing(self):
        mine = [row for row in self.rows if row["cache"] == "null" and row["threads"] == 3]
        self.assertEqual(len(mine), 3)
        for row in mine:
            self.assertEqual([row["rms_to_single"], row["rms_to_fewer_threads"]], [0, 0])
            self.assertEqual(row["redundant_records"], 0)

    def test_errors_and_shares_fit(self):
        one = {row["cache"]: row for row in self.rows if row["threads"] == 1}
        for row in self.rows:
            self.assertGreater(row["reference_rmse"], 0)
            self.assertAlmostEqual(row["error"]**2, row["rmse"]**2 - row["reference_rmse"]**2, delta=1e-9)
            self.assertEqual(row["redundant_records"], row["records_made"] - one[row["cache"]]["records_made"])
            for kind in self.KINDS:
                if kind in row:
                    self.assertAlmostEqual(row[kind + "_share_of_mean"], row[kind] / row["mean"])
                    self.assertAlmostEqual(row[kind + "_share_of_error"], row[kind] / row["error"])

    def test_instant_caching_is_measured_likewise(self):
        self.succeed(*small_repeatability(integrator="instant_caching", vpls=8, threads=1, out="r.json"))
        rows = self.load("r.json")["benchmarks"]
        self.assertEqual([row["rms_to_single"] for row in rows], [0, 0])
        self.assertEqual({row["vpls"] for row in rows}, {8})
        self.assertTrue(all("rays_per_record" not in row for row in rows))

    def test_standard_output_is_one_valid_document(self):
        results = json.loads(self.succeed(*small_repeatability(size="8x8", json="/dev/stdout")))
        self.assertEqual(len(results["benchmarks"]), 4)


if __name__ == "__main__":
    unittest.main()
