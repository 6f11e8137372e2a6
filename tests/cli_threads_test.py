#!/usr/bin/env python3
"""icbench's commands that look into what threads do: traces, accounts of time, held threads, simulations."""

import itertools
import json
import os
import unittest

from cli_support import SCENE, Case, arguments_of, small_capture, small_render, small_sweep


class Trace(Case):
    """Real renders, captured and replayed."""

    def replay(self, *arguments):
        self.succeed("trace", "replay", "a.trace", "--scale", "0", "--repetitions", "1", "--json", "replay.json",
                     *arguments)
        return self.load("replay.json")["benchmarks"]

    def test_one_thread_leaves_the_renders_records_in_every_cache(self):
        # All that decides whether a query is answered: gradients, elliptic records, the guard against leaks, glass,
        # passes over one frame, records that go with it, stay, or are renewed.
        for changes in (
                {"integrator": "irradiance_cache", "spp": 2, "flags": ["--overture", "--leak-guard"]},
                {"integrator": "irradiance_cache", "interpolation": "gradients", "scene": "cornell_specular"},
                {"integrator": "irradiance_cache", "interpolation": "neighbour_clamping", "rays": 16},
                {"integrator": "irradiance_cache", "interpolation": "occlusion_hessian", "rays": 64},
                {"integrator": "irradiance_cache", "scene": "cornell_camera", "frames": 3},
                {"integrator": "instant_caching", "vpls": 16, "frames": 3},
                {"integrator": "temporal_instant_caching", "vpls": 16, "frames": 3}):
            flags = changes.pop("flags", [])
            with self.subTest(changes, flags=flags):
                self.succeed(*small_capture(**changes, out="a.trace", json="a.json"), *flags)
                asked = self.load("a.json")
                self.assertEqual(asked["queries"], sum(frame["queries"] for frame in asked["frames"]))
                for row in self.replay("--threads", "1", "--caches", "wait_free,packed_local_write"):
                    self.assertIs(row["same_records"], True)
                    self.assertEqual(row["queries"], asked["queries"])
                    self.assertEqual((row["stand_ins"], row["redundant_records"]), (0, 0))

    def test_results_name_the_trace_and_are_alone_on_standard_output(self):
        hashes = set()
        for size in "16x16", "24x16":
            captured = json.loads(self.succeed(*small_capture(size=size, out="a.trace", json="/dev/stdout")))
            self.assertEqual("{}x{}".format(captured["width"], captured["height"]), size)
            replayed = json.loads(self.succeed("trace", "replay", "a.trace", "--repetitions", "1", "--json",
                                               "/dev/stdout"))
            json.loads(self.succeed("trace", "info", "a.trace", "--json", "/dev/stdout"))
            hashes.add(replayed["context"]["configuration_hash"])
        self.assertEqual(len(hashes), 2, "another trace under one name")

    def test_what_is_captured_is_the_render_that_would_have_been(self):
        for interpolation in "gradients", "occlusion_hessian":
            for flags in [], ["--overture"]:
                with self.subTest(interpolation, flags=flags):
                    # The smallest in which hits ask again.
                    same = {"interpolation": interpolation, "rays": 64, "size": "96x72", "threads": 1}
                    self.succeed(*small_render(**same, json="render.json"), *flags)
                    self.succeed(*small_capture(**same, out="a.trace", json="a.json"), *flags)
                    rendered, captured = self.load("render.json"), self.load("a.json")["frames"][0]
                    for field in "queries", "hits", "records", "rays":
                        self.assertEqual(captured[field], rendered[field], field)

    def test_tells_what_a_trace_holds(self):
        self.succeed(*small_capture(out="a.trace", json="a.json", threads=2))
        asked = self.load("a.json")
        self.assertIn(f"{SCENE} by irradiance_cache, 48x32 at 1 spp",
                      self.succeed("trace", "info", "a.trace", "--json", "info.json"))
        told = self.load("info.json")
        self.assertEqual({key: told[key] for key in ("scene", "integrator", "cache", "threads", "width", "height",
                                                     "spp", "seed", "rays_per_record")},
                         {"scene": SCENE, "integrator": "irradiance_cache", "cache": "wait_free",
                          "threads": 2, "width": 48, "height": 32, "spp": 1, "seed": 1, "rays_per_record": 4})
        self.assertEqual((told["queries"], told["hits"]), (asked["frames"][0]["queries"], asked["frames"][0]["hits"]))
        self.assertEqual(told["records_made"], asked["frames"][0]["records"])
        self.assertEqual(told["frames"][0]["records"], asked["frames"][0]["records"])
        self.assertEqual(told["trace_bytes"], (self.folder / "a.trace").stat().st_size)
        self.assertLess(told["bytes_per_query"], 28)
        self.assertGreater(told["record_cost_p50_us"], 0)
        self.assertLessEqual(told["record_cost_p50_us"], told["record_cost_p99_us"])

    def test_is_a_workload_of_sweeps(self):
        self.succeed(*small_capture(out="a.trace"))
        self.succeed("sweep", "--workloads", "read_only:records=100:operations=100,trace:file=a.trace:scale=0",
                     "--caches", "null,wait_free,local_write", "--threads", "1,3", "--repetitions", "1",
                     "--out", "out.json")
        rows = [row for row in self.load("out.json")["benchmarks"] if row["workload_kind"] == "trace"]
        self.assertEqual(sorted((row["cache"], row["threads"]) for row in rows),
                         [(cache, threads) for cache in ("local_write", "null", "wait_free") for threads in (1, 3)])
        for row in rows:
            self.assertEqual(row["scene"], SCENE)
            if row["cache"] != "null":
                self.assertEqual(row["inserts"], row["queries"] - row["hits"])
            if row["threads"] == 1:
                self.assertIs(row["same_records"], row["cache"] != "null")

    def test_capturing_changes_no_bit_of_what_one_thread_does(self):
        self.succeed(*small_capture(out="a.trace", json="a.json"))
        self.succeed(*small_render(size="48x32", threads=1, json="b.json", out="b.exr"))
        for key in "queries", "hits", "records", "rays":
            self.assertEqual(self.load("a.json")["frames"][0][key], self.load("b.json")[key])


