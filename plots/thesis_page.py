#!/usr/bin/python3
"""Builds tables.html, one self-contained page, tables.md and all figures from tables.json of bench/tables."""
from __future__ import annotations

import io
import shlex
import sys
from pathlib import Path
from string import Template

import style  # first: it checks what is installed

from PIL import Image

import thesis_tables
from figure import Omitted, OneLineParser, Written, write
from files import write_whole
from figures import THESIS_FIGURES
from grid import Grid, markdown_text
from inline import data_uri, drawing, image
from results import InputError
from tables import note_line, text
from thesis_mechanisms import kWhats
from thesis_results import kFiles, Measured, load

kTemplate = Path(__file__).resolve().parent / "template.html"
kPicturePixels = 288  # largest side of a picture on the page
kPictures = (("rt", "RT: direct light only"), ("igi", "IGI"), ("tic", "TIC"), ("path", "path tracing"),
             ("hdrvdp_tic_path_clean", "TIC against path tracing, indirect light"), ("hdrvdp_tic_igi",
                                                                                     "TIC against IGI"))
kMethods = ((
    "RT",
    "Whitted ray tracing: direct light only. The floor for time, and how dark it is without indirect light."
), ("Path tracing", "The reference: unbiased, slow."), (
    "IGI",
    "Instant global illumination: every pixel gathers light from all virtual point lights (VPLs), each by a "
    "shadow ray."
), (
    "IGI interleaved",
    "Each pixel gathers from a subset of the VPLs, and a filter that keeps edges joins neighbours: the fair "
    "rival."
), (
    "IC",
    "Instant caching: VPLs are gathered only at sparse records, between which an irradiance cache "
    "interpolates. The cache is cleared after each frame."
), ("TIC",
    "Temporal instant caching: VPLs and records live on; after motion only what became invalid is computed "
    "again."
    ), ("Hash cells",
        "Every visible point traces light paths of its own and shares their mean with all points in the same cell of a "
        "spatial hash, as renderers on graphics processors do: no VPLs, no interpolation. Not in the thesis."))
kLead = (
    "Dubla (Interactive Global Illumination on the CPU, Warwick 2012) made animations with indirect light "
    "interactive by keeping virtual point lights and irradiance records over frames, and let all threads "
    "share one cache without locks. These are that thesis's experiments, made again in kind. The scenes "
    "are stand-ins modelled after the originals' descriptions, the machine is another one, and seconds do "
    "not carry over: ratios do.")


def _thumbnail(path: Path) -> str | None:
    try:
        picture = Image.open(path)
        picture.load()
    except (OSError, SyntaxError):
        return None
    picture.thumbnail((kPicturePixels, kPicturePixels), Image.LANCZOS)
    buffer = io.BytesIO()
    picture.convert("RGB").save(buffer, "WEBP", quality=82, method=5)
    return data_uri("image/webp", buffer.getvalue())


def _gallery(measured: Measured) -> str:
    """Per scene the last frame by every method, and the maps of visible differences."""
    made = []
    for scene in measured.scenes.values():
        paths, tiles = scene.get("pictures") or {}, []
        for key, caption in kPictures:
            uri = _thumbnail(measured.path.parent / paths[key]) if key in paths else None
            if uri:
                tiles.append(f'<figure>{image(uri, scene["title"] + ", " + caption)}'
                             f"<figcaption>{text(caption)}</figcaption></figure>")
        if not tiles:
            continue
        preview = paths.get("animation_tic")
        link = f' · <a href="{text(preview)}">animation by TIC</a>' if preview else ""
        what = f"{scene['kind']}, {scene['vpls']['chosen']} VPLs"
        made.append(
            f'<div class="keep"><h3>{text(scene["title"])}</h3>'
            f'<p class="note">{text(scene["description"])} · {what}{link}'
            f'</p><div class="pictures small">{"".join(tiles)}</div></div>')
    if not made:
        return ""
    return (
        '<p class="note">The last frame (stills: the only one), one sample a pixel, all of a scene under one '
        "exposure. Maps: "
        "grey where a human would see no difference (HDR-VDP), turning to green at a probability of 75 % "
        "and to red at 95 %; the one against path tracing with converged direct light, so that it shows "
        f"the indirect light's error alone.</p>{''.join(made)}")


