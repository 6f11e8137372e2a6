#!/usr/bin/python3
"""Tests of plots/: what is drawn is what was measured, and nothing is claimed that was not.

Results come from a small model of threads that contend (a scalability law per cache), never from a real run;
its context says so.
"""
from __future__ import annotations

import base64
import csv
import itertools
import json
import math
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import unittest
import zlib
from html.parser import HTMLParser
from pathlib import Path

import matplotlib.image
import numpy as np

kRoot = Path(__file__).resolve().parent.parent
kPlots = kRoot / "plots"
sys.path.insert(0, str(kPlots))

import cautions  # noqa: E402
import contention_map  # noqa: E402
import correctness  # noqa: E402
import correctness_page  # noqa: E402
import findings  # noqa: E402
import over_threads  # noqa: E402
import results  # noqa: E402
import speed_error  # noqa: E402
import style  # noqa: E402
from figures import CORRECTNESS_FIGURES, FIGURES  # noqa: E402

kMechanisms = {  # contention, coherency, single-thread speed of the model
    "sequential": ("none", 0.0, 0.0, 1.05),
    "global_mutex": ("global_mutex", 0.9, 0.02, 0.82),
    "global_spin": ("global_spin", 0.8, 0.05, 0.92),
    "queuing_mutex": ("queuing_mutex", 0.85, 0.015, 0.85),
    "shared_mutex": ("shared_mutex", 0.45, 0.01, 0.80),
    "spin_rw_mutex": ("spin_rw_mutex", 0.40, 0.012, 0.88),
    "distributed_rw": ("distributed_rw", 0.12, 0.004, 0.86),
    "node_lock": ("node_lock", 0.10, 0.003, 0.70),
    "local_write": ("local_write", 0.03, 0.0005, 0.98),
    "wait_free": ("wait_free", 0.02, 0.0004, 0.97),
    "wait_free_snapshot": ("wait_free", 0.035, 0.0006, 0.93),
}
kStructures = {"ward": ("", 2.0e6), "packed": ("packed_", 2.2e7)}
kLoners = {"tbb_hash_grid": ("hash_grid", "concurrent_container", 0.06, 0.002, 6e6),
           "append_log": ("append_log", "append_log", 0.03, 0.001, 1.2e7),
           "null": ("none", "none", 0.0, 0.0, 4e8)}
kContext = {
    "date": "2025-01-01T12:00:00+00:00", "host_name": "model",
    "cpu_model": "Model CPU (synthetic sample data)", "num_cpus": 16, "cores": 8, "packages": 2,
    "machine": {"units": 16, "cores": 8, "packages": 2, "numa_nodes": 2}, "mhz_per_cpu": 3000,
    "cpu_scaling_enabled": False, "virtualised": False, "hypervisor": None, "cgroup_cpu_quota": None,
    "caches": [{"type": "Data", "level": 1, "size": 32768, "num_sharing": 2},
               {"type": "Unified", "level": 3, "size": 33554432, "num_sharing": 8}],
    "boundaries": [{"threads": 5, "kind": "package"}, {"threads": 9, "kind": "smt"},
                   {"threads": 17, "kind": "oversubscribed"}],
    "governor": "performance", "kernel": "Linux 6.1", "compiler": "GNU 12.2.0",
    "compiler_flags": "-O3 -march=native",
    "commit": "0123456789abcdef", "seed": 42, "placement": "compact", "load_avg": [0.1, 0.1, 0.1],
    "equal_speed_pus": True, "complete": True, "command_line": "icbench sweep --threads 1,2,4 --out "
                                                               "results.json"}
kWorkloads = ["read_only:order=uniform", "read_only:order=hot_spot", "mix_90_10:order=uniform",
              "mix_90_10:order=hot_spot", "mix_50_50:order=hot_spot", "insert_only", "miss_driven:cost=0",
              "miss_driven:cost=1", "miss_driven:cost=4", "miss_driven:cost=16", "miss_driven:cost=64",
              "miss_driven:cost=256", "cornell_box:rays=64:a=0.2:order=morton",
              "sibenik:rays=64:a=0.2:order=morton"]


def model_caches(structures=tuple(kStructures), mechanisms=tuple(kMechanisms),
                 loners=tuple(kLoners)) -> list[dict]:
    caches = []
    for structure in structures:
        prefix, speed = kStructures[structure]
        for name in mechanisms:
            mechanism, alpha, beta, factor = kMechanisms[name]
            caches.append({"cache": prefix + name, "structure": structure, "mechanism": mechanism,
                           "alpha": alpha,
                           "beta": beta, "speed": speed * factor})
    for name in loners:
        structure, mechanism, alpha, beta, speed = kLoners[name]
        caches.append({"cache": name, "structure": structure, "mechanism": mechanism, "alpha": alpha,
                       "beta": beta,
                       "speed": speed})
    return caches


