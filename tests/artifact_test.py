"""The claims of README.md and bench/MEASURED.md: one place, nothing that drifts apart, judged and released by bench/."""

import fcntl
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from unittest import mock

kRoot = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(kRoot / "bench"))
import artifact  # noqa: E402
import claims  # noqa: E402
import pages  # noqa: E402

PATIENCE = 120  # seconds
kPrograms = Path(os.environ.get("ICBENCH", kRoot / "build/release/bin/icbench")).parent
kPages = ("README.md", "bench/MEASURED.md", "bench/TRIED.md")
kMend = "bring bench/claims.json up to date, then the pages' tables by bench/artifact --write"


def text_of(name):
    """A page's words, whatever its lines."""
    return " ".join((kRoot / name).read_text(encoding="utf-8").split())


def texts_of(claim):
    """What the pages say of a row's figures."""
    told = [claim, *claim.get("elsewhere", {}).values()]
    return [*(one.get("readme", one["claimed"]) for one in told), *(one["also"] for one in told if "also" in one)]


class Claims(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.rows = claims.known_rows(kPrograms / "targets")
        cls.machines, sections = claims.load_claims()
        cls.all = [claim for _, section in sections for claim in section]

    def test_each_names_a_row_or_a_program_once(self):
        names = [claims.name_of(claim) for claim in self.all]
        self.assertEqual(len(set(names)), len(names))
        for claim in self.all:
            if "row" in claim:
                self.assertIn(claim["row"], self.rows, kMend)
                continue
            for command in claim["command"].split(" && "):
                program = command.split()[0]
                path = kPrograms / Path(program).name if program.startswith("build/release/bin/") else kRoot / program
                self.assertTrue(path.exists() or shutil.which(program), program)

    def test_pages_have_their_figures_and_no_others(self):
        told = [text for claim in self.all if "row" in claim for text in texts_of(claim)]
        pages = " ".join(map(text_of, kPages))
        for text in told:
            self.assertIn(text, pages, kMend)
        # In tables: what the words between them say of single runs is no claim.
        for page in kPages:
            tables = " ".join(line for line in (kRoot / page).read_text(encoding="utf-8").splitlines()
                              if line.startswith("|"))
            for figure in re.findall(kInterval, tables):
                self.assertIn(figure, told, f"{page}'s {figure} is in no claim; {kMend}")

    def test_verdicts_follow_from_figures_and_targets(self):
        told = [(claim["row"], figures) for claim in self.all if "row" in claim
                for figures in claims.figures_of(claim, self.machines).values()]
        for row, figures in told:
            low, high = claims.interval_of(figures["claimed"])
            target, _ = self.rows[row]
            value = float(target.split()[-1])
            # A bound of the interval that was rounded onto the target may lie on either side.
            sides = {"pass": high <= value, "fail": low > value, "undecided": low <= value <= high}
            if target.startswith("at least"):
                sides = {"pass": low >= value, "fail": high < value, "undecided": low <= value <= high}
            near = min(abs(low - value), abs(high - value)) <= 0.5 * 10.0 ** -decimals(figures["claimed"])
            self.assertTrue(sides[figures["verdict"]] or near, f"{row}: {figures['claimed']}, {target}; {kMend}")

    def test_machines_are_known_by_their_processors(self):
        with tempfile.TemporaryDirectory(prefix="icbench-artifact-") as folder:
            cpuinfo = Path(folder) / "cpuinfo"
            for name, machine in self.machines.items():
                fields = {"processor": "0", **machine["cpu"], "flags": "fpu vme"}
                one = "".join(f"{key}\t: {value}\n" for key, value in fields.items())
                cpuinfo.write_text(f"{one}\n{one.replace('processor', 'nothing')}")
                self.assertEqual(claims.this_machine(self.machines, str(cpuinfo)), name)
            cpuinfo.write_text("processor\t: 0\nvendor_id\t: another\n")
            usual = next(iter(self.machines))
            self.assertEqual(claims.this_machine(self.machines, str(cpuinfo)), usual)
            self.assertEqual(claims.this_machine(self.machines, str(Path(folder) / "none")), usual)
        for claim in self.all:
            self.assertLessEqual({claim.get("machine", usual), *claim.get("elsewhere", {})}, set(self.machines))

    def test_pages_have_the_tables_that_are_made_of_them(self):
        for page, made in ((pages.kArtifact, pages.artifact), (pages.kMeasured, pages.measured)):
            text = page.read_text(encoding="utf-8")
            self.assertEqual(text, made(text, self.rows), kMend)
        for name in pages.kTables:
            self.assertIn(f"<!-- table {name} -->\n", pages.kMeasured.read_text(encoding="utf-8"))
        for machine in self.machines.values():
            self.assertIn(machine["hardware"], text_of("ARTIFACT.md"), kMend)

    def test_tables_are_made_in_place(self):
        page = "Before.\n\n<!-- table temporal -->\n\n| an | old |\n|---|---|\n| one | 1 |\n\nAfter.\n"
        made = pages.measured(page, self.rows)
        self.assertRegex(made, r"\ABefore\.\n\n<!-- table temporal -->\n\n(\|[^\n]+\|\n){17}\nAfter\.\n\Z")
        self.assertEqual(pages.measured(made, self.rows), made)
        with self.assertRaisesRegex(claims.Refused, "no table 'nosuch'"):
            pages.measured("<!-- table nosuch -->\n\n", self.rows)

    def test_a_figure_tells_where_it_is_of_something_else(self):
        told = pages.Claims(self.rows)
        told.by_row["tic_visible_office"] = {"row": "tic_visible_office", "claimed": "0.500 [0.400, 0.600]",
                                             "verdict": "fail", "machine": "Genoa", "note": "8 VPLs"}
        columns = [("visible", "tic_visible", "Xeon"), ("more", "igi_over_tic", "Xeon")]
        office = pages.by_scene(columns)(told)[-1]
        self.assertEqual(office, "| Office | 0.500 [0.400, 0.600] (8 VPLs) ᴳ, **fail** | no row |")
        del told.by_row["tic_visible_office"]
        self.assertIn("| not measured |", pages.by_scene(columns)(told)[-1])

    def test_the_quick_path_has_every_row_of_readme(self):
        page = text_of("README.md")
        self.assertLessEqual({claims.name_of(claim) for claim in self.all if "outside" in claim},
                             {claims.name_of(claim) for claim in self.all if not claim.get("quick")})
        for figure in {*re.findall(kInterval, page), *(c["readme"] for c in self.all if "readme" in c)}:
            mine = [claim for claim in self.all if "row" in claim and figure in texts_of(claim)]
            self.assertTrue(any(claim.get("quick") or claim.get("outside") for claim in mine),
                            f"README.md's {figure} is neither quick nor outside with a reason; {kMend}")
        for claim in self.all:
            if "row" in claim and claim.get("quick"):
                self.assertTrue(any(text in page for text in texts_of(claim)), f"{claim['row']} is not in README.md")
            if "row" not in claim:
                self.assertTrue(claim.get("quick") or claim.get("outside"), f"{claim['check']}: outside, without a reason")

    def test_the_quick_path_takes_at_most_half_an_hour(self):
        self.assertLessEqual(sum(claim.get("seconds", 0) for claim in self.all if claim.get("quick")), 1800)


kInterval = rf"{claims.kNumber} \[{claims.kNumber}, {claims.kNumber}\]"


def decimals(text):
    return len(re.search(claims.kNumber, text)[0].partition(".")[2])


# Stands in for bench/targets: answers as $ANSWERS says, a JSON object by row, and counts its calls in a file.
kTargets = """#!{python}
import json, os, sys
if sys.argv[1:] == ["--list"]:
    os.execv({targets!r}, ["targets", "--list"])
names, path = (sys.argv[sys.argv.index(option) + 1] for option in ("--rows", "--json"))
open({calls!r}, "a").write(names + "\\n")
answers = json.loads(os.environ["ANSWERS"])
rows = [{{"name": name, "samples": 11, "why": "", **answers[name]}} for name in names.split(",") if name in answers]
if not rows:
    print("targets: no such luck", file=sys.stderr)
    sys.exit(2)
json.dump(rows, open(path, "w"))
"""


class Judging(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="icbench-artifact-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.calls = self.folder / "calls"
        (self.folder / "bin").mkdir()
        for name in ("icbench", "icstress", "targets"):
            program = self.folder / "bin" / name
            program.write_text(kTargets.format(python=sys.executable, targets=str(kPrograms / "targets"),
                                               calls=str(self.calls)))
            program.chmod(0o755)

    def artifact(self, *arguments, **answers):
        return subprocess.run([kRoot / "bench/artifact", "--programs", self.folder / "bin", "--out",
                               self.folder / "out", *arguments], text=True, capture_output=True, timeout=PATIENCE,
                              env={**os.environ, "ANSWERS": json.dumps(answers)})

    def judged(self, row, verdict, low, high, machine="EPYC"):
        """The word on a claim that is measured as that interval, and the exit status."""
        done = self.artifact("--only", row, "--machine", machine,
                             **{row: {"median": (low + high) / 2, "low": low, "high": high, "verdict": verdict}})
        shutil.rmtree(self.folder / "out")
        line, = [line for line in done.stdout.splitlines() if line.startswith(row + " ")]
        return re.split("  +", line)[-1], done.returncode

    def test_what_is_measured_is_held_to_what_is_claimed(self):
        # Claimed: 2.234 [2.171, 2.278], at least 1.6.
        row = "wait_free_over_global_mutex"
        self.assertEqual(self.judged(row, "pass", 2.27, 2.4), ("in", 0))
        self.assertEqual(self.judged(row, "pass", 2.3, 2.4), ("out", 0))
        self.assertEqual(self.judged(row, "undecided", 1.5, 1.7), ("out", 0))
        self.assertEqual(self.judged(row, "fail", 1.2, 1.4), ("out, but pass became fail", 1))
        # A miss that is none here is no reproduction either.
        self.assertEqual(self.judged("packed_query_speed", "pass", 13.0, 14.0), ("out, but fail became pass", 1))
        # Elsewhere other figures are claimed, or those of the usual machine: 1.56 [1.44, 1.69], and checker_speed.
        image = "packed_live_over_frozen_coherent"
        self.assertEqual(self.judged(image, "fail", 1.5, 1.6), ("out, but pass became fail", 1))
        self.assertEqual(self.judged(image, "fail", 1.5, 1.6, "Genoa"), ("in", 0))
        self.assertEqual(self.judged("checker_speed", "pass", 12.5, 12.6, "Xeon"), ("in (EPYC)", 0))

    def test_an_interrupted_run_goes_on(self):
        one, two = "wait_free_over_global_mutex", "checker_speed"
        answer = {"median": 2.2, "low": 2.1, "high": 2.3, "verdict": "pass"}
        done = self.artifact("--only", f"{one},{two}", **{one: answer})
        self.assertEqual((done.returncode, done.stderr), (2, f"bench/artifact: {two}: targets: no such luck\n"))
        done = self.artifact("--only", f"{one},{two}", **{two: answer})
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("2 claims", done.stdout)
        self.assertEqual(self.calls.read_text().split(), [one, two, two])

    def test_figures_of_another_machine_are_none_of_this_one(self):
        with mock.patch.object(artifact, "identity_of_machine", return_value="another"):
            other = artifact.Judge(self.folder, self.folder / "bin").built
        self.assertNotEqual(artifact.Judge(self.folder, self.folder / "bin").built, other)

    def test_a_row_that_cannot_be_measured_costs_no_other(self):
        lacking, row = "checker_speed", "wait_free_over_global_mutex"
        answer = {"median": 2.2, "low": 2.1, "high": 2.3, "verdict": "pass"}
        done = self.artifact("--only", f"{lacking},{row}", "--machine", "EPYC", **{row: answer})
        self.assertEqual((done.returncode, done.stderr), (2, f"bench/artifact: {lacking}: targets: no such luck\n"))
        self.assertIn("2.200 [2.100, 2.300]", done.stdout)
        self.assertIn(": 1 not measured, 1 in; contradicted: none", done.stdout)
        # That another is contradicted is what the status tells.
        done = self.artifact("--only", f"{lacking},{row}", "--machine", "EPYC", "--out", self.folder / "other",
                             **{row: {**answer, "verdict": "fail"}})
        self.assertEqual(done.returncode, 1, done.stderr)
        # Where nothing can be kept, none is measured in vain.
        (self.folder / "full/artifact.new").mkdir(parents=True)
        done = self.artifact("--only", f"{lacking},{row}", "--out", self.folder / "full", **{row: answer})
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"\Abench/artifact: [^\n]+artifact.new: Is a directory[^\n]+\n\Z")
        self.assertEqual(self.calls.read_text().split(), [lacking, row, lacking, row, lacking])

    def test_a_row_that_broke_its_contract_has_no_figure(self):
        row = "checker_speed"
        broken = {"median": None, "low": None, "high": None, "samples": 3, "verdict": "fail", "why": "lost records"}
        done = self.artifact("--only", row, "--machine", "EPYC", **{row: broken})
        self.assertEqual((done.returncode, done.stderr), (1, ""))
        self.assertRegex(done.stdout, rf"\n{row} .* out, but pass became fail: lost records\n")

    def test_rows_that_share_samples_are_measured_once(self):
        rows = [f"simulator_error_{what}" for what in ("throughput", "records", "waiting")]
        answer = {"median": 0.06, "low": 0.05, "high": 0.07, "verdict": "pass"}
        done = self.artifact("--only", ",".join(rows), "--machine", "Xeon", **{row: answer for row in rows})
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.calls.read_text().split(), [",".join(rows)])
        self.assertEqual(done.stdout.count("0.060 [0.050, 0.070]"), 3)

    def test_rows_whose_samples_take_long_are_measured_by_fewer(self):
        claim = {"row": "checker_speed", "samples": 7, "seconds": 300}
        self.assertEqual(claims.command_of(claim, "out"),
                         "build/release/bin/targets --seconds 10 --samples 7 --rows checker_speed")
        self.assertEqual(pages.time_of(claim), "5 min (`--samples 7`)")
        # The stand-in answers with what it was asked.
        (self.folder / "bin/targets").write_text(
            "#!/bin/sh\nwhile [ $# -gt 0 ]; do case $1 in --json) json=$2;; --samples) n=$2;; esac; shift; done\n"
            'echo "[{\\"name\\": \\"checker_speed\\", \\"median\\": 1, \\"low\\": 1, \\"high\\": 1, '
            '\\"samples\\": $n, \\"verdict\\": \\"pass\\", \\"why\\": \\"\\"}]" >"$json"\n')
        self.assertEqual(artifact.Judge(self.folder, self.folder / "bin").measured(claim)["samples"], 7)

    def test_what_the_machine_did_not_yield_is_measured_again(self):
        row = "wait_free_read_only_scaling"
        nothing = {"median": None, "low": None, "high": None, "verdict": "skipped", "why": "not idle"}
        done = self.artifact("--only", row, **{row: nothing})
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("skipped: not idle", done.stdout)
        done = self.artifact("--only", row, **{row: {"median": 0.99, "low": 0.98, "high": 1.0, "verdict": "pass"}})
        self.assertIn("1 in;", done.stdout)

    def test_checks_hold_or_do_not(self):
        # The stand-in fails whatever it is asked.
        claim = {"check": "c", "claim": "", "command": "printf '1 of 1\\n'", "says": "1 of 1"}
        judge = artifact.Judge(self.folder, self.folder / "bin")
        self.assertEqual(judge.measured(claim)["verdict"], "holds")
        for change in {"says": "2 of 2"}, {"command": "printf '1 of 1\\n'; false"}:
            self.assertEqual(judge.measured({**claim, **change, "check": "d"})["verdict"], "does not hold")
        lacking = judge.measured({**claim, "check": "e", "needs": "no-such-program"})
        self.assertEqual(artifact.judge(claim, {}, lacking), ("skipped: no no-such-program here; install it", False))

    def test_a_held_thread_is_judged_by_what_the_program_prints(self):
        says, = [claim["says"] for _, section in claims.load_claims()[1] for claim in section
                 if claims.name_of(claim) == "held_thread"]
        def printed(mutex, free):
            return "".join(f"     0.5855 us   85.99 us 1.041e+04 us {share:>7} %     36  "
                           f"preempt/mix_90_10:operations=1000000/{cache}/threads:2/held\n"
                           for cache, share in (("packed_global_mutex", mutex), ("packed_wait_free", free)))
        for mutex, free, holds in (("23.3", "0.0", True), ("5.1", "0.9", True), ("4.9", "0.0", False),
                                   ("0.0", "0.0", False), ("23.3", "1.2", False), ("23.3", "10.0", False)):
            self.assertEqual(re.search(says, printed(mutex, free)) is not None, holds, (mutex, free))

    def test_the_quick_path_ends_in_time(self):
        claim = {"row": "checker_speed"}
        judge = artifact.Judge(self.folder, self.folder / "bin")
        with self.assertRaises(artifact.TimeUp):
            judge.measured(claim, deadline=0.0)
        # One that is under way ends, too.
        (self.folder / "bin/targets").write_text("#!/bin/sh\nexec tail -f /dev/null\n")
        with self.assertRaises(artifact.TimeUp):
            judge.measured(claim, deadline=time.monotonic() + 0.1)

    def test_bad_input_is_one_line(self):
        for arguments, says in ((["--only", "nosuch"], "no claim 'nosuch'"), (["--fast"], "--fast"),
                                (["--machine", "Z80"], "there are EPYC, Xeon"),
                                (["--programs", "/nosuch"], "/nosuch/targets"), (["--out", "/dev/null/x"], "--out")):
            done = self.artifact(*arguments)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertRegex(done.stderr, r"\Abench/artifact: [^\n]+\n\Z")
            self.assertIn(says, done.stderr)

    def test_what_cannot_be_read_or_written_is_one_line_and_contradicts_nothing(self):
        row, out = "checker_speed", self.folder / "out"
        answer = {"median": 12.5, "low": 12.5, "high": 12.6, "verdict": "pass"}
        for name, text, says in (("artifact.json", "[]", "no measured claims"),
                                 ("artifact.json", f'{{"{row}": {{}}}}', "no measured claims"),
                                 ("artifact.new/x", "", "artifact.new: Is a directory; mend it")):
            (out / name).parent.mkdir(parents=True)
            (out / name).write_text(text)
            done = self.artifact("--only", row, **{row: answer})
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertRegex(done.stderr, r"\Abench/artifact: [^\n]+\n\Z")
            self.assertIn(says, done.stderr)
            shutil.rmtree(out)

    def test_one_run_at_a_time_measures_into_a_folder(self):
        out = self.folder / "out"
        out.mkdir()
        with open(out / ".lock", "w", encoding="utf-8") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            done = self.artifact("--only", "checker_speed")
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, rf"\Abench/artifact: another run is writing to '{out}'[^\n]*--out\n\Z")
        self.assertFalse(self.calls.exists())


