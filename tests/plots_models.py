"""Results and verdicts made up by a model of contention, for the tests of the plots."""
from __future__ import annotations

import itertools
import math
import sys
import zlib
from pathlib import Path

import numpy as np

kRoot = Path(__file__).resolve().parent.parent
kPlots = kRoot / "plots"
sys.path.insert(0, str(kPlots))

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
kFewWorkloads = ("mix_90_10:order=hot_spot", "miss_driven:cost=1", "miss_driven:cost=64")


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


def few_caches(structures=("packed",)) -> list[dict]:
    return model_caches(structures, ("sequential", "global_mutex", "shared_mutex", "local_write",
                                      "wait_free"), ())


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
    going = dict(work=0.4, redundant=0.02, query=0.3, insert=0.1, merge=0.01, descheduled_holding=0.03,
                 descheduled_between=0.03, barrier=0.06, other=0.05)
    shares = ({part: 0.99 * share * (1 - waiting) for part, share in going.items()}
              | {"lock_wait": 0.3 * 0.99 * waiting, "descheduled_wanting": 0.7 * 0.99 * waiting})
    row |= {f"time_{part}_share": share for part, share in shares.items()} | {"time_unexplained": 0.01}
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
                for integrator, spp in itertools.product(("path", "hash_cells"), (1, 4, 16, 64, 256)):
                    random = np.random.default_rng([spp, count, repetition])
                    rows.append({"name": f"pareto/{scene}:{integrator}:spp={spp}/none/threads:{count}",
                                 "run_type": "iteration",
                                 "repetition_index": repetition, "cache": "none",
                                 "workload": f"{scene}:{integrator}:spp={spp}",
                                 "workload_kind": "ray_traced", "structure": "none", "mechanism": "none",
                                 "threads": count, "placement": "compact", "oversubscribed": count > 16,
                                 "real_time": spp * 400 / units, "time_unit": "ms", "scene": scene,
                                 "integrator": integrator, "spp": spp, "reference_relmse": 2e-5,
                                 "seconds_indirect": spp * 0.4 / units * random.uniform(0.98, 1.02),
                                 "relmse": (0.05 if integrator == "path" else 0.01) / spp
                                 * random.uniform(0.97, 1.03) + 2e-5})
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


def model_pareto(scenes=("cornell_box", "sibenik"), methods=None, repetitions=3, noise=0.05, **context) -> dict:
    """A file of icbench pareto: `methods` have settings of (seconds, relMSE)."""
    methods = methods or {"path": [(0.03, 0.6), (0.1, 0.2), (0.3, 0.06), (1.0, 0.02)],
                          "irradiance_cache": [(0.04, 0.03), (0.1, 0.01), (0.5, 0.004)],
                          "hash_cells": [(0.035, 0.1), (0.2, 0.03)]}
    random = np.random.default_rng(5)
    rows = []
    for repetition in range(repetitions):
        for scene in scenes:
            for method, settings in methods.items():
                for number, (seconds, relmse) in enumerate(settings):
                    error = relmse * float(np.exp(random.normal(0, noise)))
                    took = seconds * float(np.exp(random.normal(0, noise)))
                    rows.append({
                        "name": f"pareto/{scene}/{method}/setting:{number}", "run_type": "iteration",
                        "repetition_index": repetition, "threads": 2, "real_time": took * 1.2e3, "time_unit": "ms",
                        "scene": scene, "method": method, "integrator": method, "cache": "none", "width": 64,
                        "height": 64, "seed": 7 + repetition, "seconds": took * 1.2, "seconds_indirect": took,
                        "relmse": error, "rmse": error**0.5 / 10,
                        "relmse_irradiance": 0.9 * error, "rmse_irradiance": error**0.5 / 3, "flip": error**0.5 / 5,
                        "hdrvdp_p75": min(100.0, 500 * error), "hdrvdp_p95": min(100.0, 300 * error),
                        "mean_ratio": 1.0, "full_rmse": error, "full_relmse": error + 0.01, "rays": 1000,
                        "reference_spp": 64, "reference_rmse": 0.001, "reference_relmse": 0.003,
                        "reference_rmse_irradiance": 0.004, "reference_relmse_irradiance": 0.0028, "relmse_scale": 2.5,
                        "below_reference": error < 0.006}
                        | ({"bias": 0.01, "deviation": 0.02, "bias_runs": repetition + 1} if repetition else {}))
    return {"context": kContext | context, "benchmarks": rows}