def model_row(cache: dict, workload: str, threads: int, repetition: int, noise: float) -> dict:
    """One repetition of the model: the Universal Scalability Law with SMT, oversubscription and noise."""
    random = np.random.default_rng([zlib.crc32(f"{cache['cache']}{workload}{threads}".encode()), repetition])
    base, *rest = workload.split(":")
    parameters = dict(p.split("=") for p in rest)
    kind = ("mix" if base.startswith("mix") else base if base in ("read_only", "insert_only", "miss_driven")
            else "ray_traced")
    writes = {"read_only": 0.0, "insert_only": 1.0, "mix": int(base.split("_")[-1]) / 100 if kind == "mix"
              else 0,
              "miss_driven": 0.1, "ray_traced": 0.05}[kind]
    hot = 2.0 if parameters.get("order") == "hot_spot" else 1.0
    free = not any(word in cache["mechanism"] for word in ("mutex", "spin", "rw"))
    pressure = hot * (0.3 + 2 * writes)
    cost = float(parameters.get("cost", 0)) + (0.05 * float(parameters["rays"]) if kind == "ray_traced"
                                               else 0)
    own = 1e6 * (1 + 6 * writes) / cache["speed"]  # microseconds of an operation in the cache
    share = own / (own + cost * 0.1)
    alpha, beta = min(0.97, cache["alpha"] * pressure * share), cache["beta"] * pressure * share
    units = min(threads, 8) + 0.3 * max(0, min(threads, 16) - 8)
    loss = 1.0 if free else 1 + 0.25 * max(0.0, math.log2(threads / 16)) * (share ** 0.5)
    rate = 1e6 / (own + cost * 0.1) * units / (1 + alpha * (units - 1) + beta * units * (units - 1)) / loss
    rate *= float(np.exp(random.normal(0, noise * (1 + (threads > 16)))))
    operations = 2_000_000
    inserts = max(1, int(operations * writes)) if writes else 0
    redundant = 0 if threads == 1 else int(inserts * 0.002 * threads
                                           * (12 if "local" in cache["mechanism"] else 1))
    waiting = 0.0 if free or threads == 1 else 1 - 1 / (1 + alpha * (units - 1))
    row = {"name": f"sweep/{workload}/{cache['cache']}/threads:{threads}", "run_type": "iteration",
           "iterations": 1,
           "repetition_index": repetition, "cache": cache["cache"], "workload": workload,
           "workload_kind": kind,
           "structure": cache["structure"], "mechanism": cache["mechanism"], "consistency": "regular",
           "threads": threads, "placement": "compact", "oversubscribed": threads > 16,
           "real_time": operations / rate * 1e3, "cpu_time": operations / rate * 1e3 * min(threads, 16),
           "time_unit": "ms", "items_per_second": rate, "queries": operations - inserts, "inserts": inserts,
           "hits": int(operations * 0.8), "records": inserts + redundant, "redundant_records": redundant,
           "utilisation": 0.99 - (0.6 * waiting if "spin" not in cache["mechanism"] else 0.0),
           "lock_wait_share": waiting, "bytes_per_record": 180.0}
    if free and inserts:
        row |= {"cas_attempts": inserts * 2, "nodes_discarded": 0,
                "cas_failures": int(inserts * 0.002 * (threads - 1) * hot)}
    tail = 1.05 if free else 2.0 ** max(0.0, math.log2(threads))
    for operation, factor in (("query", 1.0), ("insert", 6.0)):
        if operation == "insert" and not inserts or operation == "query" and inserts == operations:
            continue
        for percentile, growth in (("p50", 1), ("p90", 1.8), ("p99", 4), ("p999", 9 * tail),
                                   ("max", 60 * tail**1.5)):
            usual = 1e9 / cache["speed"] * factor
            row[f"latency_{operation}_{percentile}_ns"] = usual * growth * random.uniform(0.95, 1.05)
    if parameters.get("order"):
        row["order"] = parameters["order"]
    if kind == "miss_driven":
        row["record_cost_us"] = cost
    if kind == "ray_traced":
        row |= {"scene": base, "integrator": "irradiance_cache", "rays_per_record": int(parameters["rays"]),
                "accuracy": float(parameters["a"]), "reference_relmse": 2e-5}
    return row


def model_errors(caches: list[dict], threads=(1, 8, 32), scenes=("cornell_box", "sibenik"),
                 repetitions=5) -> list[dict]:
    """Rows of speed against error: every cache over rays and accuracy, and the path tracer over samples."""
    rows = []
    for scene in scenes:
        for count in threads:
            units = min(count, 8) + 0.3 * max(0, min(count, 16) - 8)
            for repetition in range(repetitions):
                for cache in caches:
                    for rays in (16, 64, 256):
                        for a in (0.1, 0.2, 0.4):
                            workload = f"{scene}:rays={rays}:a={a}:order=morton"
                            row = model_row(cache, workload, count, repetition, 0.02)
                            slow = 1 + cache["alpha"] * (units - 1)
                            row["seconds_indirect"] = ((rays * 0.02 / a**1.4 + 40e6 / cache["speed"]) / units
                                                       * slow
                                                       * row["real_time"]
                                                       / model_row(cache, workload, count, 0,
                                                                   0.0)["real_time"])
                            row["relmse"] = (0.004 * a**2 + 0.03 / rays * a + 2e-5) * (1 + 0.02 * repetition)
                            row["name"] = row["name"].replace("sweep/", "pareto/")
                            row["rmse"], row["mean_ratio"] = row["relmse"] ** 0.5, 0.99
                            rows.append(row)
                for spp in (1, 4, 16, 64, 256):
                    random = np.random.default_rng([spp, count, repetition])
                    rows.append({"name": f"pareto/{scene}:path:spp={spp}/none/threads:{count}",
                                 "run_type": "iteration",
                                 "repetition_index": repetition, "cache": "none",
                                 "workload": f"{scene}:path:spp={spp}",
                                 "workload_kind": "ray_traced", "structure": "none", "mechanism": "none",
                                 "threads": count, "placement": "compact", "oversubscribed": count > 16,
                                 "real_time": spp * 400 / units, "time_unit": "ms", "scene": scene,
                                 "integrator": "path", "spp": spp, "reference_relmse": 2e-5,
                                 "seconds_indirect": spp * 0.4 / units * random.uniform(0.98, 1.02),
                                 "relmse": 0.05 / spp * random.uniform(0.97, 1.03) + 2e-5})
    return rows


def model_results(threads=(1, 2, 4, 8, 16, 32, 64), workloads=tuple(kWorkloads), repetitions=5, noise=0.02,
                  caches=None, errors=True, **context) -> dict:
    """A whole results file of the model."""
    caches = model_caches() if caches is None else caches
    rows = [model_row(cache, workload, count, repetition, noise) for repetition in range(repetitions)
            for workload in workloads for cache in caches for count in threads
            if count == 1 or not cache["cache"].endswith("sequential")]
    if errors:
        rows += model_errors([c for c in caches if c["mechanism"] in ("none", "global_mutex", "local_write",
                                                                      "wait_free")
                              and c["cache"] != "null" and not c["cache"].endswith("sequential")])
    return {"context": kContext | context, "benchmarks": rows}


kChecks = ("integrity", "regular", "per_record_linearizable", "linearizable", "frame")
kCycle = """round 4 (few places, no delays): cycle of 3 operations, each of which must precede the next
  thread 1 [129, 130] insert of record 82, place 0, size 0
    returned before the next was called
  thread 3 [153, 154] insert of record 162, place 0, size 3
    was seen by the next
  thread 0 [117, 204] query at place 0, saw 8 records
    did not see the first"""


