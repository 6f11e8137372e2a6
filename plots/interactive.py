"""What makes the page interactive: Chart.js and own scripts, inlined, so that the page stays one file.

Everything that scripts show stands in the page without them as well, as figures and tables.
"""
from __future__ import annotations

import json
import math
from pathlib import Path

kLibraries = ("/usr/share/javascript/chart.js/chart.min.js", "/usr/share/javascript/chart.js/Chart.min.js")
kPackage = "libjs-chart.js"
kScripts = ("page.js", "choice.js", "seconds.js", "explorer.js")
kDigits = 4  # significant ones of numbers that scripts show


def library() -> Path | None:
    """Chart.js as the system's package has it; None where that is not installed."""
    return next((path for path in map(Path, kLibraries) if path.exists()), None)


def data(identity: str, value) -> str:
    """A value as JSON in the page; scripts find it by its id. Nothing in it can end the element or pass for HTML."""
    made = json.dumps(value, separators=(",", ":"), allow_nan=False)
    for sign in "<>&":
        made = made.replace(sign, f"\\u{ord(sign):04x}")
    return f'<script type="application/json" id="{identity}">{made}</script>'


def short(value: float | None, digits: int = kDigits) -> float | None:
    """A number as JSON holds it, in some significant digits; None for what is none."""
    if value is None or not math.isfinite(value):
        return None
    made = float(f"{value:.{digits}g}")
    return int(made) if made == int(made) and abs(made) < 1e15 else made


def scripts() -> str:
    """All scripts of a page; without Chart.js those that need none."""
    found = library()
    made = []
    if found:
        made.append(found.read_text(encoding="utf-8"))
    folder = Path(__file__).resolve().parent
    made += [(folder / name).read_text(encoding="utf-8") for name in kScripts if found or name != "explorer.js"]
    return "".join("<script>" + script.replace("</script", "<\\/script") + "</script>" for script in made)
