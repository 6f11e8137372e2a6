#!/usr/bin/env python3
"""Scene files that others made: assimp's test models, as Debian's package assimp-testmodels installs them, broken ones
among them. Each is rendered, or refused in one line; and glTF with an animation, written by assimp from such a model,
moves.

Skipped (status 77) where the package, or assimp-utils, is not installed, and in sanitizer builds, for it is assimp that
would be tested; ICBENCH_MODELS names another folder.
"""

import os
import shutil
import subprocess
import sys
import unittest
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from cli_support import ICBENCH, PATIENCE, SANITIZED, Case

MODELS = Path(os.environ.get("ICBENCH_MODELS", "/usr/share/assimp/models"))
# What models name, or what explains them.
NO_MODELS = {".bin", ".bmp", ".frag", ".glsl", ".jpg", ".md", ".mtl", ".png", ".tga", ".txt", ".uc", ".vert"}
KNOWN, KNOWN_REFUSED = 442, 125  # of version 5.2.5


def models():
    return sorted(path for path in MODELS.rglob("*") if path.is_file() and path.suffix.lower() not in NO_MODELS)


class ForeignModels(Case):
    def render(self, model):
        out = self.folder / f"{abs(hash(model))}.png"
        done = self.run_icbench("render", "--scene", model, "--integrator", "whitted", "--size", "16x12", "--spp", 1,
                                "--threads", 1, "--out", out)
        return model, done, out.exists()

    def test_each_is_rendered_or_refused_in_one_line(self):
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            results = list(pool.map(self.render, models()))
        refused = 0
        for model, done, has_picture in results:
            with self.subTest(model.relative_to(MODELS)):
                self.assertIn(done.returncode, (0, 2), done.stderr)
                self.assertEqual(has_picture, done.returncode == 0)
                if done.returncode == 2:
                    self.assert_refused(done)
                    self.assertNotIn("std::", done.stderr)
            refused += done.returncode == 2
        self.assertGreater(len(results), 2 * refused)
        self.assertGreater(refused, 0)
        if len(results) == KNOWN:
            self.assertEqual(refused, KNOWN_REFUSED)

    def test_gltf_with_an_animation_moves(self):
        for source in ("ASE/anim.ASE", "ASE/RotatingCube.ASE", "LWS/move_x.lws"):
            with self.subTest(source):
                subprocess.run(["assimp", "export", MODELS / source, "moving.glb", "-fglb2"], cwd=self.folder, check=True,
                               capture_output=True, timeout=PATIENCE)
                self.succeed("animate", "--scene", "moving.glb", "--integrator", "temporal_instant_caching", "--vpls", 64,
                             "--size", "48x36", "--frames", 24, "--every", 23, "--format", "none", "--json", "a.json")
                first, last = self.load("a.json")["frames"]
                self.assertGreater(first["records"], 0)
                self.assertGreater(last["records_dropped"], 0, "records lie on what moved")


if __name__ == "__main__":
    if SANITIZED or not MODELS.is_dir() or not shutil.which("assimp"):
        print("needs Debian's packages assimp-testmodels and assimp-utils, and no sanitizers")
        sys.exit(77)
    unittest.main()