def model_verdicts(**sections) -> dict:
    """A file of icstress with every section; a section given as None is left out."""
    caches = {"sequential": 4, "global_mutex": 4, "wait_free": 3, "wait_free_snapshot": 4}  # checks promised
    checks, schedules, progress = [], [], []
    for cache, promised in caches.items():
        for i, check in enumerate(kChecks):
            violated = i >= promised and cache != "sequential"
            witness = (kCycle if check == "linearizable" else "the frame was not kept") if violated else ""
            checks.append({"cache": cache, "check": check, "verdict": "violated" if violated else "holds",
                           "promised": i < promised, "operations": 1000, "seed": 1,
                           "concurrent_pairs": 0 if cache == "sequential" else 500,
                           "violations": 12 if violated else 0, "witness": witness})
            if cache == "sequential" or check == "frame":
                continue
            for scenario, threads, preemptions, count in (("two inserts, one query", 3, None, 4321),
                                                          ("insert and query", 2, 3, 1000)):
                violated = i >= promised and threads == 3
                schedules.append({"cache": cache, "scenario": scenario, "threads": threads, "stamps": "calls",
                                  "preemptions": preemptions, "schedules": count, "complete": True,
                                  "check": check, "verdict": "violated" if violated else "holds",
                                  "promised": i < promised, "replay": "a:1201" if violated else "",
                                  "witness": kCycle if violated else ""})
        for operation, bound in (("insert", 60), ("query", 400)):
            free = cache.startswith("wait_free")
            progress.append({"cache": cache, "operation": operation,
                             "declared": "wait_free" if free else "blocking",
                             "bound": "20 and 4 a level" if free else "", "bound_steps": bound if free else 0,
                             "most_steps": 41, "steps_by_interference": [[n, 41] for n in (0, 1, 4, 16, 64)],
                             "positions": 41, "blocked_positions": 0 if free else 37, "verdict": "holds",
                             "note": "" if free else "others wait while it holds the lock"})
    control = {"fault": "a fault", "operations": 900, "seed": 1, "witness": "", "rounds": 8}
    controls = [control | {"control": "wait_free", "check": "linearizable", "seen": True, "required": True,
                           "rounds_violated": 7},
                control | {"control": "relaxed_publication", "check": "integrity", "seen": False,
                           "required": False, "rounds_violated": 0},
                control | {"control": "publish_before_fill", "check": "integrity", "seen": True,
                           "required": True, "rounds_violated": 1}]
    explored = [{"control": name, "fault": "a fault", "check": "integrity", "caught": True, "schedules": 17,
                 "replay": "b:77", "witness": ""} for name in ("relaxed_publication", "publish_before_fill")]
    explored.append(explored[0] | {"control": "wait_free", "check": "linearizable"})
    made = {"checks": checks, "controls": controls, "schedules": schedules, "explored_controls": explored,
            "progress": progress, "not_examined": ["Processors <other> than this one."],
            "progress_controls": [{"control": "in_order", "fault": "waits for those before it",
                                   "operation": "insert", "must": "violate", "seen": True,
                                   "note": "blocks others when stopped"}]} | sections
    return {name: entries for name, entries in made.items() if entries is not None}


def write_results(path: Path, results: dict) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(results), encoding="utf-8")
    return path


def run(script: str, *arguments, **environment) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, str(kPlots / script), *map(str, arguments)], capture_output=True,
                          text=True,
                          env=os.environ | environment, check=False)


def read_csv(path: Path) -> list[dict]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def few_caches() -> list[dict]:
    return model_caches(("packed",), ("sequential", "global_mutex", "shared_mutex", "local_write",
                                      "wait_free"), ())


kFewWorkloads = ("mix_90_10:order=hot_spot", "miss_driven:cost=1", "miss_driven:cost=64")


class References(HTMLParser):
    """Collects everything in a page that could load something."""

    def __init__(self, page: str):
        super().__init__()
        self.found: list[str] = []
        self.tags: set[str] = set()
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)
        self.found += [value or "" for key, value in attributes
                       if key in ("src", "href", "srcset", "data", "poster", "action", "background",
                                  "xlink:href")]


class InFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def results(self, name="results.json", **options) -> Path:
        options = {"caches": few_caches(), "workloads": kFewWorkloads, "threads": (1, 2, 8, 32),
                   "errors": False} | options
        return write_results(self.folder / name, model_results(**options))

    def good(self, script, *arguments) -> subprocess.CompletedProcess:
        done = run(script, *arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stderr, "")
        return done


class Statistics(unittest.TestCase):
    def test_intervals_are_quantiles_of_the_bootstrap_distribution(self):
        error = 4 * math.sqrt(0.025 * 0.975 / results.kResamples)  # of a share, from drawing resamples
        for n in (3, 4, 5, 6):
            samples = np.random.default_rng(n).lognormal(0, 0.5, n)
            all_resamples = list(itertools.product(range(n), repeat=n))
            every = np.median(samples[all_resamples], axis=1)
            _, low, high = results.median_intervals(samples[None, :])
            for end, tail in ((low[0], 0.025), (high[0], 0.975)):
                self.assertLessEqual(np.mean(every < end - 1e-12), tail + error)
                self.assertGreaterEqual(np.mean(every <= end + 1e-12), tail - error)

    def test_fewer_than_three_repetitions_have_no_interval(self):
        for n in (1, 2):
            median, low, high = results.median_intervals(np.ones((4, n)))
            self.assertTrue(np.all(median == 1) and np.all(np.isnan(low)) and np.all(np.isnan(high)))

    def test_ten_thousand_repetitions_of_one_cell(self):
        median, low, high = results.median_intervals(np.arange(10_000.0)[None, :])
        self.assertEqual(median[0], 4999.5)
        # The median's standard error for a uniform sample is half the range over the root of n.
        self.assertTrue(4999.5 - 150 < low[0] < 4999.5 < high[0] < 4999.5 + 150)

    def test_locks_are_told_from_the_rest(self):
        for mechanism in ("global_mutex", "std::mutex", "queuing-mutex", "spin_rw_mutex", "distributed_rw",
                          "node_lock",
                          "LCK", "spin lock", "readers_writer_lock"):
            self.assertTrue(results.is_lock(mechanism), mechanism)
        for mechanism in ("wait_free", "lock_free", "lock-free", "local_write", "none", "append_log",
                          "unknown", "block", "no lock"):
            self.assertFalse(results.is_lock(mechanism), mechanism)

    def test_front_holds_what_nothing_beats(self):
        table = results.pd.DataFrame({"seconds": [1, 2, 2, 3, 4], "relmse": [8, 4, 5, 4, 1]})
        self.assertEqual(list(speed_error.front(table).index), [0, 1, 4])

    def test_break_even_is_interpolated_over_log_cost(self):
        line = results.pd.DataFrame({"record_cost_us": [1, 100], "median": [2.0, 0.5]})
        self.assertAlmostEqual(contention_map.break_even(line), 10.0)
        self.assertIsNone(contention_map.break_even(line.assign(median=[2.0, 1.5])))


class Styles(unittest.TestCase):
    def test_every_known_cache_looks_different(self):
        names = [*style.kCacheStyles, *(f"packed_{name}" for name in style.kCacheStyles)]
        looks = {(s.colour, s.marker, s.hollow) for s in map(style.cache_style, names)}
        self.assertEqual(len(looks), len(names))

    def test_an_unknown_cache_looks_the_same_in_every_process(self):
        code = (f"import sys; sys.path.insert(0, {str(kPlots)!r}); import style; "
                "print(style.cache_style('brand_new'))")
        looks = {subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True,
                                env=os.environ | {"PYTHONHASHSEED": seed}).stdout for seed in ("1", "2")}
        self.assertEqual(len(looks), 1)


