#!/usr/bin/env python3
"""plots/FIELDS.md against the programs: every field of small results of every command is named there, in its section;
what is said to be there always is; and no name there is one that the sources do not know.
"""

import json
import os
import re
import subprocess
import unittest
from functools import cache
from pathlib import Path

from cli_support import (ICBENCH, PATIENCE, SCENE, Case, small_capture, small_pareto, small_render, small_repeatability,
                         small_sweep)

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "plots/FIELDS.md"
SOURCES = ("src", "bench", "stress")
# Sections of the page.
FORM, CONTEXT, SWEEP, SIMULATE, PREEMPT, REPEATABILITY, PARETO, FRAMES, PROGRAMS = range(1, 10)
# Objects whose keys are data: numbers of threads, workloads, caches; and a copy of the context.
OPEN = re.compile(r"(.*\.)?(pin_map|traces|errors|environment)")
# Arrays whose objects have the fields of a table of their own, by their names alone.
OF_ONE_TABLE = re.compile(r"(frames|checks|controls|schedules|explored_controls|progress|progress_controls|budgets|"
                          r"pictures|traceEvents)\[\]\.|(otherData)\.")
PERCENTILE = re.compile(r"latency_(query|insert)_p\d+_ns")
LATENCY = re.compile(r"latency_(query|insert)_")


def paths(value, at=""):
    """Names of all fields within: "a", "a.b" of the object a, "a[].b" of those in the array a."""
    if isinstance(value, list):
        return {name for item in value for name in paths(item, at + "[]")}
    if not isinstance(value, dict):
        return set()
    names = {f"{at}.{key}" if at else key for key in value}
    return names | {name for key, item in value.items() if not OPEN.fullmatch(inner := f"{at}.{key}" if at else key)
                    for name in paths(item, inner)}


def named_as(name):
    """How the page may name a field."""
    if PERCENTILE.fullmatch(name):
        return {"latency_OPERATION_pNN_ns"}
    alone = OF_ONE_TABLE.sub("", name)
    return {name, alone, LATENCY.sub("latency_OPERATION_", name)}


class Table:
    """A table of fields: their names and when they are there."""

    def __init__(self, section):
        self.section = section
        self.rows = []

    def names(self):
        return {name for names, _ in self.rows for name in names}

    def always(self):
        """Those of every row, or file; without what lies within others, and names that stand for several."""
        return {name for names, when in self.rows for name in names
                if when == "always" and "." not in name and "OPERATION" not in name}


@cache
def page():
    """The text of every section, and the tables."""
    sections, tables, section, is_in_table = {}, [], 0, False
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if heading := re.match(r"## (\d)\. ", line):
            section = int(heading[1])
        sections[section] = sections.get(section, "") + line + "\n"
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else None
        if cells and not is_in_table:
            tables.append(Table(section))
        elif cells and cells[0].startswith("`"):
            tables[-1].rows.append((re.findall(r"`([^`]+)`", cells[0]), cells[-1]))
        is_in_table = cells is not None
    return sections, tables


def tables_of(section):
    return [table for table in page()[1] if table.section == section]


def quoted(section):
    return set(re.findall(r"`([^`\n]+)`", page()[0][section]))


@cache
def sources():
    files = (path for folder in SOURCES for path in sorted((ROOT / folder).rglob("*"))
             if path.is_file() and path.suffix in (".cpp", ".h", ".py", ""))
    return "\n".join(path.read_text(encoding="utf-8", errors="replace") for path in files)


def is_in_sources(name):
    """Whether the sources spell a field's name, in one piece or as the patterns put it together."""
    name = re.split(r"\.|\[\]", name)[-1]
    if name.startswith("latency_OPERATION_"):
        parts = ["latency_{}_samples"] if name.endswith("samples") else ["latency_{}_{}_ns"]
        return all(part in sources() for part in parts)
    if share := re.fullmatch(r"time_(\w+)_share", name):
        return "time_{}_share" in sources() and f'put("{share[1]}"' in sources()
    if share := re.fullmatch(r"(rms_\w+)(_share_of_\w+)", name):
        return f'"{share[1]}"' in sources() and f'"{share[2]}"' in sources()
    if part := re.fullmatch(r"hdrvdp_(p\d+)", name):
        return "hdrvdp_{}" in sources() and f'"{part[1]}"' in sources()
    return f'"{name}"' in sources()