def _cards(measured: Measured) -> str:
    """What to take away, as numbers."""
    cards = []

    def card(title: str, value: str, told: str) -> None:
        cards.append(
            f'<div class="card"><div class="what">{text(title)}</div><div class="value">{text(value)}</div>'
            f"<div>{text(told)}</div></div>")

    def span(values) -> str:
        values = list(values)
        low, high = style.number(min(values)), style.number(max(values))
        return f"{low}×" if low == high else f"{low} to {high}×"

    animations, thesis = measured.animations.values(), measured.data["thesis"]
    times = thesis["indirect_times"].values()
    for key, method, title, theirs in (("indirect_over_tic", "igi", "Indirect light, TIC over full IGI",
                                        f"thesis: {span(t['igi_over_tic'] for t in times)}"),
                                       ("indirect_over_tic", "interleaved",
                                        "Indirect light, TIC over interleaved IGI", "not in the thesis"),
                                       ("indirect_over_tic", "ic", "Indirect light, TIC over static IC",
                                        f"thesis: {span(t['ic_over_tic'] for t in times)}"),
                                       ("whole_over_tic", "igi", "Whole frames, TIC over full IGI",
                                        f"thesis: {span(thesis['whole_frames'])}")):
        values = [s["time"][key][method]["median"] for s in animations if s["time"][key][method]]
        if values:
            card(title, span(values), f"faster, over {style.plural(len(values), 'animation')}; {theirs}.")
    seen = [(s["quality"].get("tic_igi") or {}).get("p75") for s in measured.scenes.values()]
    seen = [v for v in seen if v is not None]
    if seen:
        card("Visible loss of TIC against IGI", f"{max(seen):.2f} %",
             "of pixels at most, P > 75 %; thesis: 0.33 %.")
    verdicts = [t["verdict"] for t in measured.data["targets"]]
    if verdicts:
        parts = ", ".join(f"{verdicts.count(v)} {v}" for v in ("fail", "undecided", "skipped")
                          if v in verdicts)
        card("Figures to reach", f"{verdicts.count('pass')} of {len(verdicts)}",
             f"pass{'; ' + parts if parts else ''}.")
    return f'<div class="cards">{"".join(cards)}</div>' if cards else ""


def _facts(measured: Measured) -> str:
    d, s = measured.data, measured.data["settings"]
    size = f"{s['size'][0]} × {s['size'][1]} pixels"
    few_frames = f", {s['mechanism_frames']} to compare mechanisms" if "mechanism_frames" in s else ""
    what = (
        f"{style.plural(len(measured.scenes), 'scene')}, {size}, {s['frames']} frames"
        f"{few_frames}, 1 sample a pixel; "
        f"references of {s['reference_spp']:,} samples; {style.plural(s['rounds'], 'round')} in which the "
        "methods alternate"
    )
    machine = d["machine"]
    where = (f"{machine['cpu']}, {style.plural(machine['units'], 'processing unit')}; {d['build']}; "
             f"{machine['date'][:16]}")
    return (
        f'<div class="facts"><div><b>What was measured</b>{text(what)}</div>'
        f'<div><b>On what</b>{text(where)}</div></div>'
    )


def _warnings(measured: Measured) -> list[tuple[bool, str]]:
    """What to know before believing a number, the grave ones first."""
    d, out = measured.data, []
    if not d["complete"]:
        out.append((True, "The run is not complete: this page shows what was measured until now."))
    for failure in d["failures"]:
        out.append((True, f"A job failed: {failure['scene']}, {failure['job']}: {failure['error']}"))
    if d["absent"]:
        out.append((True, f"Not in this program: {', '.join(d['absent'])}."))
    if d["mode"] == "quick":
        out.append((
            False,
            "A quick run: small pictures, few frames and samples. TIC has few frames over which to spread "
            "its first one, and HDR-VDP sees coarse pixels; ratios differ from those of the long form."))
    few = d["settings"]["rounds"]
    if few < 6:
        out.append((False, f"{style.plural(few, 'round')}: " + (
            "no intervals can be given." if few < 3 else
            "an interval is the range of the rounds, which holds the median with "
            f"{100 * (1 - 2.0 ** (1 - few)):.0f} %."
        )))
    off = [
        s["title"] for s in measured.scenes.values() if s["vpls"]["chosen"] and not s["vpls"]["levelled_off"]
    ]
    if off:
        out.append((False, f"IGI had not levelled off below the largest number of VPLs on {', '.join(off)}."))
    load_ = d["machine"]["load_avg"][0]
    if load_ > d["machine"]["units"] + 1.5:
        out.append((
            True,
            f"The load was {load_:.1f} when the run began: other programs were running, and times are not "
            "to be trusted."))
    return sorted(out, key=lambda warning: not warning[0])


def grids(measured: Measured) -> list[tuple[str, list[Grid]]]:
    """All tables by section."""
    t = thesis_tables
    chapter7 = [t.mechanisms(measured, what, heading) for what, heading in kWhats.items()]
    parts = [("Number of VPLs", [t.vpl_numbers(measured)]),
             ("Speed", [t.whole_frames(measured), t.indirect_time(measured)]),
             ("Quality", [t.perceived(measured),
                          t.numeric_errors(measured),
                          t.over_frames(measured)]), ("Equal error", [t.equal_error(measured)]),
             ("Mechanisms", chapter7), ("Memory and work", [t.memory(measured)]),
             ("Figures to reach", [t.targets(measured)]), ("Claims", [t.claims(measured)])]
    return [(title, [g for g in mine if g.rows]) for title, mine in parts if any(g.rows for g in mine)]