class Figures(InFolder):
    def test_csv_holds_the_medians_that_were_put_in(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads, threads=(1, 8), errors=False)
        path = write_results(self.folder / "results.json", data)
        rates: dict[tuple, list] = {}
        for row in data["benchmarks"]:
            # Where inserts come from misses, repeated ones do not count as work.
            missed = row["workload_kind"] in ("miss_driven", "ray_traced") and "queries" in row
            rate = row["queries"] / (1e-3 * row["real_time"]) if missed else row["items_per_second"]
            rates.setdefault((row["cache"], row["workload"], row["threads"]), []).append(rate)
        self.good("throughput.py", path, "--out", self.folder)
        table = read_csv(self.folder / "throughput.csv")
        self.assertEqual(len(table), len(rates))
        for line in table:
            samples = rates[line["cache"], line["workload"], int(line["threads"])]
            self.assertAlmostEqual(float(line["median"]) / float(np.median(samples)), 1, 8)
            self.assertTrue(float(line["low"]) <= float(line["median"]) <= float(line["high"]))
            self.assertEqual(int(line["n"]), len(samples))
        self.good("speedup.py", path, "--out", self.folder)
        for line in read_csv(self.folder / "speedup.csv"):
            base = rates["packed_sequential", line["workload"], 1]
            own = rates[line["cache"], line["workload"], int(line["threads"])]
            self.assertEqual((line["base_cache"], line["base_threads"]), ("packed_sequential", "1"))
            self.assertAlmostEqual(float(line["base_operations_per_second"]) / np.median(base), 1, 8)
            self.assertAlmostEqual(float(line["median"]) / np.median(np.divide(own, base)), 1, 8)

    def test_contention_map_compares_with_the_best_lock_of_the_same_structure(self):
        caches = model_caches(("ward", "packed"), ("global_mutex", "shared_mutex", "wait_free"), ())
        data = model_results(caches=caches, workloads=kFewWorkloads, threads=(4,), errors=False)
        path = write_results(self.folder / "results.json", data)
        self.good("contention_map.py", path, "--out", self.folder)
        table = read_csv(self.folder / "contention_map.csv")
        self.assertEqual(len(table), 4)
        for line in table:
            times: dict[str, list] = {}
            for row in data["benchmarks"]:
                workload = f"miss_driven:cost={line['record_cost_us']}"
                if row["structure"] == line["structure"] and row["workload"] == workload:
                    times.setdefault(row["cache"], []).append(row["real_time"])
            locks = {c: t for c, t in times.items() if "mutex" in c}
            best = min(locks, key=lambda c: np.median(locks[c]))
            self.assertEqual(line["best_lock"], best)
            expected = np.median(np.divide(locks[best], times[line["cache"]]))
            self.assertAlmostEqual(float(line["median"]) / expected, 1, 8)

    def test_mechanisms_are_compared_on_one_structure_only(self):
        path = self.results(caches=model_caches())
        setup = results.load([path])[0]
        groups = over_threads.groups_of(setup, setup.rows)
        shared = [g for g in groups if g.mechanisms]
        self.assertEqual(len(shared), 2)
        home = setup.rows.drop_duplicates("cache").set_index("cache")["structure"]
        for group in shared:
            self.assertEqual(home[group.caches].nunique(), 1)
        other, = (g for g in groups if not g.mechanisms)
        self.assertEqual(home[other.caches].nunique(), len(other.caches))

    def test_pdf_is_one_column_wide_with_truetype_fonts(self):
        self.good("report.py", self.results(errors=True), "--out", self.folder)
        for figure in FIGURES:
            pdf = (self.folder / "figures" / f"{figure.name}.pdf").read_bytes()
            self.assertIn(b"/FontFile2", pdf, figure.name)
            self.assertNotIn(b"/Type3", pdf, figure.name)
            for box in re.findall(rb"/MediaBox \[ ?0 0 ([0-9.]+) ([0-9.]+)", pdf):
                self.assertAlmostEqual(float(box[0]), 3.3 * 72, 1)
                self.assertLess(float(box[1]), 9 * 72)

    def test_single_repetition_is_said_and_carries_no_interval(self):
        path = self.results(repetitions=1)
        self.good("throughput.py", path, "--out", self.folder)
        self.assertTrue(all(line["low"] == "" for line in read_csv(self.folder / "throughput.csv")))
        # matplotlib notes every text beside its outlines.
        self.assertIn("no intervals can be given", (self.folder / "throughput.svg").read_text())

    def test_single_thread_count(self):
        self.good("speedup.py", self.results(), "--out", self.folder)
        path = self.results(threads=(4,))
        self.good("throughput.py", path, "--out", self.folder)
        done = self.good("speedup.py", path, "--out", self.folder)
        self.assertRegex(done.stdout,
                         r"^speedup: left out for model: only one thread count was measured.*\n$")
        self.assertEqual(list(self.folder.glob("speedup*")), [], "files of the earlier run are stale")

    def test_nan_zero_and_absent_values_do_not_reach_a_median(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:1], threads=(1, 8), repetitions=4,
                             errors=False)
        for row in data["benchmarks"]:
            row["items_per_second"] = {0: 5e6, 1: math.nan, 2: 5e6, 3: None}[row["repetition_index"]]
            row["utilisation"] = 0.0
            for key in [k for k in row if k.startswith("latency") or k == "lock_wait_share"]:
                del row[key]
        path = write_results(self.folder / "results.json", data)
        self.good("report.py", path, "--out", self.folder)
        table = read_csv(self.folder / "figures/throughput.csv")
        self.assertEqual({(line["median"], line["n"]) for line in table}, {("5000000", "2")})
        self.assertFalse((self.folder / "figures/latency.csv").exists())

    def test_failed_trials_and_aggregates_are_not_samples(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:1], threads=(1, 8), errors=False)
        data["benchmarks"] += [row | {"error_occurred": True, "items_per_second": 1.0}
                               for row in data["benchmarks"][:3]]
        data["benchmarks"] += [row | {"run_type": "aggregate", "items_per_second": 1.0}
                               for row in data["benchmarks"][:3]]
        setup = results.load([write_results(self.folder / "results.json", data)])[0]
        self.assertGreater(setup.rows["items_per_second"].min(), 1.0)
        self.assertTrue(any("3 trials" in remark for remark in setup.remarks))

    def test_ten_thousand_rows_stay_below_half_a_gigabyte(self):
        data = model_results()
        self.assertGreater(len(data["benchmarks"]), 10_000)
        path = write_results(self.folder / "results.json", data)
        self.good("latency.py", path, "--out", self.folder)
        self.assertLess(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, 512 * 1024)


