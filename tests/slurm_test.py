"""bench/slurm without a Slurm: a stand-in for sbatch runs each task of the job script, one after the other.

tests/slurm tries it against a real one.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import unittest
from pathlib import Path

from cli_support import ICBENCH, PATIENCE, Case, key_of, small_capture

kRoot = Path(__file__).resolve().parent.parent
kSweep = ["--workloads", ",".join(f"{workload}=50:scene=white_furnace"
                                  for workload in ("insert_only:records", "miss_driven:cost=0:operations")),
          "--threads", "1,2", "--caches", "sequential,wait_free", "--repetitions", "2"]
# Of the array it runs what $TASKS names, all if that is not set. It reads the options that stand in the script.
kSbatch = r"""#!/bin/bash
set -u
[[ $1 == --parsable ]] || { echo "sbatch: error: not asked for the number alone" >&2; exit 1; }
[[ -z ${INTERRUPT:-} ]] || { kill -INT "$PPID"; exit 1; }
[[ -z ${REFUSE:-} ]] || { echo "sbatch: error: $REFUSE" >&2; exit 1; }
option() { sed -n "s/^#SBATCH --$1=\"\{0,1\}\([^\"]*\)\"\{0,1\}$/\1/p" "$script"; }
script=$2
cd "$(option chdir)" || exit 1
for task in $(option array | tr , ' '); do
  [[ " ${TASKS-$task} " == *" $task "* ]] || continue
  log=$(option output)
  SLURM_ARRAY_TASK_ID=$task SLURM_JOB_ID=7 bash "$script" >>"${log//%a/$task}" 2>&1