def model_preempt(stalled=None, repetitions=3, **context) -> dict:
    """A file of icbench preempt: `stalled` tells for each cache what the others lose while a thread is held."""
    stalled = stalled or {"packed_global_mutex": 0.5, "packed_wait_free": 0.0}
    rows = []
    for repetition in range(repetitions):
        for cache, share in stalled.items():
            for held in (False, True):
                row = {"name": f"preempt/mix_90_10/{cache}/threads:4/{'held' if held else 'free'}",
                       "repetition_index": repetition, "threads": 4, "real_time": 5.0 + repetition, "time_unit": "ms",
                       "cache": cache, "workload": "mix_90_10", "hold_ms": 10, "held": held, "holds": 20 * held,
                       "stalled_share": share if held else 0.0, "others_operations_per_second": 1e6}
                longest = 1e7 if held and share else 2e4
                for operation in ("query", "insert"):
                    row |= {f"latency_{operation}_{p}_ns": ns * (1 + 0.1 * repetition)
                            for p, ns in (("p10", 100), ("p50", 200), ("p90", 300), ("p999", 5000), ("max", longest))}
                    row[f"latency_{operation}_samples"] = 100_000
                rows.append(row)
    return {"context": kContext | context, "benchmarks": rows}


def model_timeline(threads=2) -> dict:
    """A file of icbench sweep --timeline: 1 ms, in which every thread computes, then waits in a query, then is idle."""
    events = [{"name": "process_name", "ph": "M", "pid": 1, "tid": 0, "args": {"name": "sweep/a/b/threads:2"}}]
    for t in range(threads):
        events.append({"name": "thread_name", "ph": "M", "pid": 1, "tid": t, "args": {"name": f"thread {t}"}})
        for name, ts, dur, extra in (("compute a record", 0, 500, {"args": {"off_processor_us": 100}}),
                                     ("query", 500, 250, {}), ("wait for a lock", 500, 150, {}),
                                     ("idle at a barrier", 750, 250, {})):
            events.append({"name": name, "cat": "x", "ph": "X", "pid": 1, "tid": t, "ts": ts, "dur": dur} | extra)
    return {"traceEvents": events, "displayTimeUnit": "ns", "otherData": {"spans_left_out": 0}}


def model_repeatability(scene="cornell_box", differences=None, repetitions=3, **context) -> dict:
    """A file of icbench repeatability: `differences` tells for each cache how far threads move a picture of mean 0.5
    and error 0.02, None for a cache that serves one thread.
    """
    differences = differences or {"sequential": None, "null": 0.0, "global_mutex": 0.004, "wait_free": 0.002}
    rows = []
    for repetition in range(repetitions):
        for cache, difference in differences.items():
            fewer = 0
            for threads in (1, 2, 8) if difference is not None else (1,):
                far = 0.0 if threads == 1 else difference * (1 + 0.1 * repetition)
                row = {"name": f"repeatability/{scene}/irradiance_cache/{cache}/threads:{threads}",
                       "repetition_index": repetition, "threads": threads, "real_time": 5.0 + repetition,
                       "time_unit": "ms", "scene": scene, "integrator": "irradiance_cache", "cache": cache,
                       "single_thread": difference is None, "oversubscribed": threads > 2, "accuracy": 0.2,
                       "rays_per_record": 64, "width": 32, "height": 32, "seed": 1, "seconds": 0.02,
                       "seconds_indirect": 0.01, "records": 100, "records_made": 100 + threads,
                       "redundant_records": threads - 1, "mean": 0.5, "rmse": 0.0201, "reference_rmse": 0.002,
                       "reference_spp": 64, "error": 0.02}
                kinds = {"rms_to_single": far}
                if repetition:
                    kinds["rms_to_last_run"] = 1.2 * far
                if fewer:
                    kinds["rms_to_fewer_threads"] = 1.1 * far
                for kind, value in kinds.items():
                    row |= {kind: value, f"{kind}_share_of_mean": value / 0.5, f"{kind}_share_of_error": value / 0.02}
                rows.append(row)
                fewer = threads
    return {"context": kContext | context, "benchmarks": rows}


