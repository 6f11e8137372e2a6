"""A table as data: made once, written as HTML and as Markdown."""
from __future__ import annotations

import re
from dataclasses import dataclass, field

from tables import text


@dataclass(frozen=True)
class Cell:
    value: str
    under: str = ""  # smaller, on a line of its own for each part that a semicolon ends: an interval, others' figures
    verdict: str = ""  # good, bad or open: how the cell is coloured


@dataclass
class Grid:
    name: str
    title: str
    note: str
    columns: list[str]
    rows: list[list[Cell]] = field(default_factory=list)
    left: int = 1  # columns of words; the others hold numbers
    groups: list[tuple[str,
                       int]] = field(default_factory=list)  # headings over columns, and how many each spans

    def html(self) -> str:
        kinds = ["" if i < self.left else "n" for i in range(len(self.columns))]
        kinds[0] = "key" if self.left == 1 else ""
        over = "".join(f'<th colspan="{span}" class="{"group" if title else "none"}">{text(title)}</th>'
                       for title, span in self.groups)
        head = "".join(f'<th class="{kind}">{text(title)}</th>' for kind, title in zip(kinds, self.columns))
        body = "".join(f"<tr>{''.join(map(_html_cell, kinds, row))}</tr>" for row in self.rows)
        return (
            f'<h3 id="{self.name}">{text(self.title)}</h3>' +
            (f'<p class="note">{text(self.note)}</p>' if self.note else "") +
            f'<div class="scroll"><table><thead>{f"<tr>{over}</tr>" if over else ""}<tr>{head}</tr></thead>'
            f"<tbody>{body}</tbody></table></div>")

    def markdown(self) -> str:
        titles = self.columns
        if self.groups:
            over = [title for title, span in self.groups for _ in range(span)]
            titles = [
                f"{group}: {title}" if group and title else group or title
                for group, title in zip(over, titles)
            ]
        lines = [
            titles, ["---" if i < self.left else "---:" for i in range(len(self.columns))],
            *([_markdown_cell(cell) for cell in row] for row in self.rows)
        ]
        table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        return f"### {self.title}\n\n" + (f"{self.note}\n\n" if self.note else "") + table + "\n"


def _html_cell(kind: str, cell: Cell) -> str:
    classes = " ".join(filter(None, (kind, cell.verdict)))
    # Parts of a list, a line each, so that it makes no column wide.
    under = "".join(f'<span class="under">{text(part)}</span>' for part in re.split("(?<=;) ", cell.under) if part)
    return f'<td class="{classes}">{text(cell.value)}{under}</td>'


def markdown_text(words: str) -> str:
    """Words that Markdown shows as they are, on one line: names come from files."""
    return re.sub(r"[\\`*<|]", r"\\\g<0>", words).replace("\n", " ")


def _markdown_cell(cell: Cell) -> str:
    value, under = markdown_text(cell.value), markdown_text(cell.under)
    return (f"**{value}**" if cell.verdict == "bad" else value) + (f" ({under})" if under else "")
