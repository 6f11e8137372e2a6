#!/usr/bin/python3
"""Tests of the report: its pages, and what it finds."""
from __future__ import annotations

import base64
import itertools
import json
import math
import re
import tempfile
import unittest
from pathlib import Path

import matplotlib.image
import numpy as np

from plots_models import (kContext, kFewWorkloads, few_caches, model_anatomy, model_caches, model_preempt,
                          model_repeatability, model_results, model_simulated, model_timeline)
from plots_support import InFolder, References, no_file_above, read_csv, run, write_results

import anatomy_page
import anatomy_results
import breakdown_page
import cautions
import findings
import repeatability_page
import repeatability_results
import results
import timeline_results
from figures import FIGURES


class WholeReport(unittest.TestCase):
    """One report with every figure, drawn once for all of these tests: it takes long."""
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        images = cls.folder / "images"
        images.mkdir()
        matplotlib.image.imsave(images / "room.png", np.zeros((4, 4)))
        (images / "room.json").write_text('{"scene": "cornell_box", "cache": "wait_free", "seconds": 0.25}')
        (images / "broken.png").write_text("no picture")
        rows = model_results(threads=(1, 2, 3, 4, 6, 8, 32), workloads=kFewWorkloads, caches=few_caches(("ward", "packed")))
        path = write_results(cls.folder / "results.json", rows)
        cls.done = run("report.py", path, "--out", cls.folder / "out")

    def setUp(self):
        self.assertEqual((self.done.returncode, self.done.stderr), (0, ""))

    def test_the_page_needs_nothing_but_itself(self):
        page = (self.folder / "out/report.html").read_text(encoding="utf-8")
        references = References(page)
        self.assertTrue(references.found)
        for reference in references.found:
            self.assertTrue(reference.startswith(("data:", "#")), reference[:80])
        self.assertFalse(references.tags & {"iframe", "link", "object", "embed"})
        self.assertIn("default-src 'none'; img-src data:;", page)
        self.assertNotRegex(page, r"@import|url\(\s*['\"]?(?!#)")
        drawings = re.findall(r"data:image/svg\+xml;base64,([A-Za-z0-9+/=]+)", page)
        self.assertGreaterEqual(len(drawings), len(FIGURES))
        for drawing in drawings:
            content = base64.b64decode(drawing).decode()
            self.assertEqual(re.findall(r'(?<!xmlns=")(?<!xmlns:xlink=")https?://[^"]*', content), [])
        self.assertIn("data:image/png;base64,", page)
        self.assertIn("cornell box, cache wait_free, 250 ms", page)
        self.assertIn("broken.png is not a picture", page)

    def test_every_pdf_is_one_column_wide_with_truetype_fonts(self):
        for figure in FIGURES:
            pdf = (self.folder / "out/figures" / f"{figure.name}.pdf").read_bytes()
            self.assertIn(b"/FontFile2", pdf, figure.name)
            self.assertNotIn(b"/Type3", pdf, figure.name)
            for box in re.findall(rb"/MediaBox \[ ?0 0 ([0-9.]+) ([0-9.]+)", pdf):
                self.assertAlmostEqual(float(box[0]), 3.3 * 72, 1)
                self.assertLess(float(box[1]), 9 * 72)


