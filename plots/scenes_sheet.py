#!/usr/bin/python3
"""README's sheet of all scenes, rendered by the program: some six minutes on 2 cores."""
from __future__ import annotations

import argparse
import io
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import style  # first: it checks what is installed

from matplotlib import font_manager
from PIL import Image, ImageDraw, ImageFont

from files import write_whole

kRoot = Path(__file__).resolve().parent.parent
kColumns, kWidth, kHeight, kGap, kLabel = 4, 320, 240, 10, 28  # a cell's picture, and round it, pixels
kFontSize, kQuality = 19, 86
kVpls = "4096"  # fewer leave brighter spots in corners


@dataclass(frozen=True)
class Shot:
    """How a scene shows best."""
    frame: int = 0
    exposure: float = 1.0
    spp: int = 49  # what lights of a large area need to be free of noise
    accuracy: float = 0.14


kShots = {
    "cornell_box": Shot(30, 1.9), "wobble": Shot(30), "desk": Shot(30, 1.15, 81),
    "bunnies_1": Shot(30, 0.95, 100), "bunnies_2": Shot(30, 0.95, 81), "bunnies_4": Shot(30, 0.9, 81),
    "bunnies_9": Shot(30, 0.95, 100), "cornell_specular": Shot(30, 1.9),
    "cornell_indirect": Shot(30, 1.4, accuracy=0.1), "cornell_camera": Shot(15, 1.8),
    "cornell_lamp": Shot(30, 2.1, 100), "cornell_paint": Shot(30, 1.9), "conference": Shot(40, 0.75, 100),
    "sibenik": Shot(30, 0.85, 144), "office": Shot(0, 0.95, 100), "white_furnace": Shot(0, 0.8),
    "lit_floor": Shot(0, 0.9), "sphere_light": Shot(0, 0.9), "integrating_sphere": Shot(0, 0.4)
}


def scenes(program: str) -> list[tuple[str, bool]]:
    """Names in the program's order, and whether the answer is known in closed form."""
    listed = subprocess.run([program, "list", "scenes"], check=True, capture_output=True, text=True).stdout
    rows = [line.split() for line in listed.splitlines()[1:]]
    return [(row[0], row[1] == "yes") for row in rows]


def render(program: str, scene: str, width: int, folder: Path) -> Image.Image:
    shot, out = kShots.get(scene, Shot()), folder / f"{scene}.png"
    subprocess.run([
        program, "render", "--scene", scene, "--integrator", "instant_caching", "--vpls", kVpls, "--accuracy",
        str(shot.accuracy), "--size", f"{width}x{kHeight}", "--spp", str(shot.spp), "--frame",
        str(shot.frame), "--exposure", str(shot.exposure), "--out", str(out)
    ], check=True, stdout=sys.stderr)
    with Image.open(out) as picture:
        return picture.convert("RGB")


def places(found: list[tuple[str, bool]]) -> list[tuple[str, int, int, int]]:
    """Name, left, top and width of every picture. Two analytic scenes, which are plain, share a cell."""
    made, cell = [], 0.0
    for name, analytic in found:
        width = (kWidth - kGap) // 2 if analytic else kWidth
        row, column = divmod(int(cell), kColumns)
        left = kGap + column * (kWidth + kGap) + (width + kGap if cell % 1 else 0)
        made.append((name, left, kGap + row * (kHeight + kLabel + kGap), width))
        cell += 0.5 if analytic else 1
    return made


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--icbench", default=str(kRoot / "build/release/bin/icbench"), metavar="FILE")
    parser.add_argument("--out", type=Path, default=kRoot / "plots/images/scenes.jpg", metavar="FILE")
    options = parser.parse_args()
    if options.out.suffix.lower() not in (".jpg", ".jpeg", ".png", ".webp"):
        parser.error(f"--out {options.out} is no picture; let it end in .jpg, .png or .webp")
    font = ImageFont.truetype(font_manager.findfont("DejaVu Sans"), kFontSize)
    try:
        placed = places(scenes(options.icbench))
        size = (kGap + kColumns * (kWidth + kGap), placed[-1][2] + kHeight + kLabel + kGap)
        sheet = Image.new("RGB", size, "white")
        draw = ImageDraw.Draw(sheet)
        with tempfile.TemporaryDirectory() as folder:
            for name, left, top, width in placed:
                sheet.paste(render(options.icbench, name, width, Path(folder)), (left, top))
                draw.text((left + width / 2, top + kHeight + kLabel / 2), name, fill=style.kBlack, font=font,
                          anchor="mm")
        made = io.BytesIO()
        sheet.save(made, Image.registered_extensions()[options.out.suffix.lower()], quality=kQuality)
        write_whole(options.out, made.getvalue())
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"{sys.argv[0]}: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