class Machines(InFolder):
    def test_machines_are_kept_apart(self):
        first = self.results("a.json")
        second = self.results("b.json", host_name="other", num_cpus=4)
        setups = results.load([first, second])
        self.assertEqual([s.label for s in setups], ["model", "other"])
        self.assertEqual([s.processing_units for s in setups], [16, 4])
        self.good("throughput.py", first, second, "--out", self.folder)
        self.assertTrue((self.folder / "model/throughput.pdf").exists()
                        and (self.folder / "other/throughput.pdf").exists())

    def test_builds_and_circumstances_of_one_machine_are_kept_apart(self):
        setups = results.load([self.results("a.json"), self.results("b.json", commit="fedcba9876"),
                               self.results("c.json", governor="powersave")])
        self.assertEqual(len({s.slug for s in setups}), 3)
        self.assertIn("commit fedcba9876", setups[1].label)
        self.assertIn("governor powersave", setups[2].label)

    def test_a_run_may_be_allowed_less_than_the_machine_has(self):
        allowed = {"units": 2, "cores": 1, "packages": 1, "numa_nodes": 1}
        setup, = results.load([self.results(allowed=allowed)])
        self.assertEqual((setup.processing_units, setup.cores, setup.packages), (2, 1, 1))

    def test_runs_of_one_machine_and_build_are_pooled_and_said(self):
        second = model_results(caches=few_caches(), workloads=kFewWorkloads, threads=(1, 2), errors=False,
                               noise=0.05,
                               os="another")
        setups = results.load([self.results("a.json", threads=(1, 2)),
                               write_results(self.folder / "b.json", second)])
        self.assertEqual(len(setups), 1)
        table = results.summarise(setups[0].rows, ["cache", "workload", "threads"], "items_per_second")
        self.assertEqual(set(table["n"]), {10})
        self.assertTrue(any("differ in os" in remark for remark in setups[0].remarks))

    def test_the_same_rows_count_once(self):
        first = self.results("a.json")
        copy = self.folder / "b.json"
        copy.write_bytes(first.read_bytes())
        once, twice = results.load([first])[0], results.load([first, first, copy])[0]
        self.assertEqual(len(once.rows), len(twice.rows))

    def test_placements_are_not_merged(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:1], threads=(1, 8), errors=False)
        data["benchmarks"] += [row | {"placement": "scatter", "real_time": row["real_time"] * 2}
                               for row in data["benchmarks"]]
        setup = results.load([write_results(self.folder / "results.json", data)])[0]
        self.assertEqual(set(setup.rows["panel"]), {"mix 90/10, hot spot, compact",
                                                    "mix 90/10, hot spot, scatter"})


class WrongInput(InFolder):
    def test_a_python_without_the_modules_is_told_in_one_line(self):
        done = subprocess.run([sys.executable, "-S", "-E", str(kPlots / "report.py"), "x"],
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"^[^\n]*no module matplotlib; [^\n]+\n$")

    def refused(self, script, *arguments):
        done = run(script, *arguments)
        self.assertEqual(done.returncode, 2)
        self.assertEqual(done.stdout, "")
        self.assertRegex(done.stderr, r"^[^\n]+\n$")

    def test_every_wrong_file_is_one_line_and_status_2(self):
        (self.folder / "text.json").write_text("not json")
        (self.folder / "bytes.json").write_bytes(b"\xff\xfe\x00")
        (self.folder / "list.json").write_text("[]")
        (self.folder / "empty.json").write_text('{"context": {}, "benchmarks": []}')
        (self.folder / "context.json").write_text('{"benchmarks": [{"name": "x"}]}')
        (self.folder / "rows.json").write_text('{"context": {}, "benchmarks": [{"name": "BM_x/1"}, 3]}')
        for name in ("absent", "text", "bytes", "list", "empty", "context", "rows"):
            with self.subTest(name):
                self.refused("throughput.py", self.folder / f"{name}.json", "--out", self.folder)
                self.refused("report.py", self.folder / f"{name}.json", "--out", self.folder)
        self.refused("report.py", self.folder, "--out", self.folder)

    def test_wrong_usage(self):
        self.refused("report.py")
        self.refused("throughput.py", "--nonsense")
        self.refused("throughput.py", self.results(), "--out", "/proc/nowhere")

    def test_help(self):
        for script in ["report.py", *(f"{figure.name}.py" for figure in FIGURES)]:
            done = self.good(script, "--help")
            self.assertIn("--out DIR", done.stdout)


class Report(InFolder):
    def page(self, *paths) -> str:
        self.good("report.py", *paths, "--out", self.folder / "out")
        return (self.folder / "out/report.html").read_text(encoding="utf-8")

    def test_the_page_needs_nothing_but_itself(self):
        images = self.folder / "images"
        images.mkdir()
        matplotlib.image.imsave(images / "room.png", np.zeros((4, 4)))
        (images / "room.json").write_text('{"scene": "cornell_box", "cache": "wait_free", "seconds": 0.25}')
        (images / "broken.png").write_text("no picture")
        page = self.page(self.results(errors=True))
        references = References(page)
        self.assertTrue(references.found)
        for reference in references.found:
            self.assertTrue(reference.startswith(("data:", "#")), reference[:80])
        self.assertFalse(references.tags & {"script", "iframe", "link", "object", "embed"})
        self.assertNotRegex(page, r"@import|url\(\s*['\"]?(?!#)")
        drawings = re.findall(r"data:image/svg\+xml;base64,([A-Za-z0-9+/=]+)", page)
        self.assertGreaterEqual(len(drawings), len(FIGURES))
        for drawing in drawings:
            content = base64.b64decode(drawing).decode()
            self.assertEqual(re.findall(r'(?<!xmlns=")(?<!xmlns:xlink=")https?://[^"]*', content), [])
        self.assertIn("data:image/png;base64,", page)
        self.assertIn("cornell box, cache wait_free, 250 ms", page)
        self.assertIn("broken.png is not a picture", page)

    def test_inner_links_lead_somewhere(self):
        page = self.page(self.results("a.json"), self.results("b.json", host_name="other", complete=False))
        for target in re.findall(r'href="#([^"]+)"', page):
            self.assertEqual(page.count(f'id="{target}"'), 1, target)
        self.assertIn("nothing is merged", page)
        self.assertIn('class="banner">Incomplete results (other)', page)
        self.assertIn("<code>figures/other/throughput.pdf</code>", page)

    def test_incomplete_results_stand_out(self):
        self.assertIn('class="banner">Incomplete', self.page(self.results(complete=False)))
        self.assertNotIn('class="banner"', self.page(self.results(complete=True)))

    def test_omitted_figures_are_named_with_the_reason(self):
        page = self.page(self.results(threads=(2,), workloads=("read_only",)))
        for line in ("Speed-up: left out, only one thread count",
                     "Speed against error: left out, no row has both",
                     "where wait-free access pays: left out, no miss_driven rows"):
            self.assertIn(line, page)
        self.assertNotIn('id="speedup"', page)

    def test_the_environment_and_the_command_are_shown(self):
        page = self.page(self.results(odd_key="<i>odd</i>"))
        self.assertIn("icbench sweep --threads 1,2,4 --out results.json", page)
        for key in set(kContext) - {"command_line"}:
            self.assertIn(f"<td>{key}</td>", page)
        self.assertIn("&lt;i&gt;odd&lt;/i&gt;", page)
        self.assertNotIn("<i>odd", page)

    def test_the_page_carries_the_medians(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:1], threads=(1, 8), errors=False)
        for row in data["benchmarks"]:
            row["items_per_second"] = 123.4e6 if row["cache"] == "packed_wait_free" else 61.7e6
        page = self.page(write_results(self.folder / "results.json", data))
        self.assertIn("<td>packed_wait_free</td><td class=\"n\">123 <small>[123, 123]</small></td>", page)
        self.assertIn('<div class="value">2.00× <span>[2.00, 2.00]</span></div>', page)

    def test_no_headline_without_a_comparison(self):
        caches = model_caches(("packed",), ("wait_free",), ())
        page = self.page(self.results(caches=caches, workloads=("read_only",)))
        self.assertIn("there is no headline", page)