class Report(InFolder):
    def page(self, *paths) -> str:
        self.good("report.py", *paths, "--out", self.folder / "out")
        return (self.folder / "out/report.html").read_text(encoding="utf-8")

    def test_machines_have_parts_of_their_own_and_so_has_what_was_simulated(self):
        imagined = model_simulated((1, 256), 8, measured=(256,), workloads=kFewWorkloads[1:2],
                                   caches=few_caches()[1:3])
        little = {"caches": few_caches()[1:3], "threads": (1, 8), "repetitions": 3}
        page = self.page(self.results("a.json", **little),
                         self.results("b.json", host_name="other", complete=False, **little),
                         write_results(self.folder / "s.json", imagined))
        self.simulated(page)
        for target in re.findall(r'href="#([^"]+)"', page):
            self.assertEqual(page.count(f'id="{target}"'), 1, target)
        self.assertIn("nothing is merged", page)
        self.assertIn('class="banner">Incomplete results (other)', page)
        self.assertIn("<code>figures/other/throughput.pdf</code>", page)
        self.assertIn("One version on each machine: commit 0123456789ab on 2 machines</h3>", page)
        self.assertIn("<code>figures/version-1/machine_throughput.pdf</code>", page)

    def simulated(self, page: str):
        """One machine alone has the part, and no figure of measurements has its rows."""
        self.assertEqual(re.findall(r'<h2 [^>]*id="([^"]*more-cores)"', page), ["model-more-cores"])
        part = page[page.index('id="model-more-cores"'):page.index('id="model-tables"')]
        for words in ("From <code>s.json</code>, up to 256 virtual cores",
                      "<b>validated to 8 threads on this machine</b>",
                      "<code>costs/calibration.json</code> (measured on model, 2025-01-02)",
                      "<code>figures/model/simulated.pdf</code>"):
            self.assertIn(words, part)
        drawings = re.findall(r'<img [^>]*src="([^"]{,30})[^>]*alt="([^"]*)"', part)
        self.assertGreaterEqual(len(drawings), 3)
        for source, title in drawings:
            self.assertTrue(source.startswith("data:image/svg+xml;base64,"), source)
            self.assertIn("simulated, validated to 8 threads on this machine", title)
        lines = re.findall(r"<tr><td>(\w+)</td><td>miss driven, 1 µs a record</td>"
                           r'<td class="n">256</td>(?:<td class="n">[\d.,]+</td>){2}<td class="n">21.0</td></tr>', part)
        self.assertEqual(sorted(lines), ["packed_global_mutex", "packed_shared_mutex"])
        self.assertIn("by 21.0 % in the median of 2 points, and by 21.0 % at most", part)
        for table in (self.folder / "out/figures").rglob("*.csv"):
            counts = {line.get("threads") for line in read_csv(table)}
            self.assertEqual("256" in counts, table.name == "simulated.csv", table)

    def test_where_the_page_has_no_room_the_earlier_one_stays(self):
        earlier = self.page(self.small("a.json"))
        other = self.small("b.json", host_name="another")
        with no_file_above(len(earlier.encode()) - 10_000):
            done = run("report.py", other, "--out", self.folder / "out")
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"^report\.py: [^\n]*File too large: '[^\n]*/out/report\.html'\n$")
        self.assertEqual((self.folder / "out/report.html").read_text(encoding="utf-8"), earlier)
        self.assertEqual(list(self.folder.rglob(".*")), [])

    def test_incomplete_results_stand_out(self):
        self.assertIn('class="banner">Incomplete', self.page(self.small(complete=False)))
        self.assertNotIn('class="banner"', self.page(self.small(complete=True)))

    def test_omitted_figures_are_named_with_the_reason(self):
        page = self.page(self.results(threads=(2,), workloads=("read_only",)))
        for line in ("Speed-up: left out, only one thread count",
                     "Speed against error: left out, no row has both",
                     "where wait-free access pays: left out, no miss_driven rows"):
            self.assertIn(line, page)
        self.assertNotIn('id="speedup"', page)

    def test_the_environment_and_the_command_are_shown(self):
        page = self.page(self.small(odd_key="<i>odd</i>"))
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