class Time(Case):
    """Where the time of a sweep goes."""

    PARTS = ["work", "redundant", "query", "insert", "merge", "lock_wait", "descheduled_wanting", "descheduled_holding",
             "descheduled_between", "barrier", "other"]

    def test_parts_of_every_row_are_shares_and_the_rest_is_what_they_leave(self):
        self.succeed(*small_capture(out="a.trace"))
        self.succeed("sweep", "--workloads", "miss_driven:operations=2000,insert_only:records=500,"
                     f"{SCENE}:rays=4:size=32x32,{SCENE}:integrator=path:spp=1:size=32x32,"
                     f"{SCENE}:integrator=hash_cells:spp=1:size=32x32,"
                     "trace:file=a.trace:scale=0", "--caches", "null,packed_global_mutex,packed_local_write",
                     "--threads", "1,8", "--repetitions", "1", "--reference-spp", "2", "--breakdown", "--out", "out.json")
        results = self.load("out.json")
        self.assertTrue(results["context"]["configuration"]["breakdown"])
        counters = results["context"]["hardware_counters"]
        self.assertTrue(counters["events"] or counters["note"].startswith("no hardware counters: "), counters)
        for row in results["benchmarks"]:
            with self.subTest(row["name"]):
                shares = {part: row[f"time_{part}_share"] for part in self.PARTS}
                self.assertGreaterEqual(min(shares.values()), 0)
                self.assertAlmostEqual(sum(shares.values()) + row["time_unexplained"], 1, places=9)
                # No stretch is counted twice. How much time none has counted is for the row breakdown_sum: a thread
                # that the system lets start late has nothing to stamp.
                self.assertGreater(row["time_unexplained"], -0.1)
                if row["workload_kind"] in ("miss_driven", "trace") and row["cache"] != "none":
                    self.assertGreater(shares["query"], 0)
                if row["workload_kind"] == "insert_only":
                    self.assertEqual((shares["query"], shares["work"]), (0, 0))
                    self.assertGreater(shares["insert"] + shares["lock_wait"] + shares["descheduled_wanting"]
                                       + shares["descheduled_holding"], 0)
                if row["threads"] == 1:
                    self.assertEqual(shares["redundant"], 0)
                if row["cache"] != "packed_global_mutex":
                    self.assertEqual((shares["lock_wait"], shares["descheduled_wanting"]), (0, 0))
                for event in counters["events"]:
                    self.assertGreater(row[event], 0)
                if "latency_query_samples" in row:  # all are timed
                    self.assertEqual(row["latency_query_samples"], row["queries"])

    def test_is_absent_unless_asked_for(self):
        self.succeed(*small_sweep(out="out.json"))
        results = self.load("out.json")
        self.assertNotIn("hardware_counters", results["context"])
        self.assertEqual([key for key in results["benchmarks"][0] if key.startswith("time_")], ["time_unit"])

    def test_a_timeline_is_a_trace_event_file(self):
        for workload, events in (("miss_driven:operations=3000", 200), ("miss_driven:operations=3000", 100_000),
                                 (f"{SCENE}:rays=4:size=32x32", 100_000)):
            self.succeed(*small_sweep(caches="packed_global_mutex", workloads=workload, threads=3,
                                      timeline="timeline.json", out="out.json"), "--timeline-events", events,
                         *(["--reference-spp", "2"] if SCENE in workload else []))
            trace = self.load("timeline.json")
            self.assertEqual(trace["otherData"]["workload"].partition(":")[0], workload.partition(":")[0])
            self.assertEqual(trace["otherData"]["cache"], "packed_global_mutex")
            names, rows, complete = {}, set(), 0
            for event in trace["traceEvents"]:
                self.assertIn(event["ph"], "MX")
                self.assertIsInstance(event["name"], str)
                self.assertEqual((type(event["pid"]), type(event["tid"])), (int, int))
                if event["ph"] == "M":
                    if event["name"] == "thread_name":
                        names[event["tid"]] = event["args"]["name"]
                    continue
                self.assertGreaterEqual(event["ts"], 0)
                self.assertGreaterEqual(event["dur"], 0)
                rows.add(event["tid"])
                complete += 1
            self.assertLessEqual(complete, events)
            self.assertGreater(complete, 0)
            self.assertLessEqual(rows, names.keys())
            self.assertEqual(names, {0: "thread 0", 1: "thread 1", 2: "thread 2", 3: "ends of frames"})
            self.assertEqual(trace["otherData"]["spans_left_out"] > 0, events == 200)
        self.assertEqual(sorted(self.contents()), ["out.json", "timeline.json"])

    def test_a_timeline_is_of_one_point(self):
        one = {"timeline": "timeline.json", "out": "out.json"}
        self.refuse(*small_sweep(**one, threads="1,2"), says=["--timeline", "one of each"])
        self.refuse(*small_sweep(**one, caches="null,wait_free"), says=["--timeline"])
        self.refuse(*small_sweep(**one | {"timeline": "nowhere/timeline.json"}), says=["nowhere"])
        self.succeed(*small_sweep(out="out.json"))
        self.refuse(*small_sweep(**one), "--resume", says=["first repetition", "--resume"])
        self.succeed_but_for(["--timeline-events has no effect without --timeline"], *small_sweep(out="out.json"),
                             "--timeline-events", 1000)