class Fields(Case):
    def assert_named(self, found, *sections):
        known = set().union(*(quoted(section) for section in sections))
        missing = sorted(name for name in found if not named_as(name) & known)
        self.assertEqual(missing, [], f"fields that section {sections[0]} of {PAGE} does not name")

    def check_results(self, name, section):
        """A results file: its context, its configuration, and its rows, which this section is about."""
        results = self.load(name)
        context = dict(results["context"])
        configuration = context.pop("configuration")
        of_rows = tables_of(FORM) + (tables_of(section) if section != PROGRAMS else [])
        of_context, of_configuration = tables_of(CONTEXT)
        self.assert_named(paths(context), CONTEXT, SIMULATE)
        self.assert_named(configuration, CONTEXT)
        self.assertLessEqual(of_context.always(), {*context, "configuration"})
        self.assertLessEqual(of_configuration.always(), configuration.keys())
        always = set().union(*(table.always() for table in of_rows))
        for row in results["benchmarks"]:
            self.assert_named(paths(row), section, FORM)
            self.assertLessEqual(always, row.keys(), row["name"])
        return results

    def run_program(self, name, *arguments):
        done = subprocess.run([Path(ICBENCH).parent / name, *map(str, arguments)], cwd=self.folder, text=True,
                              capture_output=True, timeout=PATIENCE)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_every_name_is_known_to_the_sources(self):
        tables = page()[1]
        self.assertGreater(len(tables), 20)
        for table in tables:
            unknown = sorted(name for name in table.names() if not is_in_sources(name))
            self.assertEqual(unknown, [], f"section {table.section}")

    def test_sweep(self):
        workloads = ["read_only:records=2000:operations=2000", "insert_only:records=500",
                     "mix_90_10:records=2000:operations=4000:order=hot_spot", "miss_driven:cost=0:operations=2000",
                     f"{SCENE}:rays=4:size=32x32", f"{SCENE}:integrator=path:spp=1:size=32x32",
                     f"{SCENE}:integrator=hash_cells:spp=1:size=32x32"]
        sweep = small_sweep(caches="null,global_mutex,local_write,packed_wait_free", workloads=",".join(workloads),
                            threads="1,3", out="sweep.json", **{"reference-spp": 2})
        self.succeed(*sweep, "--breakdown")
        self.succeed(*sweep, "--breakdown", "--resume")
        results = self.check_results("sweep.json", SWEEP)
        self.assertIn("resumed", results["context"])
        self.assertIn("time_work_share", results["benchmarks"][0])

    def test_sweep_with_a_timeline(self):
        self.succeed(*small_sweep(out="one.json", workloads="miss_driven:operations=2000", timeline="timeline.json"))
        self.check_results("one.json", SWEEP)
        self.assert_named(paths(self.load("timeline.json")), SWEEP)

    def test_trace(self):
        self.succeed(*small_capture(out="a.trace", json="capture.json"))
        self.succeed("trace", "info", "a.trace", "--json", "info.json")
        self.succeed("trace", "replay", "a.trace", "--caches", "global_mutex,packed_wait_free", "--threads", "1,2",
                     "--repetitions", 1, "--json", "replay.json")
        self.succeed(*small_sweep(workloads="trace:file=a.trace", out="sweep.json"))
        self.assert_named(paths(self.load("capture.json")), FRAMES)
        self.assert_named(paths(self.load("info.json")), FRAMES)
        self.check_results("replay.json", SWEEP)
        self.check_results("sweep.json", SWEEP)

    def test_simulate(self):
        simulate = ["simulate", "--calibration", "costs.json", "--caches", "packed_global_mutex,packed_wait_free"]
        self.succeed(*small_capture(out="a.trace"))
        misses = "miss_driven:cost=1:operations=2000"
        self.succeed(*simulate, "--cores", "1,2", "--workloads", f"trace:file=a.trace,{misses}", "--transfer",
                     "20,100,200", "--hand-over", "1000,5000", "--out", "simulated.json")
        self.check_results("simulated.json", SIMULATE)
        if len(os.sched_getaffinity(0)) < 2:
            return  # nothing to validate against
        validated = self.run_icbench(*simulate, "--workloads", misses, "--repetitions", 2, "--validate", "--out",
                                     "validation.json")
        self.assertIn(validated.returncode, (0, 1), validated.stderr)  # near the measured figures, or not
        self.check_results("validation.json", SIMULATE)
        self.succeed(*simulate, "--cores", "1,2", "--workloads", misses, "--out", "again.json")
        self.assertIn("validation", self.check_results("again.json", SIMULATE)["context"]["calibration"])

    def test_preempt(self):
        self.succeed("preempt", "--workload", "mix_90_10:operations=50000", "--caches", "packed_global_mutex",
                     "--threads", 2, "--hold-ms", 2, "--pause-ms", 2, "--repetitions", 1, "--out", "preempt.json")
        self.check_results("preempt.json", PREEMPT)

    def test_repeatability(self):
        self.succeed(*small_repeatability(out="a.json"))
        self.succeed(*small_repeatability(out="b.json", integrator="instant_caching", vpls=16))
        self.check_results("a.json", REPEATABILITY)
        self.check_results("b.json", REPEATABILITY)

    def test_pareto(self):
        methods = "path,hash_cells,irradiance_cache,instant_caching,instant_gi"
        self.succeed(*small_pareto(methods=methods, repetitions=2, out="pareto.json", images="shots"))
        self.check_results("pareto.json", PARETO)
        self.assert_named(paths(self.load("shots/images.json")), PARETO)

    def test_frames(self):
        for integrator in (row["name"] for row in json.loads(self.succeed("list", "integrators", "--json"))):
            with self.subTest(integrator):
                asked = small_render(integrator=integrator, vpls=16, residual=0.5, json="a.json", out="a.exr")
                self.succeed(*asked)
                self.assert_named(paths(self.load("a.json")), FRAMES)
                self.succeed("animate", *small_render(integrator=integrator, vpls=16, frames=2, json="b.json",
                                                      format="none")[1:])
                self.assert_named(paths(self.load("b.json")), FRAMES)
        self.succeed(*small_render(out="a.exr", **{"save-cache": "a.cache"}))
        self.succeed(*small_render(out="a.exr", json="loaded.json", **{"load-cache": "a.cache"}))
        self.assertIn("records_loaded", loaded := paths(self.load("loaded.json")))
        self.assert_named(loaded, FRAMES)

    def test_compare(self):
        metrics = ",".join(row["name"] for row in json.loads(self.succeed("list", "metrics", "--json")))
        for folder in "ab":
            self.succeed("animate", *small_render(frames=2, format="exr", out=folder)[1:])
        for what in "a", "a/frame_0000.exr":
            self.succeed("compare", what, what.replace("a", "b", 1), "--metrics", metrics, "--json", "compared.json")
            self.assert_named(paths(self.load("compared.json")), FRAMES)

    @unittest.skipUnless((Path(ICBENCH).parent / "anatomy").is_file(), "no anatomy beside icbench")
    def test_anatomy(self):
        self.run_program("anatomy", "--scene", "white_furnace", "--records", 1000, "--repetitions", 1,
                         "--out", "a.json")
        self.check_results("a.json", PROGRAMS)
        # However often a query comes by a record, it has read one; and all structures hold the same valid ones.
        # None reads what Ward's structure, which looks furthest around, does not know there.
        read, valid = {}, {}
        for row in (row for row in self.load("a.json")["benchmarks"] if "example" in row):
            records = [json.dumps(record) for record in row["example"]["records"]]
            self.assertEqual(len(set(records)), len(records), row["name"])
            read[row["points"], row["part"]] = set(records)
            valid.setdefault(row["points"], []).append({r for r in records if json.loads(r)["valid"]})
        for points in ("random", "coherent"):
            self.assertEqual(valid[points], valid[points][:1] * 3, points)
            for part in ("packed_wait_free", "packed_scalar"):
                self.assertLessEqual(read[points, part], read[points, "wait_free"], points)

    @unittest.skipUnless((Path(ICBENCH).parent / "targets").is_file(), "no targets beside icbench")
    def test_targets(self):
        self.run_program("targets", "--seconds", 1, "--rows", "packed_memory_100000", "--json", "a.json")
        (row,) = self.load("a.json")
        self.assert_named(paths(row), PROGRAMS)

    @unittest.skipUnless((Path(ICBENCH).parent / "icstress").is_file(), "no icstress beside icbench")
    def test_icstress(self):
        self.run_program("icstress", "--operations", 2000, "--caches", "wait_free", "--json", "a.json")
        self.assert_named(paths(self.load("a.json")), PROGRAMS)


if __name__ == "__main__":
    unittest.main()