class Repeatability(InFolder):
    """What icbench repeatability measured, as a part of the report."""

    def page(self, data: dict) -> str:
        path = write_results(self.folder / "repeatability.json", data)
        return repeatability_page.section(repeatability_results.load([path])[0], "repeatability", "")

    def test_files_beside_the_results_are_found_and_their_part_is_linked(self):
        small = self.small()
        write_results(self.folder / "repeatability.json", model_repeatability())
        write_results(self.folder / "repeatability.previous.json", model_repeatability("desk"))
        self.good("report.py", small, "--out", self.folder / "out")
        page = (self.folder / "out/report.html").read_text(encoding="utf-8")
        self.assertIn('<a href="#repeatability">', page)
        self.assertIn("<code>figures/repeatability.pdf</code>", page)
        self.assertNotIn("Desk, irradiance cache", page)
        for target in re.findall(r'href="#([^"]+)"', page):
            self.assertEqual(page.count(f'id="{target}"'), 1, target)

    def test_a_file_without_shares_has_a_page(self):
        data = model_repeatability()
        for row in data["benchmarks"]:
            for name in [name for name in row if "_share_of_" in name]:
                if name.endswith("error"):
                    del row[name]
        self.assertIn("of its mean.", self.page(data))
        for row in data["benchmarks"]:
            for name in [name for name in row if "_share_of_" in name]:
                del row[name]
        self.assertIn("global mutex", self.page(data))

    def test_the_page_says_how_far_and_beside_what(self):
        page = self.page(model_repeatability())
        self.assertIn("Cornell box, irradiance cache: with 8 threads a picture differs from that of one thread by "
                      "0.440 to 0.880 % (global mutex) of its mean, by at most 22.0 % (global mutex) of its own error.",
                      page)
        self.assertIn("serves one thread", page)
        self.assertIn("0.0200 W/(m² sr) or 4.00 % of it", page)
        self.assertIn("the reference&#x27;s own, already taken off, is 0.00200", page)

    def test_each_largest_share_is_that_of_its_own_cache(self):
        data = model_repeatability()
        for row in data["benchmarks"]:
            if row["cache"] == "wait_free" and row["threads"] == 8:
                row["rms_to_single_share_of_error"] = 0.9
        self.assertIn("to 0.880 % (global mutex) of its mean, by at most 90.0 % (wait free) of its own error",
                      self.page(data))

    def test_a_reference_that_errs_more_than_the_pictures_is_told(self):
        data = model_repeatability()
        self.assertNotIn("are rough", self.page(data))
        for row in data["benchmarks"]:
            row["reference_rmse"] = 0.03
        self.assertIn("which is more, so that shares of the error are rough", self.page(data))

    def test_where_threads_change_nothing_the_page_says_so(self):
        self.assertIn("with 8 threads no picture differs", self.page(model_repeatability(differences={"null": 0.0})))

    def test_one_thread_alone_says_so(self):
        page = self.page(model_repeatability(differences={"sequential": None}))
        self.assertIn("measured with one thread only", page)

    def test_an_incomplete_run_stands_out(self):
        self.assertIn("Incomplete: this part", self.page(model_repeatability(complete=False)))

    def test_every_wrong_file_is_one_line_and_status_2(self):
        no_mean = model_repeatability()
        for row in no_mean["benchmarks"]:
            del row["mean"]
        for text in ("no json", "[]", '{"context": {}, "benchmarks": []}', json.dumps(no_mean)):
            (self.folder / "wrong.json").write_text(text)
            with self.assertRaisesRegex(results.InputError, r"^[^\n]+wrong\.json[^\n]+$"):
                repeatability_results.load([self.folder / "wrong.json"])


