#!/usr/bin/env python3
"""A render that captures no trace runs the code that it would run if there were no traces: the pass through a cache is
compiled with the flags of the build against the headers as they are, and against a copy from which every word of traces
is taken; where a query is told of, a line is left that names the session and does nothing, since it is by that name that
the closure's members get their order. Then the disassembly of all its functions is compared. As a control, a session
that is told of queries must tell the two apart.

Environment: that of machine_code.py.
"""

import re
import shutil
import tempfile
import unittest
from pathlib import Path

import machine_code
from machine_code import SOURCES

# What headers without traces would not have: what a pass is set up with, who it hands over to, who is told of queries.
TAKEN = {
    "workload/cached_pass.h": [
        (r"^class TraceRecorder;\n", ""),
        (r"TraceRecorder\* trace = nullptr;[^\n]*", "void* nothing = nullptr;"),  # all else stays where it is
        (r"^/// Captures what it does[^\n]*\n.*?;\n", ""),
        (r"^ *if \(setup\.trace != nullptr\)[^\n]*\n", "")],
    "render/irradiance_cache.h": [
        (r"^/// A session that is told of each point[^{]*\{.*?^\};\n", ""),
        # Something names the session there, which makes it the same member of the closure.
        (r"^ *if constexpr \(ToldOfQueries<Session>\)[^\n]*\n", "static_cast<void>(session);\n")],
}
LEFT = re.compile(r"TraceRecorder|TracedPass|traced_pass|ToldOfQueries|\basked\(")
PASS = """
#include "caches/registry.h"
#include "workload/cached_pass.h"
using namespace icbench;
template class icbench::CachedPass<{cache}>;
"""
# A stand-in for the session of TracedPass, which is in a source file of its own: told of each query, it counts.
TOLD = """
#include "render/irradiance_cache.h"
using namespace icbench;
const Record& some_record() noexcept;
struct Told {
  unsigned long& queries;
  template <class F> void visit(const SurfacePoint&, F&& f) noexcept { f(some_record(), 1.0f); }
  std::optional<Irradiance> query(const SurfacePoint& x) noexcept;
  InsertResult insert(const Record& r) noexcept;
  void asked(const SurfacePoint&, bool) noexcept { ++queries; }
};
auto tile_of_told = &irradiance_cache_tile<Told>;
"""
CACHE = "PackedWaitFree"


class TracesOff(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="icbench-traces-")
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        cls.without = cls.folder / "src"
        shutil.copytree(SOURCES, cls.without)
        for name, places in TAKEN.items():
            text = (cls.without / name).read_text()
            for pattern, instead in places:
                text, n = re.subn(pattern, instead, text, flags=re.MULTILINE | re.DOTALL)
                assert n == 1, f"{name}: {pattern} is there {n} times"
            (cls.without / name).write_text(text)

    def functions(self, text, include):
        return machine_code.functions(text, include, self.folder, "code")

    def test_the_copy_has_no_word_of_traces(self):
        for name in TAKEN:
            self.assertEqual(LEFT.findall((self.without / name).read_text()), [], name)

    def test_a_pass_that_captures_nothing_is_that_without_traces(self):
        text = PASS.format(cache=CACHE)
        real, bare = self.functions(text, SOURCES), self.functions(text, self.without)
        tiles = [name for name in real if "irradiance_cache_tile" in name or "CachedPass" in name and "4tile" in name]
        self.assertTrue(tiles)
        self.assertGreater(sum(len(real[name]) for name in tiles), 500)
        self.assertEqual(set(real), set(bare))
        for name, code in real.items():
            self.assertEqual(code, bare[name], name)

    def test_one_that_captures_is_not(self):
        real, bare = self.functions(TOLD, SOURCES), self.functions(TOLD, self.without)
        self.assertNotEqual(real, bare)


if __name__ == "__main__":
    unittest.main()