done
echo "${BANNER-7}"
"""
# For the processors of a task it says $UNITS.
kSed = """#!/bin/bash
[[ ${!#} == /proc/self/status ]] && { echo "$UNITS"; exit; }
PATH=${PATH#*:} exec sed "$@"
"""
kSqueue = "#!/bin/sh\necho \"${QUEUED:-}\"\n"


class Slurm(Case):

    def setUp(self):
        super().setUp()
        self.commands = self.folder / "bin"
        self.commands.mkdir()
        for name, text in (("sbatch", kSbatch), ("squeue", kSqueue)):
            (self.commands / name).write_text(text)
            (self.commands / name).chmod(0o755)

    def slurm(self, *arguments, cwd=None, **environment):
        path = f"{self.commands}:{os.environ['PATH']}"
        return subprocess.run([sys.executable, kRoot / "bench/slurm", *arguments], cwd=cwd or self.folder, text=True,
                              timeout=PATIENCE, capture_output=True, env={**os.environ, "PATH": path, **environment},
                              preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))

    def submit(self, *arguments, **environment):
        return self.slurm("submit", "--out", "a sweep", "--icbench", ICBENCH, *arguments, **environment)

    def assert_done(self, done):
        self.assertEqual(done.returncode, 0, done.stderr)

    def assert_said(self, done, status, *parts):
        self.assertEqual(done.returncode, status, done.stderr)
        self.assertRegex(done.stderr, r"\Abench/slurm: [^\n]+\n\Z")
        for part in parts:
            self.assertIn(part, done.stderr)

    def files(self):
        return sorted((self.folder / "a sweep/tasks").glob("*.json"))

    def change(self, path, **context):
        data = self.load(path)
        for key, value in context.items():
            data["context"][key] = value
            if key in data["context"]["configuration"]["environment"]:
                data["context"]["configuration"]["environment"][key] = value
        path.write_text(json.dumps(data))

    def test_what_is_merged_equals_the_undivided_sweep(self):
        self.succeed("sweep", *kSweep, "--out", "whole.json")
        whole = self.load("whole.json")
        for split, tasks in ("workload", 2), ("threads", 4):
            with self.subTest(split=split):
                self.assert_done(self.submit(*kSweep, "--split", split))
                self.assertEqual(len(self.files()), tasks)
                self.assert_done(self.slurm("merge", "a sweep"))
                merged = self.load("a sweep/results.json")
                self.assertEqual(sorted(map(key_of, merged["benchmarks"])), sorted(map(key_of, whole["benchmarks"])))
                self.assertIs(merged["context"]["complete"], True)
                self.assertEqual(merged["context"]["configuration"], whole["context"]["configuration"])
                self.assertEqual(merged["context"]["pin_map"], whole["context"]["pin_map"])
                format_check = [sys.executable, kRoot / "tests/harness_format_check.py",
                                self.folder / "a sweep/results.json"]
                self.assertEqual(subprocess.run(format_check, timeout=PATIENCE).returncode, 0)
                shutil.rmtree(self.folder / "a sweep")

    def test_a_job_is_not_lost_to_what_a_site_prints_beside_its_number(self):
        told = self.submit(*kSweep, TASKS="0", BANNER="Welcome to the cluster\n7;cluster")
        self.assert_done(told)
        self.assertEqual(told.stdout, "7\n")
        self.assertEqual(self.load("a sweep/plan.json")["jobs"], ["7"])
        shutil.rmtree(self.folder / "a sweep")
        told = self.submit(*kSweep, BANNER="Queued.\nGood luck")
        self.assert_said(told, 2, "'Queued. Good luck'", "squeue --me")
        self.assert_done(self.slurm("merge", "a sweep"))

    def test_an_interrupted_submission_leaves_nothing_behind(self):
        told = self.submit(*kSweep, INTERRUPT="1")
        self.assert_said(told, 130, "interrupted; squeue --me tells")
        self.assertEqual(told.stderr.count("\n"), 1)
        self.assert_done(self.submit(*kSweep, TASKS="0"))

    def test_workloads_with_spaces_in_their_names_are_merged(self):
        self.succeed(*small_capture(out="a b.trace"))
        self.assert_done(self.submit("--workloads", "trace:file=a b.trace", "--threads", "1", "--caches",
                                     "sequential,wait_free", "--repetitions", "1"))
        self.assert_done(self.slurm("merge", "a sweep"))
        self.assertEqual(len(self.load("a sweep/results.json")["benchmarks"]), 2)

    def test_what_was_interrupted_is_resumed_alone(self):
        self.assert_done(self.submit(*kSweep, TASKS="0"))
        self.assert_said(self.slurm("merge", "a sweep"), 1, "1 of 2 tasks are not complete", "miss_driven",
                         "it was not started yet")
        # As a kill leaves it: some rows are there.
        first, = self.files()
        data = self.load(first)
        data["context"]["complete"] = False
        kept = data["benchmarks"][:3]
        first.write_text(json.dumps({**data, "benchmarks": kept}))
        self.assert_said(self.slurm("merge", "a sweep"), 1, "2 of 2", "the last line of its log")
        self.assert_done(self.slurm("resume", "a sweep", TASKS="0"))
        resumed = self.load(first)
        self.assertEqual(resumed["benchmarks"][:3], kept)
        self.assertEqual(resumed["context"]["resumed"][0]["entries"], 3)
        self.assert_said(self.slurm("resume", "a sweep", QUEUED="7"), 2, "job 7 still has tasks in the queue")
        self.assert_done(self.slurm("resume", "a sweep", "--time", "1:00", QUEUED="8"))
        script = (self.folder / "a sweep/job.sh").read_text()
        self.assertIn("#SBATCH --array=1\n", script)
        self.assertIn("#SBATCH --time=1:00\n", script)
        self.assert_done(self.slurm("merge", "a sweep"))
        self.assertIn("all 2 tasks are complete", self.slurm("resume", "a sweep").stderr)

    def test_machines_are_never_mixed_silently(self):
        self.assert_done(self.submit(*kSweep))
        first, second = self.files()
        self.change(second, host_name="other")
        self.assert_done(self.slurm("merge", "a sweep"))
        merged = self.load("a sweep/results.json")
        hosts = {row["workload"]: row["host_name"] for row in merged["benchmarks"]}
        self.assertEqual(len(set(hosts.values())), 2)
        self.assertEqual(merged["context"]["host_name"].split(","), sorted(hosts.values()))
        self.assertEqual([part["host_name"] for part in merged["context"]["merged"]],
                         [self.load(path)["context"]["host_name"] for path in (first, second)])
        self.change(second, cpu_model="another")
        done = self.slurm("merge", "a sweep")
        self.assert_done(done)
        self.assertIn("2 kinds of machine or build, which differ in cpu_model", done.stderr)
        self.assertFalse((self.folder / "a sweep/results.json").exists())
        for number, path in enumerate((first, second), 1):
            part = self.load(f"a sweep/results.{number}.json")
            self.assertEqual({row["workload"] for row in part["benchmarks"]},
                             {row["workload"] for row in self.load(path)["benchmarks"]})
            self.assertIs(part["context"]["complete"], False)

    def test_wrong_results_are_refused(self):
        self.assert_done(self.submit(*kSweep))
        first, _ = self.files()
        good = first.read_text()
        data = self.load(first)
        for text, says in ((good[:-20], "is damaged"), ("[]", "is damaged"),
                           (json.dumps({**data, "benchmarks": data["benchmarks"][1:]}), "other points than task 0000"),
                           (json.dumps({**data, "benchmarks": [{}]}), "no results file")):
            with self.subTest(says):
                first.write_text(text)
                self.assert_said(self.slurm("merge", "a sweep"), 2, says, first.name)
        first.write_text(good)
        twin = first.with_name("0000.other.0.json")
        twin.write_text(good)
        self.assert_said(self.slurm("merge", "a sweep"), 2, "task 0 was measured twice", twin.name)

    def test_dry_run_prints_the_script_and_writes_nothing(self):
        done = self.submit(*kSweep, "--dry-run", "--partition", "long", "--cpus", "4", "--sbatch=--account=a b")
        self.assert_done(done)
        self.assertEqual(os.listdir(self.folder), ["bin"])
        for line in ("--partition=long", "--cpus-per-task=4", '--account="a b"', "--array=0,1", "--requeue"):
            self.assertIn(f"#SBATCH {line}\n", done.stdout)
        self.assertNotIn("--exclusive", done.stdout)
        self.assertEqual(subprocess.run(["bash", "-n"], input=done.stdout, text=True).returncode, 0)

    def test_sbatch_is_told_every_sign_of_a_value(self):
        folder = self.folder / "it's #1"
        folder.mkdir()
        done = self.submit(*kSweep, "--dry-run", "--sbatch=--comment=a#b", "--sbatch=--wckey=c'd\\e\"f",
                           "--time", "1:00", cwd=folder)
        self.assert_done(done)
        for line in ('--comment="a#b"', '--wckey="c\'d\\\\e\\"f"', "--time=1:00", f'--chdir="{folder}"',
                     f'--output="{folder}/a sweep/logs/%a.log"'):
            self.assertIn(f"#SBATCH {line}\n", done.stdout)

    def test_a_list_of_many_processors_makes_no_name_that_is_too_long(self):
        (self.commands / "sed").write_text(kSed)
        (self.commands / "sed").chmod(0o755)
        every_second = ",".join(map(str, range(0, 256, 2)))
        names = []
        for units in (every_second, every_second.removesuffix(",254"), "0-3"):
            self.assert_done(self.submit(*kSweep, UNITS=units))
            self.assertIn(f"processors {units},", (self.folder / "a sweep/logs/0.log").read_text())
            first, second = (path.name.split(".", 1)[1] for path in self.files())
            self.assertEqual(first, second)
            names.append(first)
            shutil.rmtree(self.folder / "a sweep")
        self.assertEqual(len(set(names)), 3, "other processors, another file")
        self.assertTrue(names[-1].endswith(".0-3.json"))

    def test_bad_input_is_one_line(self):
        (self.folder / "a folder").mkdir()
        for arguments, says in (
                ([], "say what to do"), (["frobnicate"], "invalid choice"),
                (["submit", *kSweep], "--out"), (["submit", "--out", "x"], "name what to measure"),
                (["submit", "--out", "x", "--workloads", "nosuch", "--threads", "1"], "nosuch"),
                (["submit", "--out", "x", "--workloads", "read_only", "--threads", "0"], "threads"),
                (["submit", "--out", "x", "--workloads", "read_only,read_only", "--threads", "1"], "read_only"),
                (["submit", "--out", "x", *kSweep[:4], "--caches", "wait_fre"], "wait_fre"),
                (["submit", "--out", "x", *kSweep, "--cpus", "some"], "'some' is no number"),
                (["submit", "--out", "x", *kSweep, "--resume"], "--resume is bench/slurm's own"),
                (["submit", "--out", "x%y", *kSweep], "without %"),
                (["submit", "--out", "x", *kSweep, "--icbench", "nosuch"], "cannot run"),
                (["merge", "a folder"], "holds no plan"), (["resume", "a folder"], "holds no plan"),
                (["merge", "a folder", "--fast"], "--fast"), (["resume", "a folder", "--seed", "2"], "--seed")):
            with self.subTest(arguments):
                icbench = ["--icbench", ICBENCH] if arguments[:1] == ["submit"] and "--icbench" not in arguments else []
                self.assert_said(self.slurm(*arguments, *icbench), 2, says)
                self.assertEqual(sorted(os.listdir(self.folder)), ["a folder", "bin"])

    def test_a_refused_job_leaves_nothing_to_clear_away(self):
        self.assert_said(self.submit(*kSweep, REFUSE="invalid partition"), 2, "invalid partition")
        self.assert_done(self.submit(*kSweep))
        self.assert_said(self.submit(*kSweep), 2, "holds a sweep already")


if __name__ == "__main__":
    unittest.main()