@unittest.skipUnless(shutil.which("git") and (kRoot / ".git").exists(), "not in a clone")
class Release(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="icbench-release-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.clone, self.results = self.folder / "clone", self.folder / "clone/results"
        # A repository of this release script and pages, whatever is not committed here.
        (self.clone / "bench").mkdir(parents=True)
        for name in ("bench/release", "bench/setup", "bench/packages.txt", "bench/MEASURED.md", "README.md", "ARTIFACT.md",
                     ".gitignore"):
            shutil.copy(kRoot / name, self.clone / name)
        self.git("init", "-q")
        self.git("add", "-A")
        self.git("-c", "user.name=t", "-c", "user.email=t@t", "commit", "-q", "-m", "t")
        self.results.mkdir()
        scenes = ("cornell_box", "wobble", "desk", "bunnies_1", "bunnies_2", "bunnies_4", "bunnies_9", "cornell_specular",
                  "cornell_indirect", "conference", "sibenik", "office")
        for name in ("results", *(f"pareto_{scene}" for scene in scenes), "repeatability_irradiance_cache",
                     "repeatability_instant_caching", "preempt", "breakdown", "anatomy", "simulated"):
            self.write(name, complete=True)
        (self.results / "correctness.json").write_text('{"checks": []}')
        self.write_run("default")

    def git(self, *arguments):
        subprocess.run(["git", "-C", self.clone, *arguments], check=True, timeout=PATIENCE)

    def write(self, name, **context):
        context = {"commit": "abc123", "dirty": False, **context}
        (self.results / f"{name}.json").write_text(json.dumps({"context": context, "benchmarks": []}))

    def write_run(self, mode):
        (self.results / "run.json").write_text(json.dumps(
            {"mode": mode, "commit": "abc123", "start": "2026-01-02T03:04:05Z", "end": "2026-01-02T04:14:05Z"}))

    def release(self):
        return subprocess.run([self.clone / "bench/release", self.folder / "out"], text=True, capture_output=True,
                              timeout=PATIENCE)

    def test_a_release_is_whole_and_checked(self):
        done = self.release()
        self.assertEqual(done.returncode, 0, done.stderr)
        out = self.folder / "out"
        self.assertEqual(done.stdout, f"{out.resolve()}\n")
        listed = {line.split()[1] for line in (out / "SHA256SUMS").read_text().splitlines()}
        there = {f"./{path.relative_to(out)}" for path in out.rglob("*") if path.is_file()}
        self.assertEqual(listed, there - {"./SHA256SUMS"})
        for name in ("source.tar.gz", "environment.txt", "ARTIFACT.md", "bench/MEASURED.md", "results/pareto_sibenik.json",
                     "results/run.json"):
            self.assertIn(f"./{name}", listed)
        commits, page = (out / "commit.txt").read_text(), (out / "README.md").read_text()
        self.assertIn("abc123 pareto_sibenik.json", commits)
        self.assertIn("run default, abc123, from 2026-01-02T03:04:05Z", commits)
        self.assertIn("are those of `bench/run` (mode default) at commit abc123,", page)
        self.assertTrue(page.endswith("\n\n" + (kRoot / "README.md").read_text()))
        (out / "results/pareto_sibenik.json").write_text("{}")
        checked = subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=out, capture_output=True)
        self.assertNotEqual(checked.returncode, 0)

    def test_what_is_not_whole_is_refused(self):
        def refused(says):
            done = self.release()
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertRegex(done.stderr, r"\Abench/release: [^\n]+\n\Z")
            self.assertIn(says, done.stderr)
            self.assertFalse((self.folder / "out").exists())

        for context, says in (({"complete": False}, "is not complete"), ({"dirty": True}, "not committed")):
            self.write("pareto_sibenik", **context)
            refused(says)
        self.write("pareto_sibenik", complete=True)
        tables = self.results / "tables/tables.json"
        tables.parent.mkdir()
        for told, says in (({"complete": False, "mode": "default"}, "tables.json is not complete"),
                           ({"complete": True, "mode": "quick"}, "tables.json is of a quick run"),
                           ({"complete": True, "mode": "default", "build": "icbench 1, commit abc with changes, GNU"},
                            "tables.json was measured with changes")):
            tables.write_text(json.dumps(told))
            refused(says)
        tables.unlink()
        self.write_run("quick")
        refused("quick one")
        self.write_run("swift")
        refused("run.json is damaged")
        (self.results / "run.json").unlink()
        refused("nothing says what run this was")
        (self.results / ".unfinished").touch()
        refused("is not finished")
        self.write_run("full")
        (self.results / "pareto_sibenik.json").write_text('{"context": {')
        refused("is damaged")
        (self.results / "pareto_sibenik.json").unlink()
        refused("no ")
        self.write("pareto_sibenik", complete=True)
        (self.clone / "README.md").write_text("changed")
        refused("has changes that are not committed (README.md)")


if __name__ == "__main__":
    unittest.main()