class Correctness(InFolder):
    def verdicts(self, name="correctness.json", **sections) -> Path:
        return write_results(self.folder / name, model_verdicts(**sections))

    def changed(self, section: str, which: dict, **change) -> Path:
        """Verdicts with the entries of `section` that agree with `which` changed."""
        data = model_verdicts()
        matching = [e for e in data[section] if which.items() <= e.items()]
        self.assertTrue(matching)
        for entry in matching:
            entry |= change
        return write_results(self.folder / "correctness.json", data)

    def page(self, *arguments) -> str:
        small = self.results(caches=few_caches()[:1], workloads=("read_only",), threads=(1,), repetitions=1)
        self.good("report.py", small, *arguments, "--out", self.folder / "out")
        return (self.folder / "out/report.html").read_text(encoding="utf-8")

    def section(self) -> str:
        """The page's section without its figures."""
        found = correctness.read(self.folder / "correctness.json")
        return correctness_page.section(found, "correctness", {}, [])

    def holds(self, page: str, *parts: str):
        missing = [part for part in parts if part not in page]
        self.assertEqual(missing, [])

    def judge(self, path: Path) -> subprocess.CompletedProcess:
        return run("correctness.py", path)

    def test_a_sound_file_passes_and_fills_every_part(self):
        path = self.verdicts()
        self.assertEqual(self.judge(path).returncode, 0)
        page = self.page()
        self.assertEqual(page.count('class="banner"') + page.count('class="alarm"'), 0)
        self.holds(page, 'id="correctness"', 'id="correctness-promises"', 'id="correctness-witness"',
                   'id="correctness-steps"', '<div class="value">15 of 15</div>',
                   '<div class="value">4,000</div>', "with 1,500 overlapping pairs",
                   '<div class="value">2 of 2</div>', "2 of them by a schedule that can be replayed",
                   "1 scenario: every interleaving; 1 scenario: all interleavings with up to 3 preemptions",
                   "linearizable (not promised, <code>a:1201</code>)",
                   "after 17 schedules, replay <code>b:77</code>", "nothing concurrent was tested: sequential",
                   "which it does not promise, was seen violating it in 7 of 8 rounds",
                   "which it does not promise, was seen violating it after 17 schedules (replay b:77)",
                   '<td class="n">400</td>', "bound: 20 and 4 a level", "37 of 41",
                   "others wait while it holds the lock", "Processors &lt;other&gt; than this one.")
        self.assertEqual(References(page).tags & {"script", "iframe", "link", "object", "embed"}, set())
        for target in re.findall(r'href="#([^"]+)"', page):
            self.assertEqual(page.count(f'id="{target}"'), 1, target)

    def test_schedules_judged_by_several_checks_count_once(self):
        # Three caches, two scenarios each.
        self.verdicts()
        self.holds(self.section(), f'<div class="value">{3 * 5321:,}</div>')

    def test_the_matrix_tells_the_four_states_apart(self):
        path = self.changed("checks", {"cache": "global_mutex", "check": "regular"}, verdict="violated")
        found = correctness.read(path)
        state = {(cell.cache, cell.check): cell.state for cell in found.cells}
        self.assertEqual(state["wait_free", "integrity"], "held")
        self.assertEqual(state["global_mutex", "regular"], "BROKEN")
        self.assertEqual(state["wait_free", "linearizable"], "violated")
        self.assertEqual(state["sequential", "frame"], "not seen")
        self.good("promises.py", path, "--out", self.folder)
        table = {(line["cache"], line["check"]): line for line in read_csv(self.folder / "promises.csv")}
        self.assertEqual({key: line["state"] for key, line in table.items()}, state)
        self.assertEqual(table["wait_free", "linearizable"]["violated_in_schedules"], "True")
        self.assertEqual(float(table["wait_free", "linearizable"]["schedules"]), 5321)

    def test_a_promise_broken_in_a_history_is_an_alarm(self):
        path = self.changed("checks", {"cache": "wait_free_snapshot", "check": "linearizable"},
                            verdict="violated", violations=3, witness="the witness of it")
        done = self.judge(path)
        self.assertEqual(done.returncode, 1)
        self.assertIn("wait_free_snapshot promises linearizable and broke it (histories)", done.stdout)
        page = self.page()
        banner = '<div class="banner">Broken promise: wait_free_snapshot promises linearizable'
        self.assertEqual(page.count(banner), 2)  # at the top, too
        self.holds(page, '<div class="value">14 of 15</div>', "BROKEN: linearizable 3",
                   "<pre>the witness of it</pre>")

    def test_a_promise_broken_in_a_schedule_or_a_step_count_is_an_alarm(self):
        path = self.changed("schedules", {"cache": "wait_free", "check": "regular", "threads": 2},
                            verdict="violated", replay="c:5", witness="lost")
        self.assertIn("wait_free promises regular and broke it (schedules)", self.judge(path).stdout)
        self.holds(self.section(), "BROKEN: regular, <code>c:5</code>", "regular in a schedule, replay c:5")
        path = self.changed("progress", {"cache": "wait_free", "operation": "insert"}, verdict="violated",
                            most_steps=99)
        self.assertEqual(self.judge(path).returncode, 1)
        self.holds(self.section(), "wait_free promises a wait-free insert and broke that", "BROKEN</b>")

    def test_a_stress_that_sees_no_fault_is_too_weak(self):
        path = self.changed("controls", {"control": "wait_free"}, seen=False, rounds_violated=0)
        done = self.judge(path)
        self.assertEqual(done.returncode, 1)
        self.assertIn("too weak: wait_free was not seen violating linearizable in 8 rounds", done.stdout)
        self.holds(self.section(), '<div class="banner">The stress was too weak')
        path = self.changed("explored_controls", {"control": "wait_free"}, caught=False)
        self.assertIn("too weak: wait_free was not seen violating linearizable in 17 schedules",
                      self.judge(path).stdout)
        self.changed("explored_controls", {"control": "relaxed_publication"}, caught=False)
        self.holds(self.section(), "relaxed_publication was caught neither by histories nor by schedules",
                   "NOT CAUGHT")
        path = self.changed("progress_controls", {"control": "in_order"}, seen=False)
        self.assertIn("too weak: in_order was not seen to violate by the check of progress",
                      self.judge(path).stdout)
        self.holds(self.section(), "waits for those before it", "NOT SEEN")

    def test_older_files_lack_sections_and_the_page_says_so(self):
        path = self.verdicts(schedules=None, explored_controls=None, progress=None, not_examined=None)
        self.assertEqual(self.judge(path).returncode, 0)  # what this processor cannot show is excused
        page = self.page()
        self.assertEqual(page.count("was written by an icstress that did not examine it"), 2)
        self.holds(page,
                   "interleavings one by one, broken caches by schedule, step bounds and stopped threads",
                   "The fault of relaxed_publication: this processor does not show it",
                   "does not list what icstress left out", "<td>not examined</td>",
                   "Steps against interference: left out")
        self.assertEqual(page.count('class="banner"'), 0)

    def test_without_verdicts_the_page_says_how_to_get_them(self):
        page = self.page()
        self.assertEqual(page.count('id="correctness"'), 1)
        self.holds(page, "icstress --json")

    def test_verdicts_may_lie_elsewhere_and_be_several(self):
        folder = self.folder / "elsewhere"
        first = write_results(folder / "a.json", model_verdicts())
        second = write_results(folder / "b.json", model_verdicts(progress=None))
        page = self.page("--correctness", first, "--correctness", second, "--correctness", first)
        for anchor in ("correctness", "correctness-2", "correctness-2-promises"):
            self.assertEqual(page.count(f'id="{anchor}"'), 1, anchor)
        self.assertTrue((self.folder / "out/figures/correctness-2/promises.pdf").exists())

    def test_bounds_may_be_words_numbers_or_absent(self):
        self.assertEqual(correctness.bound_of({"bound": "4 a level", "bound_steps": 60}), (60, "4 a level"))
        self.assertEqual(correctness.bound_of({"bound": "", "bound_steps": 0}), (None, ""))
        self.assertEqual(correctness.bound_of({"bound": 60}), (60, ""))
        self.assertEqual(correctness.bound_of({"bound": None}), (None, ""))
        self.good("steps.py", self.verdicts(), "--out", self.folder)
        lines = read_csv(self.folder / "steps.csv")
        self.assertEqual({(line["cache"], line["bound"]) for line in lines if line["operation"] == "insert"},
                         {("sequential", ""), ("global_mutex", ""), ("wait_free", "60"),
                          ("wait_free_snapshot", "60")})
        self.assertEqual(len(lines), 4 * 2 * 5)

    def test_the_witness_is_drawn_from_its_stamps(self):
        path = self.verdicts()
        self.good("witness.py", path, "--out", self.folder)
        lines = read_csv(self.folder / "witness.csv")
        self.assertEqual([(line["thread"], line["call"], line["return"]) for line in lines],
                         [("1", "129", "130"), ("3", "153", "154"), ("0", "117", "204")])
        self.assertEqual([line["reason"] for line in lines],
                         ["returned before the next was called", "was seen by the next",
                          "did not see the first"])
        self.holds(self.section(), "It was seen by operation 3, so it comes before operation 3.",
                   "It did not see operation 1, so it comes before operation 1.")
        pending = correctness.steps_of(kCycle.replace("154]", "never]"))
        self.assertIsNone(pending[1].end)
        self.assertEqual(correctness.steps_of("something else\n  entirely"), [])

    def test_figures_are_one_column_wide_with_truetype_fonts(self):
        path = self.verdicts()
        for figure in CORRECTNESS_FIGURES:
            self.good(f"{figure.name}.py", path, "--out", self.folder)
            pdf = (self.folder / f"{figure.name}.pdf").read_bytes()
            self.assertIn(b"/FontFile2", pdf, figure.name)
            self.assertNotIn(b"/Type3", pdf, figure.name)
            for box in re.findall(rb"/MediaBox \[ ?0 0 ([0-9.]+) ([0-9.]+)", pdf):
                self.assertAlmostEqual(float(box[0]), 3.3 * 72, 1)

    def test_a_wrong_file_is_one_line_and_status_2(self):
        wrong = {"text": "not json", "list": "[]", "nothing": "{}", "controls": '{"checks": []}',
                 "empty": '{"checks": [], "controls": []}',
                 "entry": json.dumps(model_verdicts(checks=[3])),
                 "verdict": json.dumps(model_verdicts(checks=[model_verdicts()["checks"][0]
                                                              | {"verdict": "maybe"}])),
                 "type": json.dumps(model_verdicts(schedules=[{"cache": 1}])),
                 "pairs": json.dumps(model_verdicts(progress=[model_verdicts()["progress"][0]
                                                              | {"steps_by_interference": [[1]]}])),
                 "strings": json.dumps(model_verdicts(not_examined=[1]))}
        for name, content in wrong.items():
            with self.subTest(name):
                path = self.folder / f"{name}.json"
                path.write_text(content)
                with self.assertRaisesRegex(results.InputError, rf"^[^\n]+{name}\.json[^\n]+$"):
                    correctness.read(path)
        path = self.folder / "text.json"
        for script, *arguments in (("correctness.py", path), ("promises.py", path),
                                   ("report.py", self.results(), "--correctness", path)):
            done = run(script, *arguments)
            self.assertEqual((done.returncode, done.stdout), (2, ""))
            self.assertRegex(done.stderr, r"^[^\n]+text\.json[^\n]+\n$")
        self.assertEqual(run("correctness.py", self.folder / "absent.json").returncode, 2)
        self.assertEqual(run("correctness.py").returncode, 2)


