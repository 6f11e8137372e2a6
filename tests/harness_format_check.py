"""Checks that a results file is what Google Benchmark's readers expect; exits 1 with the reason if not.

Usage: harness_format_check.py FILE. If Google Benchmark's own tools are installed (/usr/share/benchmark), its loader
reads the file as well.
"""
import json
import os
import sys

CONTEXT = {"date": str, "host_name": str, "executable": str, "num_cpus": int, "mhz_per_cpu": int,
           "cpu_scaling_enabled": bool, "caches": list, "load_avg": list, "library_build_type": str}
CACHE = {"type": str, "level": int, "size": int, "num_sharing": int}
ENTRY = {"name": str, "run_name": str, "run_type": str, "repetitions": int, "repetition_index": int, "threads": int,
         "iterations": int, "real_time": (int, float), "cpu_time": (int, float), "time_unit": str}


def check(fields, holder, where):
    for key, kind in fields.items():
        if key not in holder:
            sys.exit(f"{where} lacks {key}")
        if not isinstance(holder[key], kind):
            sys.exit(f"{where}: {key} is {holder[key]!r}")


def main(path):
    with open(path, encoding="utf-8") as file:
        text = file.read()
    # Standard JSON only: json.load would take NaN and Infinity too.
    results = json.loads(text, parse_constant=lambda name: sys.exit(f"{name} is no JSON"))
    if list(results) != ["context", "benchmarks"]:
        sys.exit(f"top level holds {list(results)}")
    check(CONTEXT, results["context"], "context")
    for cache in results["context"]["caches"]:
        check(CACHE, cache, "cache")
    for entry in results["benchmarks"]:
        check(ENTRY, entry, "entry")
        if entry["run_type"] != "iteration" or entry["time_unit"] not in ("ns", "us", "ms", "s"):
            sys.exit(f"entry {entry['name']} is no iteration")
    tools = "/usr/share/benchmark"
    if os.path.isdir(tools):
        sys.path.insert(0, tools)
        from gbench import util
        if util.classify_input_file(path)[0] != util.IT_JSON:
            sys.exit("Google Benchmark's tools do not recognise the file")


if __name__ == "__main__":
    main(sys.argv[1])
