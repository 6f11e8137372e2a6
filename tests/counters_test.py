#!/usr/bin/env python3
"""Counters that are compiled out leave no trace: the machine code of queries and inserts is the same when nothing is
handed to them, and they are nothing.

Compiles them twice with the flags of the build: against the headers as they are, and against a copy whose counts
are all of 0, by a policy that is empty by definition. Then compares the disassembly. A control with counters on must
differ. What a counter beside the policy would do, write to memory, caches_hard_cases_test looks for.

Environment: that of machine_code.py.
"""

import re
import shutil
import tempfile
import unittest
from pathlib import Path

import machine_code
from machine_code import SOURCES

# Of the statement that counts, up to its semicolon; no count's argument holds one.
COUNTING = re.compile(r"(\.template\s+add<\s*&Counts::\w+\s*>)\([^;]*\);")
POLICY = re.compile(r"^class NoCounters \{.*?^\};", re.DOTALL | re.MULTILINE)
EMPTY = """class NoCounters {
 public:
  static constexpr bool kOn = false;
  template <auto Field>
  void add(std::uint64_t) noexcept {}
  Counts counts() const noexcept { return {}; }
  void reset() noexcept {}
};"""
HEADERS = """
#include "caches/direct.h"
#include "caches/local_write.h"
#include "caches/locked.h"
#include "caches/packed_octree.h"
#include "caches/ward_tree.h"
using namespace icbench;
"""
# Direct use, a lock around the whole, and copies of a thread: all ways from a session to a structure.
CACHES = {"ward": "Direct<WardTree<StdSync>, {counters}>", "packed": "Direct<Packed<StdSync>, {counters}>",
          "locked": "Locked<Packed<PlainSync>, GlobalMutex, {counters}>",
          "shared": "Locked<Packed<PlainSync>, SharedMutex, {counters}>",
          "local": "LocalWrite<Packed<StdSync>, Packed<PlainSync>, {counters}>"}
OPERATIONS = """
using C_{name} = {cache};
extern "C" bool ask_{name}(C_{name}::Session& s, const SurfacePoint& x, Irradiance& out) {{
  const auto E = s.query(x);
  if (E) out = *E;
  return E.has_value();
}}
extern "C" InsertResult insert_{name}(C_{name}::Session& s, const Record& r) {{ return s.insert(r); }}
"""


def text(counters):
    """A translation unit with all operations."""
    return HEADERS + "".join(OPERATIONS.format(name=each, cache=cache.format(counters=counters))
                             for each, cache in CACHES.items())


NAMES = [f"{operation}_{name}" for operation in ("ask", "insert") for name in CACHES]


def without_counting(folder):
    """A copy of core and caches in which nothing is counted; returns how many counts there were."""
    found = 0
    for part in ("core", "caches"):
        shutil.copytree(SOURCES / part, folder / part)
        for path in (folder / part).glob("*.h"):
            text, n = COUNTING.subn(r"\1(0);", path.read_text())
            if path.name == "counters.h":
                text, policies = POLICY.subn(EMPTY, text)
                assert policies == 1, "core/counters.h has no class NoCounters"
            path.write_text(text)
            found += n
    return found


class Counters(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="icbench-counters-")
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        cls.counts = without_counting(cls.folder / "src")
        cls.bare = machine_code.functions(text("NoCounters"), cls.folder / "src", cls.folder, "bare")

    def test_the_copy_counts_nothing(self):
        self.assertGreater(self.counts, 20)
        for path in (self.folder / "src").rglob("*.h"):
            handed = re.findall(r"\.template\s+add<\s*&Counts::\w+\s*>\((?!0\))", path.read_text())
            self.assertEqual(handed, [], path.name)

    def test_without_counters_the_code_is_that_without_counting(self):
        real = machine_code.functions(text("NoCounters"), SOURCES, self.folder, "real")
        for name in NAMES:
            self.assertGreater(len(real[name]), 20, name)
        self.assertEqual(set(real), set(self.bare))
        for name, code in real.items():
            self.assertEqual(code, self.bare[name], name)

    def test_with_counters_it_is_not(self):
        counted = machine_code.functions(text("WithCounters"), SOURCES, self.folder, "counted")
        for name in NAMES:
            self.assertNotEqual(counted[name], self.bare[name], name)


if __name__ == "__main__":
    unittest.main()