class Stopped(InFolder):
    """What happens to others when a thread is held, timelines, and where time goes, as parts of the report."""

    def test_files_beside_the_results_are_taken_up(self):
        path = self.small()
        write_results(self.folder / "preempt.json", model_preempt())
        write_results(self.folder / "timeline.json", model_timeline())
        self.results("breakdown.json", workloads=("miss_driven:cost=4",), threads=(1, 2), repetitions=1)
        self.good("report.py", path)
        page = (self.folder / "report.html").read_text()
        for figure in ("preemption", "timeline", "time_breakdown"):
            self.assertTrue((self.folder / "figures" / f"{figure}.csv").exists(), figure)
        workloads = {line["workload"] for line in read_csv(self.folder / "figures/breakdown/time_breakdown.csv")}
        self.assertEqual(workloads, {"miss_driven:cost=4"})
        self.assertRegex(page, r'<a href="#(breakdown-[^"]+)">Where the time goes</a>(?s:.*)<h2 id="\1">Where the time goes')
        self.assertIn(">When a thread is held</h2>", page)
        self.assertIn(">Timeline: a/b/threads:2</h2>", page)
        # The mutex: half of the others' time, and a longest query of 11 ms; nobody else waits.
        self.assertRegex(page, r'<td>packed_global_mutex</td><td class="n">50[^<]*<small>')
        self.assertRegex(page, r'<td>packed_wait_free</td><td class="n">0 ')

    def test_what_cannot_be_read_beside_the_results_is_left_out_and_named(self):
        path = self.small()
        for name in ("repeatability", "anatomy", "preempt", "breakdown", "pareto"):
            write_results(self.folder / f"{name}.json", {"context": {}, "benchmarks": []})
        (self.folder / "timeline.json").write_text("{")
        (self.folder / "correctness.json").write_text("{")
        write_results(self.folder / "preempt_2.json", model_preempt())
        done = run("report.py", path)
        self.assertEqual(done.returncode, 0, done.stderr)
        page = (self.folder / "report.html").read_text()
        for name in ("repeatability", "anatomy", "preempt", "breakdown", "pareto", "timeline", "correctness"):
            self.assertRegex(page, rf"Left out: [^<]+/{name}\.json: ")
            self.assertRegex(done.stderr, rf"report\.py: left out: \S+/{name}\.json: ")
        self.assertIn(">When a thread is held</h2>", page)
        named = run("report.py", path, "--preemption", self.folder / "preempt.json")
        self.assertEqual(named.returncode, 2)

    def test_workloads_that_differ_in_a_parameter_have_a_picture_each(self):
        data = model_preempt()
        hot = "mix_90_10:order=hot_spot"
        data["benchmarks"] += [row | {"workload": hot, "name": row["name"].replace("mix_90_10", hot)}
                               for row in data["benchmarks"]]
        done = self.good("preemption.py", write_results(self.folder / "preempt.json", data))
        self.assertEqual(sorted(Path(line).name for line in done.stdout.splitlines() if line.endswith(".svg")),
                         ["preemption-mix-90-10-4-10ms.svg", "preemption-mix-90-10-order-hot-spot-4-10ms.svg"])

    def test_timelines_of_one_name_are_kept_apart(self):
        paths = [self.folder / part / "timeline.json" for part in "ab"]
        for path, threads in zip(paths, (2, 3)):
            path.parent.mkdir()
            write_results(path, model_timeline(threads))
        found = timeline_results.load([*paths, paths[0]])
        self.assertEqual([one.slug for one in found], ["timeline-timeline", "timeline-timeline-2"])
        self.assertEqual([one.path for one in found], paths)

    def breakdown(self, counted: dict, **said) -> str:
        """The part of the page; `counted` by one operation."""
        data = model_results(caches=few_caches()[1:], workloads=kFewWorkloads[1:2], threads=(1, 8, 32), repetitions=3,
                             errors=False, **said)
        for row in data["benchmarks"]:
            row |= {name: each * (1 + row["repetition_index"]) * (row["queries"] + row["inserts"])
                    for name, each in counted.items()}
        setup, = results.load([write_results(self.folder / "breakdown.json", data)])
        return breakdown_page.section(setup, "a", "", False)

    def test_what_the_hardware_counted_stands_beside_the_breakdown(self):
        page = self.breakdown({"cycles": 1500, "line_transfers": 0.5},
                              hardware_counters={"events": ["cycles"], "note": "l1d_misses: not offered"})
        for threads in (1, 8):
            self.assertIn(f'<td>packed_wait_free</td><td class="n">{threads}</td><td class="n">3,000 <small>[1,500, '
                          '4,500]</small></td><td class="n">1.00 <small>[0.500, 1.50]</small></td>', page)
        self.assertNotIn('<td class="n">32</td>', page)
        self.assertEqual(page.count('<th class="n">'), 3)
        self.assertEqual(page.count("L1d_misses: not offered."), 1)

    def test_where_the_hardware_counted_nothing_the_page_says_why(self):
        page = self.breakdown({}, hardware_counters={"events": [], "note": "no hardware counters: no permission"})
        self.assertNotIn("<table", page)
        self.assertEqual(page.count("No hardware counters: no permission."), 1)
        self.assertNotIn("counter", self.breakdown({}))


