#!/usr/bin/env python3
"""icbench pareto and icbench repeatability, end to end."""

import json
import math
import os
import statistics
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

from cli_support import ICBENCH, PATIENCE, SCENE, Case, key_of, small_pareto, small_repeatability

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
            fields |= {"bias", "bias_squared", "bias_squared_error", "deviation", "bias_runs"} if row["repetition_index"] else set()
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
            mean = statistics.fmean(row["rmse"] ** 2 for row in mine)
            parts = last["bias_squared"] + last["deviation"] ** 2 + last["reference_rmse"] ** 2
            self.assertAlmostEqual(parts / mean, 1, places=5)
            self.assertAlmostEqual(last["bias"], math.sqrt(max(0, last["bias_squared"])), places=9)
            self.assertGreater(last["bias_squared_error"], 0)
            if last["method"] == "path":  # has none
                self.assertLess(abs(last["bias_squared"]), 4 * last["bias_squared_error"])

    def test_a_bias_is_told_from_noise(self):
        biased = [row for row in self.of("hash_cells") if row.get("bias_runs") == 3 and row["spp"] > 1]
        self.assertTrue(any(row["bias_squared"] > 3 * row["bias_squared_error"] for row in biased), biased)

    def test_more_samples_are_nearer(self):
        for few, many in (("path/spp:1", "path/spp:64"), ("hash_cells/cell_size:8/spp:1", "path/spp:64"),
                          ("path/spp:1", "hash_cells/cell_size:8/spp:1")):
            error = self.medians("rmse")
            self.assertLess(error[f"pareto/{SCENE}/{many}"], error[f"pareto/{SCENE}/{few}"])
        for row in self.of("path"):
            if row["spp"] >= 64:
                self.assertAlmostEqual(row["mean_ratio"], 1, delta=0.1)

    def test_standard_output_is_one_valid_document(self):
        os.makedirs(self.folder / "results")
        run = small_pareto(methods="path", size="8x8", out="results/../results/p.json")
        self.succeed(*run)
        self.succeed(*run, "--resume", "--images", "shots")
        self.assertEqual(self.load("results/p.json")["context"]["images"], "../shots", "where the report looks")
        results = json.loads(self.succeed(*small_pareto(methods="path", size="8x8", out="/dev/stdout")))
        self.assertEqual(len(results["benchmarks"]), 5)

    # Guards against: an index of earlier pictures among those of a run that was killed.
    def test_an_index_of_pictures_goes_before_they_do(self):
        options = {"methods": "path", "size": "8x8", "out": "p.json", "images": "shots"}
        self.succeed(*small_pareto(**options))
        index = self.folder / "shots/images.json"
        self.assertTrue(index.exists())
        other = subprocess.Popen([ICBENCH, *small_pareto(**options, frame=1, repetitions=4096)], cwd=self.folder,
                                 stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(other.wait)
        self.addCleanup(other.kill)
        deadline = time.monotonic() + PATIENCE
        while index.exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        self.assertFalse(index.exists())

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

    def test_given_options_without_effect_are_named(self):
        self.succeed_but_for(["--rays has no effect on instant_caching"],
                             *small_repeatability(integrator="instant_caching", vpls=8, threads=1), "--rays", 4)
        self.succeed_but_for(["--vpls has no effect on irradiance_cache"], *small_repeatability(threads=1), "--vpls", 4)

    def test_standard_output_is_one_valid_document(self):
        results = json.loads(self.succeed(*small_repeatability(size="8x8", json="/dev/stdout")))
        self.assertEqual(len(results["benchmarks"]), 4)


if __name__ == "__main__":
    unittest.main()