class Preempt(Case):
    """A thread held in the middle of operations."""

    def preempt(self, *arguments):
        self.succeed("preempt", "--workload", "mix_90_10:records=500:operations=20000", "--repetitions", "2", "--hold-ms",
                     "1", "--pause-ms", "1", "--out", "out.json", *arguments)
        return self.load("out.json")

    def test_every_cache_is_measured_held_and_free(self):
        caches = ["packed_global_mutex", "packed_global_spin", "packed_local_write", "packed_wait_free"]
        results = self.preempt("--caches", ",".join(caches), "--threads", "3")
        self.assertIs(results["context"]["complete"], True)
        rows = results["benchmarks"]
        self.assertEqual(sorted((row["cache"], row["held"], row["repetition_index"]) for row in rows),
                         sorted(itertools.product(caches, (False, True), range(2))))
        for row in rows:
            with self.subTest(row["name"]):
                self.assertEqual(row["name"].split("/")[-1], "held" if row["held"] else "free")
                if not row["held"]:
                    self.assertEqual((row["holds"], row["held_ms"]), (0, 0))
                # The one that is held is not among those that are measured.
                self.assertLess(row["latency_query_samples"] + row["latency_insert_samples"], 20000)
                self.assertTrue(0 <= row["stalled_share"] <= 1)
                self.assertGreater(row["others_operations_per_second"], 0)

    def test_all_caches_are_those_that_threads_can_share(self):
        caches = self.preempt("--caches", "all")["context"]["configuration"]["caches"]
        self.assertIn("packed_wait_free_snapshot", caches)
        self.assertFalse({"sequential", "packed_sequential", "brute_force"} & set(caches))

    def test_trials_too_short_to_hold_anybody_are_named_on_one_line(self):
        done = self.run_icbench("preempt", "--caches", "wait_free,packed_wait_free", "--threads", "2", "--workload",
                                "mix_90_10:records=500:operations=20", "--repetitions", "1", "--pause-ms", "60000",
                                "--out", "out.json")
        self.assertEqual(done.returncode, 0, done.stderr)
        warnings = [line for line in done.stderr.splitlines() if line.startswith("warning")]
        self.assertEqual(len(warnings), 1, done.stderr)
        for part in "/packed_wait_free/threads:2/held, ", "/wait_free/threads:2/held: ", "--pause-ms":
            self.assertIn(part, warnings[0])

    def test_is_refused_where_nobody_could_be_measured(self):
        self.refuse("preempt", "--caches", "sequential", says=["sequential", "single thread"])
        self.refuse("preempt", "--threads", "1", says=["--threads"])
        self.refuse("preempt", "--workload", "cornell_box", says=["cornell_box", "synthetic"])
        self.refuse("preempt", "--hold-ms", "0", says=["--hold-ms"])
        self.refuse("preempt", "--caches", "no_such", says=["no_such"])


