#!/usr/bin/env python3
"""Tests of plots/: what is drawn is what was measured, and nothing is claimed that was not.

Results come from a small model of threads that contend (a scalability law per cache), never from a real run; its
context says so.
"""
from __future__ import annotations

import json
import math
import zlib
from pathlib import Path

import numpy as np

kRoot = Path(__file__).resolve().parent.parent
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
           "append_log": ("append_log", "append_log", 0.03, 0.001, 1.2e7), "null": ("none", "none", 0.0, 0.0, 4e8)}
kContext = {
    "date": "2025-01-01T12:00:00+00:00", "host_name": "model", "cpu": "Model CPU (synthetic sample data)",
    "num_cpus": 16, "cores": 8, "packages": 2, "mhz_per_cpu": 3000, "cpu_scaling_enabled": False,
    "caches": [{"type": "Data", "level": 1, "size": 32768, "num_sharing": 2},
               {"type": "Unified", "level": 3, "size": 33554432, "num_sharing": 8}],
    "boundaries": [{"threads": 5, "kind": "package"}, {"threads": 9, "kind": "smt"},
                   {"threads": 17, "kind": "oversubscribed"}],
    "governor": "performance", "kernel": "Linux 6.1", "compiler": "GNU 12.2.0", "flags": "-O3 -march=native",
    "commit": "0123456789abcdef", "seed": 42, "placement": "compact", "load_avg": [0.1, 0.1, 0.1],
    "equal_speed_pus": True, "complete": True, "command_line": "icbench sweep --threads 1,2,4 --out results.json"}
kWorkloads = ["read_only:order=uniform", "read_only:order=hot_spot", "mix_90_10:order=uniform",
              "mix_90_10:order=hot_spot", "mix_50_50:order=hot_spot", "insert_only", "miss_driven:cost=0",
              "miss_driven:cost=1", "miss_driven:cost=4", "miss_driven:cost=16", "miss_driven:cost=64",
              "miss_driven:cost=256", "cornell_box:rays=64:a=0.2:order=morton", "sibenik:rays=64:a=0.2:order=morton"]


def model_caches(structures=tuple(kStructures), mechanisms=tuple(kMechanisms), loners=tuple(kLoners)) -> list[dict]:
    caches = []
    for structure in structures:
        prefix, speed = kStructures[structure]
        for name in mechanisms:
            mechanism, alpha, beta, factor = kMechanisms[name]
            caches.append({"cache": prefix + name, "structure": structure, "mechanism": mechanism, "alpha": alpha,
                           "beta": beta, "speed": speed * factor})
    for name in loners:
        structure, mechanism, alpha, beta, speed = kLoners[name]
        caches.append({"cache": name, "structure": structure, "mechanism": mechanism, "alpha": alpha, "beta": beta,
                       "speed": speed})
    return caches


def model_row(cache: dict, workload: str, threads: int, repetition: int, noise: float) -> dict:
    """One repetition of the model: the Universal Scalability Law with SMT, oversubscription and noise."""
    random = np.random.default_rng([zlib.crc32(f"{cache['cache']}{workload}{threads}".encode()), repetition])
    base, *rest = workload.split(":")
    parameters = dict(p.split("=") for p in rest)
    kind = ("mix" if base.startswith("mix") else base if base in ("read_only", "insert_only", "miss_driven")
            else "ray_traced")
    writes = {"read_only": 0.0, "insert_only": 1.0, "mix": int(base.split("_")[-1]) / 100 if kind == "mix" else 0,
              "miss_driven": 0.1, "ray_traced": 0.05}[kind]
    hot = 2.0 if parameters.get("order") == "hot_spot" else 1.0
    free = "mutex" not in cache["mechanism"] and "spin" not in cache["mechanism"] and "rw" not in cache["mechanism"]
    pressure = hot * (0.3 + 2 * writes)
    cost = float(parameters.get("cost", 0)) + (0.05 * float(parameters["rays"]) if kind == "ray_traced" else 0)
    own = 1e6 * (1 + 6 * writes) / cache["speed"]  # microseconds of an operation in the cache
    share = own / (own + cost * 0.1)
    alpha, beta = min(0.97, cache["alpha"] * pressure * share), cache["beta"] * pressure * share
    units = min(threads, 8) + 0.3 * max(0, min(threads, 16) - 8)
    loss = 1.0 if free else 1 + 0.25 * max(0.0, math.log2(threads / 16)) * (share ** 0.5)
    rate = 1e6 / (own + cost * 0.1) * units / (1 + alpha * (units - 1) + beta * units * (units - 1)) / loss
    rate *= float(np.exp(random.normal(0, noise * (1 + (threads > 16)))))
    operations = 2_000_000
    inserts = max(1, int(operations * writes)) if writes else 0
    redundant = 0 if threads == 1 else int(inserts * 0.002 * threads * (12 if "local" in cache["mechanism"] else 1))
    waiting = 0.0 if free or threads == 1 else 1 - 1 / (1 + alpha * (units - 1))
    row = {"name": f"sweep/{workload}/{cache['cache']}/threads:{threads}", "run_type": "iteration", "iterations": 1,
           "repetition_index": repetition, "cache": cache["cache"], "workload": workload, "workload_kind": kind,
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
        for percentile, growth in (("p50", 1), ("p90", 1.8), ("p99", 4), ("p999", 9 * tail), ("max", 60 * tail**1.5)):
            row[f"latency_{operation}_{percentile}_ns"] = 1e9 / cache["speed"] * factor * growth * random.uniform(0.95, 1.05)
    if parameters.get("order"):
        row["order"] = parameters["order"]
    if kind == "miss_driven":
        row["record_cost_us"] = cost
    if kind == "ray_traced":
        row |= {"scene": base, "integrator": "irradiance_cache", "rays_per_record": int(parameters["rays"]),
                "accuracy": float(parameters["a"]), "reference_relmse": 2e-5}
    return row


def model_errors(caches: list[dict], threads=(1, 8, 32), scenes=("cornell_box", "sibenik"), repetitions=5) -> list[dict]:
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
                            row["seconds_indirect"] = ((rays * 0.02 / a**1.4 + 40e6 / cache["speed"]) / units * slow
                                                       * row["real_time"] / model_row(cache, workload, count, 0, 0.0)["real_time"])
                            row["relmse"] = (0.004 * a**2 + 0.03 / rays * a + 2e-5) * (1 + 0.02 * repetition)
                            row["name"] = row["name"].replace("sweep/", "pareto/")
                            row["rmse"], row["mean_ratio"] = row["relmse"] ** 0.5, 0.99
                            rows.append(row)
                for spp in (1, 4, 16, 64, 256):
                    random = np.random.default_rng([spp, count, repetition])
                    rows.append({"name": f"pareto/{scene}:path:spp={spp}/none/threads:{count}", "run_type": "iteration",
                                 "repetition_index": repetition, "cache": "none", "workload": f"{scene}:path:spp={spp}",
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
        rows += model_errors([c for c in caches if c["mechanism"] in ("none", "global_mutex", "local_write", "wait_free")
                              and c["cache"] != "null" and not c["cache"].endswith("sequential")])
    return {"context": kContext | context, "benchmarks": rows}


def write_results(path: Path, results: dict) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(results), encoding="utf-8")
    return path