def model_anatomy(repetitions=5, **context) -> dict:
    """A file of anatomy: queries to Ward's structure take 2,000 ns, to the packed one 400, whatever the points; a load
    that waits for the one before 10 ns from 1 MiB, 160 from 64. A thread executes 8 instructions a nanosecond at most,
    and the packed query 1,000.
    """
    times = {"wait_free": 2000, "replicated": 800, "packed_scalar": 700, "packed_wait_free": 400, "packed_batch": 200,
             "packed_frozen": 380, "told": 80}
    executes = {"wait_free": 9000.0, "replicated": 2500.0, "packed_scalar": 2000.0, "packed_wait_free": 1000.0,
                "packed_batch": 1000.0, "packed_frozen": 900.0, "told": 250.0}
    reads = {"wait_free": {"cache_lines": 90.0, "lists": 50.0, "items": 60.0, "records_read": 60.0},
             "packed_wait_free": {"cache_lines": 20.0, "lists": 3.0, "items": 40.0, "records_read": 8.0}}
    rows = []
    for points in ("random", "coherent"):
        for part, ns in times.items():
            for repetition in range(repetitions):
                row = {"name": f"anatomy/{points}/{part}", "repetition_index": repetition, "real_time": ns * 0.016,
                       "time_unit": "ms", "part": part, "points": points, "records": 100000,
                       "ns_per_query": ns * (1 + 0.01 * repetition)}
                if repetition == 0 and part in reads:
                    valid = [{"p": [0.01 * k, 0.0, 0.02], "radius": 0.5, "valid": k < 6}
                             for k in range(int(reads[part]["records_read"]))]
                    row |= reads[part] | {"records_valid": 6.0, "bytes_per_record": 110.0, "example": {
                        "p": [0.0, 0.0, 0.0], "n": [0.0, 1.0, 0.0], "accuracy": 0.2, "cache_lines": 90, "lists": 50,
                        "items": 60, "records": valid}}
                if repetition == 0:
                    row |= {"instructions": executes[part], "lines_from_memory": 0.004 * ns}
                rows.append(row)
    for name, value in (("lines", 0.1), ("instructions", 8.0)):
        rows += [{"name": f"anatomy/roof/{name}", "repetition_index": repetition, "real_time": 1.0, "time_unit": "ms",
                  f"{name}_per_ns": value} for repetition in range(repetitions)]
    context = {"counted": {"tool": "valgrind-3.19.0", "last_level_bytes": 2**22}} | context
    for mib, ns in ((1, 10.0), (64, 160.0)):
        rows += [{"name": f"anatomy/memory/{mib}MiB", "repetition_index": repetition, "real_time": ns * 0.2,
                  "time_unit": "ms", "block_bytes": mib * 2**20, "ns_per_load": ns}
                 for repetition in range(repetitions)]
    return {"context": kContext | context, "benchmarks": rows}


def model_simulated(threads=(1, 16, 256), validated=2, measured=(), **model) -> dict:
    """A file of icbench simulate; with `measured` threads those rows are as --validate makes them."""
    made = model_results(**({"caches": few_caches(), "workloads": kFewWorkloads, "repetitions": 1, "errors": False}
                            | model), threads=threads)
    made["context"] |= {"simulated": True, "virtual_machine": {"cores_per_complex": 8},
                        "calibration": {"file": "costs/calibration.json", "host_name": "model",
                                        "date": "2025-01-02T10"}}
    for row in made["benchmarks"]:
        row |= {"name": "simulate" + row["name"].removeprefix("sweep"), "simulated": True,
                "validated_to_threads": validated}
        if row["threads"] in measured:
            row |= {"measured_items_per_second": 1.25 * row["items_per_second"], "error_items_per_second": 0.21,
                    "rounds": 9}
    return made


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