class Simulate(Case):
    """Sweeps in virtual time."""

    def simulate(self, **changes):
        self.succeed(*arguments_of("simulate", {"cores": "1,5", "workloads": "miss_driven:operations=2000",
                                                "caches": "packed_sequential,packed_shared_mutex,local_write",
                                                "calibration": "deep/costs.json", "out": "out.json"}, changes))
        return self.load("out.json")

    def test_rows_say_that_they_are_simulated_and_come_out_the_same_again(self):
        once = self.simulate()
        costs = self.load("deep/costs.json")
        self.assertEqual(len(costs["costs"]), 3)
        again = self.simulate()
        self.assertEqual(once["benchmarks"], again["benchmarks"])
        self.assertEqual(self.load("deep/costs.json"), costs)
        self.assertEqual([(row["cache"], row["threads"]) for row in once["benchmarks"]],
                         [("packed_sequential", 1), ("packed_shared_mutex", 1), ("packed_shared_mutex", 5),
                          ("local_write", 1), ("local_write", 5)])
        for row in once["benchmarks"]:
            self.assertTrue(row["name"].startswith("simulate/miss_driven:operations=2000/"))
            self.assertIs(row["simulated"], True)
            self.assertEqual((row["validated_to_threads"], row["calibration"]), (0, "deep/costs.json"))
            self.assertEqual(row["queries"], 2000)
            self.assertEqual(row["queries"] - row["hits"], row["inserts"])
            if row["threads"] == 1:
                self.assertEqual((row["redundant_records"], row["lock_wait_share"]), (0, 0))
        self.assertGreater(once["benchmarks"][-1]["redundant_records"], 100)
        self.assertIs(once["context"]["complete"], True)
        self.assertNotEqual(self.simulate(seed=2)["benchmarks"], once["benchmarks"])

    def test_only_what_was_validated_is_called_so(self):
        given = dict(caches="packed_shared_mutex", cores="5", workloads="miss_driven:cost=1:operations=2000")
        self.simulate(**given)
        costs = self.load("deep/costs.json")
        key, = costs["costs"]
        costs["validation"] = {"threads": 2, "cores_per_complex": 8, "cores_per_socket": 64, "points": 30,
                               "records_points": 18, "waiting_points": 20, "throughput_error": 0.05,
                               "records_error": 0.05, "waiting_error": 0.05, "file_error": 0.1,
                               "date": costs["date"], "commit": costs["commit"],
                               "errors": {f"{key} at 1 us a record": 0.25}}

        def validated(changes=(), **options):
            (self.folder / "deep/costs.json").write_text(json.dumps(costs | dict(changes)), encoding="utf-8")
            row, = self.simulate(**given | options)["benchmarks"]
            return row["validated_to_threads"], row.get("validated_error")

        self.assertEqual(validated(), (2, 0.25))
        self.assertEqual(validated(workloads="miss_driven:cost=2:operations=2000"), (0, None))
        self.assertEqual(validated(transfer="1,2,3"), (0, None))
        self.assertEqual(validated(**{"hand-over": "1,2"}), (0, None))
        self.assertEqual(validated({"validation": costs["validation"] | {"commit": "another"}}), (0, None))
        # What was validated is a virtual machine, too.
        self.assertEqual(validated(complex=4), (0, None))
        self.assertEqual(validated(socket=32), (0, None))
        of_another = {"validation": costs["validation"] | {"cores_per_complex": 4}}
        self.assertEqual(validated(of_another), (0, None))
        self.assertEqual(validated(of_another, complex=4), (2, 0.25))
        told_nothing = {k: v for k, v in costs["validation"].items() if not k.startswith("cores_")}
        self.assertEqual(validated({"validation": told_nothing}), (0, None))
        for error in ("throughput_error", "records_error", "waiting_error", "file_error"):
            self.assertEqual(validated({"validation": costs["validation"] | {error: 0.11}}), (0, None), error)
        self.assertEqual(validated({"cpu_model": "another"}), (2, 0.25))  # costs from elsewhere, validated there
        self.refuse(*arguments_of("simulate", given | dict(caches="packed_wait_free", calibration="deep/costs.json",
                                                           out="out.json"), {}),
                    says=["deep/costs.json", "(another)", "--recalibrate"])

    @unittest.skipIf(len(os.sched_getaffinity(0)) < 2, "needs two processing units")
    def test_a_validation_tells_how_far_off_and_leaves_its_costs(self):
        given = dict(caches="packed_global_mutex", workloads="miss_driven:cost=1:operations=2000",
                     calibration="costs.json")
        self.succeed(*arguments_of("simulate", given | dict(cores="1"), {}))
        before, simulated = self.load("costs.json"), self.load("simulated.json")
        self.assertNotIn("validation", before)
        done = self.run_icbench(*arguments_of("simulate", given | dict(repetitions=2), {}), "--validate")
        self.assertIn(done.returncode, (0, 1), done.stderr)  # how far off it is, is not ours to say
        self.assertEqual(self.load("simulated.json"), simulated)
        self.assertNotIn("no effect", done.stderr)
        after, rows = self.load("costs.json"), self.load("validation.json")["benchmarks"]
        key, = after["costs"]
        self.assertNotEqual(after["costs"][key]["trial_ns"], before["costs"][key]["trial_ns"])
        validation = after["validation"]
        self.assertEqual((validation["commit"], list(validation["errors"])),
                         (after["commit"], [f"{key} at 1 us a record"]))
        self.assertEqual((validation["cores_per_complex"], validation["cores_per_socket"]), (8, 64))
        for row in rows:
            with self.subTest(row["name"]):
                self.assertEqual("error_items_per_second_by_file" in row, row["threads"] > 1)
                operations = row["queries"] + row["inserts"]  # of the round that the row is
                self.assertAlmostEqual(row["items_per_second"] * row["real_time"] * 1e-3 / operations, 1)
        self.assertEqual(validation["errors"][f"{key} at 1 us a record"], rows[-1]["error_items_per_second"])
        self.assertEqual(validation["points"], validation["records_points"])

    @unittest.skipIf(len(os.sched_getaffinity(0)) < 2, "needs two processing units")
    def test_a_validation_by_another_machines_costs_leaves_earlier_results(self):
        self.simulate(caches="packed_wait_free", cores="1")
        costs = self.load("deep/costs.json")
        (self.folder / "deep/costs.json").write_text(json.dumps(costs | {"host_name": "another"}), encoding="utf-8")
        self.refuse("simulate", "--validate", "--caches", "packed_wait_free", "--workloads",
                    "miss_driven:operations=2000", "--calibration", "deep/costs.json", "--out", "out.json",
                    says=["another", "--recalibrate"])

    def test_options_of_validations_alone_and_of_others_are_named(self):
        given = dict(caches="packed_global_mutex", workloads="miss_driven:cost=1:operations=2000",
                     calibration="costs.json", cores=1)
        self.succeed_but_for(["--repetitions has no effect without --validate"],
                             *arguments_of("simulate", given | dict(repetitions=2), {}))
        if len(os.sched_getaffinity(0)) > 1:
            done = self.run_icbench(*arguments_of("simulate", given | dict(repetitions=1), {}), "--validate")
            self.assertIn(done.returncode, (0, 1), done.stderr)
            self.assertIn("icbench: --cores has no effect with --validate, which takes those of this machine\n",
                          done.stderr)

    def test_handing_over_a_lock_takes_as_long_as_one_says(self):
        rows = []
        for ns in ("0,0", "1000000,0", "0,1000000"):
            data = self.simulate(caches="packed_global_mutex", cores="8", **{"hand-over": ns})
            self.assertEqual(data["context"]["virtual_machine"]["hand_over_ns"], [float(n) for n in ns.split(",")])
            rows += data["benchmarks"]
        fast, slow_call, _ = rows
        self.assertGreater(slow_call["real_time"], max(1, fast["real_time"]))  # ms: one call at least
        waited = [row["lock_wait_share"] * row["real_time"] for row in rows]
        self.assertGreater(waited[2], waited[0])

    def test_one_core_leaves_a_traces_records(self):
        self.succeed(*small_capture(out="a.trace", frames=2, scene="cornell_camera"))
        for row in self.simulate(workloads="trace:file=a.trace")["benchmarks"]:
            if row["threads"] == 1:
                self.assertIs(row["same_records"], True)
                self.assertEqual(row["redundant_records"], 0)


if __name__ == "__main__":
    unittest.main()
