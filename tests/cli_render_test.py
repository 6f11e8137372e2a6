#!/usr/bin/env python3
"""icbench render and icbench compare, end to end."""

import json
import os
import statistics
import unittest

from cli_support import PRECIOUS, SCENE, Case, small_render, write_white_png

# From within a ball through panes of glass, each of which mirrors as well: pixels see more than two points of the ball.
PANES = """# view -vp 0 -.5 0 -vd 0 1 0 -vu 0 0 1 -vh 40 -vv 40
void plastic grey 0 0 5 .7 .7 .7 0 0
void glass clear 0 0 3 .96 .96 .96
void glow lit 0 0 4 3 3 3 0
grey sphere ball 0 0 4 0 0 0 3
lit ring lamp 0 0 8  0 0 2  0 0 -1  0 .5
""" + "".join(f"clear polygon pane{i} 0 0 12 -1 {i}e-1 -1  1 {i}e-1 -1  1 {i}e-1 1  -1 {i}e-1 1\n" for i in range(4))


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
        for options, flags in (({"integrator": "irradiance_cache", "interpolation": "bounded"}, ["--no-leak-guard"]),
                               ({"integrator": "irradiance_cache"}, []),
                               ({"integrator": "instant_caching", "vpls": 8}, ["--leak-guard"]),
                               ({"integrator": "instant_caching", "vpls": 8}, [])):
            plain = small_render(threads=1, cache="packed_wait_free", out="a.exr", json="a.json", **options) + flags
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

    def test_samples_beside_the_first_have_room_for_records_of_their_own(self):
        fine = small_render(scene="cornell_box", size="24x24", spp=16, accuracy="0.002", out="a.exr", json="a.json")
        self.assertNotIn("no room", self.run_icbench(*fine).stderr)
        self.assertGreater(self.load("a.json")["records"], 2 * 24 * 24)

    def test_records_that_find_no_room_are_told(self):
        (self.folder / "panes.rad").write_text(PANES)
        tight = small_render(scene="panes.rad", size="24x24", accuracy="0.002", out="a.exr", json="a.json")
        self.assertIn("found no room", self.run_icbench(*tight).stderr)
        self.assertGreater(self.load("a.json")["full"], 0)
        self.assertNotIn("no room", self.run_icbench(*tight, "--cache", "null").stderr)

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
                          "--deterministic", "--overture", "--rays", "4", "--leak-guard", "--cell-size", "4",
                          "--light-samples", "2"],
                 "--cache, --accuracy, --interpolation, --deterministic, --overture, --rays, --leak-guard, "
                 "--cell-size, --light-samples have"),
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

    def test_exposure_has_no_effect_on_exr(self):
        self.succeed_but_for(["--exposure has no effect on EXR pictures"], *small_render(out="a.exr", exposure=2))
        self.succeed(*small_render(out="a.png", exposure=2))

    def test_nothing_is_known_where_nothing_was_drawn(self):
        said = self.succeed(*small_render(json="a.json", residual=1e-6))
        self.assertIn("not known, no pixel was drawn", said)
        cost = self.load("a.json")
        self.assertEqual(cost["residual_samples"], 0)
        for field in "mean", "standard_error", "mean_share", "standard_error_share", "mean_square":
            self.assertIsNone(cost["residual_" + field])
        self.assertEqual(set(cost["residual_mean_rgb"]), {None})
        # A few are: the blocks without any stay unknown.
        self.succeed(*small_render(json="a.json", residual=0.02, size="32x32"))
        blocks = self.load("a.json")["residual_blocks"]
        self.assertEqual({0 if mean is None else 1 for mean in blocks["mean"]}, {0, 1})
        self.assertEqual([samples > 0 for samples in blocks["samples"]],
                         [mean is not None for mean in blocks["mean"]])

    def test_leaks_are_guarded_against_but_for_plain_records_unless_told_otherwise(self):
        for integrator, level, given, guarded in (
                ("irradiance_cache", "split_sphere", [], False),
                ("irradiance_cache", "split_sphere", ["--leak-guard"], True),
                *(("irradiance_cache", level, [], True)
                  for level in ("bounded", "gradients", "neighbour_clamping", "geometric_hessian", "occlusion_hessian")),
                ("irradiance_cache", "gradients", ["--no-leak-guard"], False),
                ("irradiance_cache", "occlusion_hessian", ["--no-leak-guard"], False),
                *((integrator, level, given, bool(given))
                  for integrator in ("instant_caching", "temporal_instant_caching")
                  for level in ("split_sphere", "gradients") for given in ([], ["--leak-guard"]))):
            with self.subTest(integrator, level=level, given=given):
                rays = {"rays": 64} if integrator == "irradiance_cache" else {"vpls": 64}
                self.succeed(*small_render(size="32x32", integrator=integrator, interpolation=level, json="a.json",
                                           **rays), *given)
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

    def test_options_of_observers_that_do_not_look_are_named(self):
        self.succeed(*small_render(out="a.exr"))
        observed = {"hdrvdp": {"--luminance-scale": "100", "--distance": "1", "--display-pixels": "800x600",
                               "--display-size": "0.4x0.3"}, "flip": {"--pixels-per-degree": "50"}}
        for metrics in ("rmse", "rmse,flip", "hdrvdp", "flip,hdrvdp"):
            given = [part for options in observed.values() for option in options.items() for part in option]
            self.succeed_but_for([f"{option} has no effect without --metrics {metric}"
                                  for metric, options in observed.items() if metric not in metrics
                                  for option in options], "compare", "a.exr", "a.exr", "--metrics", metrics, *given)
        self.refuse("compare", "a.exr", "none.exr", "--metrics", "rmse", "--distance", "1", says=["none.exr"])
        self.succeed_but_for(["--map has no effect on metrics without maps"], "compare", "a.exr", "a.exr", "--metrics",
                             "mean_ratio", "--map", "maps")

    def test_figures_alone_go_to_standard_output_if_it_is_their_file(self):
        self.succeed(*small_render(out="a.exr"))
        figures = json.loads(self.succeed("compare", "a.exr", "a.exr", "--json", "/dev/stdout"))
        self.assertEqual(figures["rmse"], 0)
        self.assertEqual(json.loads(self.succeed(*small_render(out="a.exr", json="/dev/stdout")))["image"], "a.exr")
        animation = self.succeed("animate", "--scene", SCENE, "--size", "8x8", "--rays", 1, "--frames", 2, "--format",
                                 "none", "--json", "/dev/stdout")
        self.assertEqual(json.loads(animation)["frame_count"], 2)
        before = self.contents()
        self.assertEqual(json.loads(self.succeed(*small_render(out="a.exr", json="-")))["image"], "a.exr")
        self.assertEqual(self.contents().keys(), before.keys())

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
        # Frames that do not follow one another tell nothing of flicker.
        for folder in "ab":
            os.rename(self.folder / folder / "frame_0001.exr", self.folder / folder / "frame_0005.exr")
        self.assertIn("flicker none", self.succeed("compare", "a", "b", "--metrics", "rmse", "--json", "d.json"))
        self.assertIsNone(self.load("d.json")["flicker"])


if __name__ == "__main__":
    unittest.main()