class Anatomy(InFolder):
    """What anatomy measured, as a part of the report."""

    def test_a_file_without_records_that_were_read_has_a_page(self):
        for absent in "records_read", "records_valid", "cache_lines":
            data = model_anatomy()
            data["benchmarks"] = [{k: v for k, v in row.items() if k != absent} for row in data["benchmarks"]]
            page = self.page(data)
            self.assertIn("times as fast as one to Ward", page)
            self.assertNotIn("whole records instead of", page)

    def page(self, data: dict) -> str:
        path = write_results(self.folder / "anatomy.json", data)
        return anatomy_page.section(anatomy_results.load([path])[0], "anatomy", "")

    def test_a_file_beside_the_results_is_found_and_its_part_is_linked(self):
        small = self.small()
        write_results(self.folder / "anatomy.json", model_anatomy())
        self.good("report.py", small, "--out", self.folder / "out")
        page = (self.folder / "out/report.html").read_text(encoding="utf-8")
        self.assertIn('<a href="#anatomy">Why the winner wins</a>', page)
        for figure in ("anatomy_time", "anatomy_map", "anatomy_roofline"):
            self.assertIn(f"<code>figures/{figure}.pdf</code>", page)

    def test_the_page_says_what_each_step_is_worth_and_what_bounds_it(self):
        page = self.page(model_anatomy())
        self.assertIn("At random points a packed query is 5.00 times as fast as one to Ward&#x27;s structure. It reads "
                      "20.0 cache lines instead of 90.0, and 8.00 whole records instead of 60.0, of which 6.00 are "
                      "valid. Step by step: one path instead of many 2.50, small copies instead of whole records 1.14, "
                      "vectors 1.75 times.", page)
        self.assertIn("is another 5.00 times as fast", page)

    def test_the_page_says_how_long_memory_takes_where_that_was_measured(self):
        self.assertRegex(self.page(model_anatomy()), r"takes 10\.0 .*ns on this machine from a block of 1\.00 MiB and "
                                                     r"160 .*ns from one of 64\.0 MiB")
        without = model_anatomy()
        without["benchmarks"] = [row for row in without["benchmarks"] if "block_bytes" not in row]
        self.assertNotIn("from a block of", self.page(without))

    def test_the_page_says_what_stands_against_what_is_asked(self):
        # Medians are 1.02 times the model's figures. Asked: 2040 / 12 ns, in which 8 instructions a nanosecond are 1,360;
        # 816 / 3, in which they are 2,176; and 1.25 * 387.6, which 408 ns are within.
        page = self.page(model_anatomy())
        for what, cells in (("12.0 times as fast as Ward&#x27;s structure", ["170", "408", "1,360", "1,000", "250"]),
                            ("3.00 times as fast as one path", ["272", "408", "2,176", "1,000", "250"]),
                            ("at most 1.25 times as long as frozen", ["484", "408", "3,876", "1,000", "250"])):
            line = re.search(rf"<tr><td>{re.escape(what)}<span class=\"under\">random points</span></td>(.*?)</tr>", page)
            self.assertIsNotNone(line, what)
            self.assertEqual(re.findall(r'<td class="n">(.*?)</td>', line[1]), cells)
        self.assertIn("waiting: it executes 2.45 of 8.00 instructions a nanosecond", page)
        self.assertIn("nothing: it is reached", page)
        self.assertIn("counted by valgrind-3.19.0, lines with a last level of 4.00 MiB", page)
        # At 1.6 lines from memory a query not always waits twice; at 8 it does, for 2 * 160 ns of 267.
        self.assertNotIn("to wait twice", page)
        data = model_anatomy()
        for row in data["benchmarks"]:
            if "lines_from_memory" in row:
                row["lines_from_memory"] *= 10.0
        self.assertIn("for its cells and then for the records that they name, takes 320 ns, unless queries overlap", self.page(data))
        # Where instructions have no room, and where those who know the records beforehand take as long.
        for part, change, why in (("packed_wait_free", {"instructions": 1400.0}, "its instructions alone"),
                                  ("told", {"ns_per_query": 200.0}, "a query that is told the valid records takes longer")):
            data = model_anatomy()
            for row in data["benchmarks"]:
                if row.get("part") == part:
                    row |= {name: value for name, value in change.items() if name in row}
            self.assertIn(why, self.page(data))
            self.assertNotIn(why, page)

    def test_where_nothing_was_counted_the_page_says_nothing_of_instructions(self):
        data = model_anatomy()
        for row in data["benchmarks"]:
            row.pop("instructions", None)
        self.assertNotIn("there is room for", self.page(data))
        path = write_results(self.folder / "anatomy.json", data)
        self.assertIn("bench/instructions counts them", self.good("anatomy_roofline.py", path, "--out", self.folder).stdout)

    def test_the_page_names_the_scene(self):
        self.assertIn("100,000 records in cornell_box, one thread", self.page(model_anatomy()))
        other = model_anatomy(configuration={"command": "anatomy", "scene": "office"})
        self.assertIn("100,000 records in office, one thread", self.page(other))

    def test_the_map_leaves_nothing_out_of_its_table(self):
        path = write_results(self.folder / "anatomy.json", model_anatomy())
        self.good("anatomy_map.py", path, "--out", self.folder)
        table = read_csv(self.folder / "anatomy_map.csv")
        self.assertEqual([(sum(line["part"] == part for line in table)) for part in ("wait_free", "packed_wait_free")],
                         [60, 8])
        self.assertEqual(sum(line["valid"] == "True" for line in table), 12)

    def test_wrong_files_are_refused(self):
        data = model_anatomy()
        for row in data["benchmarks"]:
            row.pop("ns_per_query", None)
        path = write_results(self.folder / "wrong.json", data)
        with self.assertRaisesRegex(results.InputError, 'no "ns_per_query"'):
            anatomy_results.load([path])


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

    def test_the_busiest_of_pooled_runs_is_warned_of(self):
        setup, = results.load([self.results("a.json"), self.results("b.json", seed=2, load_avg=[37.0, 1.0, 1.0])])
        self.assertIn("(load 37)", " ".join(w.text for w in cautions.cautions(setup)))
        setup, = results.load([self.results("c.json", load_avg=[0.1], resumed=[{"load_avg": [30.0, 2.0]}, "odd", {}])])
        self.assertIn("(load 30)", " ".join(w.text for w in cautions.cautions(setup)))

    def test_a_tie_is_undecided(self):
        caches = few_caches()
        data = model_results(caches=caches, workloads=kFewWorkloads[:1], threads=(8,), errors=False)
        for i, row in enumerate(data["benchmarks"]):
            row["items_per_second"] = 1e6 * (1 + 0.1 * math.sin(i))
        setup = results.load([write_results(self.folder / "results.json", data)])[0]
        self.assertIn("Undecided", findings.of_throughput(setup, "packed", 8).text)

    def test_one_workload_has_no_mean(self):
        data = model_results(caches=few_caches(), workloads=kFewWorkloads[:1], threads=(8,), errors=False)
        setup = results.load([write_results(self.folder / "results.json", data)])[0]
        for finding in findings.of_throughput(setup, "packed", 8), findings.of_latency(setup, "packed", 8):
            self.assertNotIn("geometric mean", finding.text)

    def test_what_strictness_costs_is_the_ratio_of_the_two(self):
        caches = model_caches(("ward",), ("global_mutex", "wait_free", "wait_free_snapshot"), ())
        data = model_results(caches=caches, workloads=kFewWorkloads, threads=(8,), errors=False)
        for row in data["benchmarks"]:
            rate = {"global_mutex": 1e6, "wait_free": 4e6, "wait_free_snapshot": 3e6}[row["cache"]]
            row |= {"items_per_second": rate, "real_time": row["queries"] / rate * 1e3}
        # Of what the strict one did not run, the base tells nothing.
        slow = [row | {"workload": "alone", "name": row["name"].replace(row["workload"], "alone"), "queries": 100,
                       "items_per_second": 100 / row["real_time"] * 1e3} for row in data["benchmarks"]
                if row["cache"] == "wait_free" and row["workload"] == kFewWorkloads[0]]
        data["benchmarks"] += slow
        setup = results.load([write_results(self.folder / "results.json", data)])[0]
        found = findings.of_strictness(setup, 8)
        self.assertEqual(found.value, "0.750× [0.750, 0.750]")
        self.assertIn("of wait_free_snapshot, whose queries are atomic snapshots, over that of wait_free",
                      found.text)
        self.assertNotIn("Undecided", found.text)
        self.assertEqual(found.base, "Base: wait_free, 4.00 M operations/s")
        self.assertIn(found, findings.findings(setup))
        self.assertIsNone(findings.of_strictness(self.setup_of(), 8))  # only one of the two was measured

    def of_error(self, **pixels: int) -> findings.Finding:
        """Of path tracing whose relMSE is 1 / seconds, and a cache, of pictures of a size, and of one an eighth as wide
        that takes a 64th of the time."""
        rows = []
        for repetition, small in itertools.product(range(3), (False, True) if pixels else (False,)):
            size = {key: value // 8 if small else value for key, value in pixels.items()}
            name, share = f"box{':small' if small else ''}", 1 / 64 if small else 1.0
            shared = size | {"threads": 1, "scene": "box", "workload_kind": "ray_traced", "time_unit": "s",
                             "repetition_index": repetition, "real_time": 1.0}
            for spp in (1, 100):
                rows.append(shared | {"name": f"pareto/{name}:path:{spp}/none/threads:1", "cache": "none", "spp": spp,
                                      "workload": f"{name}:path:spp={spp}", "integrator": "path",
                                      "structure": "none", "mechanism": "none", "seconds_indirect": share * spp,
                                      "relmse": 1.0 / spp})
            rows.append(shared | {"name": f"pareto/{name}/wait_free/threads:1", "cache": "wait_free",
                                  "structure": "ward", "workload": f"{name}:rays=8", "mechanism": "wait_free",
                                  "integrator": "irradiance_cache", "seconds_indirect": 10.0 * share, "relmse": 0.02})
        path = write_results(self.folder / "results.json", {"context": kContext, "benchmarks": rows})
        return findings.of_error(results.load([path])[0], "ward", 1)

    def test_error_at_equal_time_is_the_ratio_at_the_caches_time(self):
        self.assertEqual(self.of_error().value, "5.00× [5.00, 5.00]")

    def test_pictures_of_another_size_are_no_rivals(self):
        found = self.of_error(width=64, height=48)
        self.assertEqual(found.value, "5.00× [5.00, 5.00]")
        self.assertIn("box, 64 × 48", found.text)


if __name__ == "__main__":
    unittest.main()