class MainJob(InFolder):
    """bench/run around programs that hand out what was made before."""

    def setUp(self):
        super().setUp()
        self.root, self.out = self.folder / "root", self.folder / "results"
        (self.root / "bench").mkdir(parents=True)
        for name in ("run", "setup", "packages.txt"):
            shutil.copy(kRoot / "bench" / name, self.root / "bench" / name)
        (self.root / "plots").symlink_to(kPlots)
        self.program("../../../../tools/cmake", "")
        self.program("icbench", f'[[ $1 != sweep ]] || cp {self.results("made.json")} "$OUT"')

    def program(self, name: str, body: str):
        """A program that runs `body` with $OUT set to the value of its --out or --json."""
        path = self.root / "build/release/bin" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        (self.folder / "root/build/release/bin").mkdir(parents=True, exist_ok=True)
        path.write_text('#!/usr/bin/env bash\necho "${0##*/} $1" >>"$CALLS"\n'
                        'for i in "$@"; do [[ $last != --out && $last != --json ]] || OUT=$i; last=$i; done\n'
                        f"{body}\n")
        path.chmod(0o755)

    def job(self) -> subprocess.CompletedProcess:
        self.calls = self.folder / "calls"
        self.calls.write_text("")
        environment = os.environ | {"ICBENCH_PYTHON": sys.executable, "CALLS": str(self.calls),
                                    "PATH": f"{self.folder / 'tools'}:{os.environ['PATH']}"}
        return subprocess.run([self.root / "bench/run", "--quick", "--no-install", "--out", self.out],
                              capture_output=True, text=True, env=environment, check=False)

    def verdicts(self, broken: bool) -> Path:
        data = model_verdicts()
        if broken:
            data["checks"][0] |= {"verdict": "violated", "violations": 1}
        return write_results(self.folder / "verdicts.json", data)

    def test_a_sound_run_ends_with_the_report(self):
        self.program("icstress", f'cp {self.verdicts(False)} "$OUT"')
        done = self.job()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout.splitlines()[-1], str(self.out / "report.html"))
        self.assertIn('id="correctness-promises"', (self.out / "report.html").read_text())

    def test_a_broken_promise_hides_nothing_and_ends_with_status_1(self):
        self.program("icstress", f'cp {self.verdicts(True)} "$OUT"; exit 1')
        done = self.job()
        self.assertEqual(done.returncode, 1)
        self.assertIn("not every cache was shown to be correct", done.stderr)
        self.assertEqual(done.stdout.splitlines()[-1], str(self.out / "report.html"))
        self.assertIn('class="banner">Broken promise', (self.out / "report.html").read_text())

    def test_verdicts_of_another_run_are_not_taken_for_those_of_a_crash(self):
        self.program("icstress", f'cp {self.verdicts(False)} "$OUT"')
        self.assertEqual(self.job().returncode, 0)
        self.program("icstress", "kill -SEGV $$")
        self.assertEqual(self.job().returncode, 1)
        self.assertTrue((self.out / "correctness.previous.json").exists())
        self.assertNotIn('id="correctness-promises"', (self.out / "report.html").read_text())

    def test_a_resumed_run_keeps_its_verdicts_and_what_they_say(self):
        self.program("icstress", f'cp {self.verdicts(True)} "$OUT"; exit 1')
        plots = self.root / "plots"
        plots.unlink()  # no plots, no report: the run ends unfinished
        self.assertEqual(self.job().returncode, 1)
        plots.symlink_to(kPlots)
        done = self.job()
        self.assertNotIn("icstress", self.calls.read_text())
        self.assertEqual(done.returncode, 1)
        self.assertIn("broken promise: sequential promises integrity", done.stderr)
        self.assertTrue((self.out / "report.html").exists())