kFigureOf = {
    "Number of VPLs": "thesis_vpls", "Speed": "thesis_frame_times", "Equal error": "thesis_equal_error",
    "Mechanisms": "thesis_mechanisms"
}


def _figure(done: Written | None) -> str:
    if done is None:
        return ""
    plates = "".join(drawing(path, f"{done.figure.title}, {title}") for title, path in done.plates)
    return (
        f'<div class="read"><b>{text(done.figure.title)}.</b> {text(done.figure.how_to_read)}</div>{plates}'
        f'{"".join(map(note_line, done.notes))}')


def _draw(measured: Measured, out: Path) -> dict[str, Written]:
    drawn = {}
    for figure in THESIS_FIGURES:
        try:
            drawn[figure.name] = write(figure, measured, out / "figures")
        except Omitted:
            continue
    return drawn


def _html(measured: Measured, out: Path, command: str) -> str:
    drawn = _draw(measured, out)
    sections = [("Before you believe a number",
                 "".join(f'<li class="{"grave" if grave else ""}">{text(line)}</li>'
                         for grave, line in _warnings(measured)))]
    sections[0] = (sections[0][0], f'<ul class="warnings">{sections[0][1]}</ul>') if sections[0][1] else ("",
                                                                                                          "")
    sections.append(("Scenes", _gallery(measured)))
    for title, mine in grids(measured):
        sections.append(
            (title, "".join(g.html() for g in mine) + _figure(drawn.get(kFigureOf.get(title, "")))))
    lines = "".join(f'<tr><td>{text(k.replace("_", " "))}</td><td class="raw">{text(v)}</td></tr>'
                    for k, v in {**measured.data["settings"], **measured.data["machine"]}.items())
    sections.append(
        ("How it was made",
         f'<p>Measured with</p><pre>{text(measured.data["command_line"])}</pre><p>The page was made '
         f"with</p><pre>{text(command)}</pre><table><tbody>{lines}</tbody></table>"))
    sections = [(title, content) for title, content in sections if content]
    slugs = {title: title.lower().replace(" ", "-") for title, _ in sections}
    nav = "".join(f'<a href="#{slugs[title]}">{text(title)}</a>' for title, _ in sections)
    names = "".join(f"<tr><td><b>{text(name)}</b></td><td>{text(told)}</td></tr>" for name, told in kMethods)
    body = (
        f'<h1>{text(measured.data["title"])}</h1><p class="lead">{text(kLead)}</p><nav>{nav}</nav>'
        f'{_facts(measured)}'
        f'{_cards(measured)}<h3>The methods</h3><table><tbody>{names}</tbody></table>')
    return body + "".join(f'<h2 class="flow" id="{slugs[title]}">{text(title)}</h2>{content}'
                          for title, content in sections)


def _markdown(measured: Measured) -> str:
    d = measured.data
    parts = [
        f"# {d['title']}\n\n{kLead}\n", f"`{d['command_line']}`; {d['build']}; {d['machine']['cpu']}, "
        f"{d['machine']['units']} processing units; {d['machine']['date']}\n"
    ]
    warnings = _warnings(measured)
    if warnings:
        parts.append("\n".join(f"- {markdown_text(line)}" for _, line in warnings) + "\n")
    for title, mine in grids(measured):
        parts.append(f"## {title}\n\n" + "\n".join(g.markdown() for g in mine))
    return "\n".join(parts)


def build(path: Path, out: Path, command: str) -> Path:
    """Writes out/tables.html, out/tables.md and out/figures; returns the page. Raises InputError or OSError.
    """
    measured = load([path])[0]
    out.mkdir(parents=True, exist_ok=True)
    write_whole(out / "tables.md", _markdown(measured))
    page = out / "tables.html"
    template = Template(kTemplate.read_text(encoding="utf-8"))
    write_whole(page, template.substitute(title=text("icbench: the thesis's tables"),
                                          body=_html(measured, out, command), scripts=""))
    return page


def main() -> int:
    options = OneLineParser(description=__doc__)
    options.add_argument("results", metavar="TABLES", type=Path, help=kFiles)
    options.add_argument("--out", type=Path, metavar="DIR",
                         help="where the files go (default: beside TABLES)")
    arguments = options.parse_args()
    try:
        print(build(arguments.results, arguments.out or arguments.results.parent, shlex.join(sys.argv)))
    except (InputError, OSError) as error:
        print(f"thesis_page.py: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