class Findings(InFolder):
    def setup_of(self, **options) -> results.Setup:
        return results.load([self.results(**options)])[0]

    def test_warnings_are_those_of_the_run(self):
        calm = self.setup_of(threads=(1, 8), repetitions=8, noise=0.001)
        self.assertEqual(cautions.cautions(calm), [])
        wild = self.setup_of(threads=(1, 32), noise=0.5, governor="unknown", hypervisor="kvm", complete=False,
                             equal_speed_pus=False, load_avg=[3.0, 2.0, 1.0])
        text = " ".join(w.text for w in cautions.cautions(wild))
        for word in ("incomplete", "virtual machine (kvm)", "governor is unknown", "not equally fast",
                     "not idle",
                     "Oversubscribed: 32", "Noisy:", "three to five repetitions"):
            self.assertIn(word, text)
        self.assertTrue(cautions.cautions(wild)[0].grave)

    def test_a_tie_is_undecided(self):
        caches = few_caches()
        data = model_results(caches=caches, workloads=kFewWorkloads[:1], threads=(8,), errors=False)
        for i, row in enumerate(data["benchmarks"]):
            row["items_per_second"] = 1e6 * (1 + 0.1 * math.sin(i))
        setup = results.load([write_results(self.folder / "results.json", data)])[0]
        self.assertIn("Undecided", findings.of_throughput(setup, "packed", 8).text)

    def test_what_strictness_costs_is_the_ratio_of_the_two(self):
        caches = model_caches(("ward",), ("global_mutex", "wait_free", "wait_free_snapshot"), ())
        data = model_results(caches=caches, workloads=kFewWorkloads, threads=(8,), errors=False)
        for row in data["benchmarks"]:
            rate = {"global_mutex": 1e6, "wait_free": 4e6, "wait_free_snapshot": 3e6}[row["cache"]]
            row |= {"items_per_second": rate, "real_time": row["queries"] / rate * 1e3}
        setup = results.load([write_results(self.folder / "results.json", data)])[0]
        found = findings.of_strictness(setup, 8)
        self.assertEqual(found.value, "0.750× [0.750, 0.750]")
        self.assertIn("of wait_free_snapshot, whose queries are atomic snapshots, over that of wait_free",
                      found.text)
        self.assertNotIn("Undecided", found.text)
        self.assertIn(found, findings.findings(setup))
        self.assertIsNone(findings.of_strictness(self.setup_of(), 8))  # only one of the two was measured

    def test_error_at_equal_time_is_the_ratio_at_the_caches_time(self):
        rows = []
        for repetition in range(3):
            shared = {"threads": 1, "scene": "box", "workload_kind": "ray_traced",
                      "repetition_index": repetition,
                      "real_time": 1.0, "time_unit": "s"}
            for spp in (1, 100):  # relMSE 1 / seconds
                rows.append(shared | {"name": f"pareto/path:{spp}/none/threads:1", "cache": "none",
                                      "spp": spp,
                                      "workload": f"box:path:spp={spp}", "integrator": "path",
                                      "structure": "none",
                                      "mechanism": "none", "seconds_indirect": float(spp),
                                      "relmse": 1.0 / spp})
            rows.append(shared | {"name": "pareto/box/wait_free/threads:1", "cache": "wait_free",
                                  "structure": "ward",
                                  "workload": "box:rays=8", "mechanism": "wait_free",
                                  "integrator": "irradiance_cache",
                                  "seconds_indirect": 10.0, "relmse": 0.02})
        path = write_results(self.folder / "results.json", {"context": kContext, "benchmarks": rows})
        found = findings.of_error(results.load([path])[0], "ward", 1)
        self.assertEqual(found.value, "5.00× [5.00, 5.00]")


if __name__ == "__main__":
    unittest.main()
