"""The small pieces of HTML that all sections share: escaping, marks, tables, folds, figures."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

_WORD = re.compile(r"[^\W\d_]+(?:[-'’][^\W\d_]+)*[,;:]?(?:\s|$)")
_GREEK, _LAST_GREEK = "\u0370", "\u03ff"
_QUOTED = re.compile(r"`([^`]+)`")
MARKS = {
    "MET": "met",
    "NOT MET": "failed",
    "NOT TESTED": "open",
    "accept": "met",
    "warn": "warn",
    "reject": "failed",
    "failed": "failed",
    "identified": "dot",
    "weak": "half",
    "not determined": "ring",
    "CHANGED": "warn",
    "NO CHANGE SEEN": "met",
    "changed": "warn",
    "no change": "met",
    "not tested": "open",
    "A BETTER": "dot",
    "B BETTER": "dot",
}

SPRITE = """<svg class="sprite" aria-hidden="true">
<symbol id="mark-met" viewBox="0 0 16 16"><circle cx="8" cy="8" r="7" fill="currentColor"/>
<path d="M4.6 8.3 7 10.7 11.5 5.6" fill="none" stroke="var(--paper)" stroke-width="1.8"/></symbol>
<symbol id="mark-warn" viewBox="0 0 16 16"><path d="M8 1 15.5 14.5H.5Z" fill="currentColor"/>
<path d="M8 5.6V10M8 11.2V13" stroke="var(--paper)" stroke-width="1.8"/></symbol>
<symbol id="mark-failed" viewBox="0 0 16 16"><rect x="1" y="1" width="14" height="14" fill="currentColor"/>
<path d="M5 5 11 11M11 5 5 11" stroke="var(--paper)" stroke-width="1.8"/></symbol>
<symbol id="mark-open" viewBox="0 0 16 16"><circle cx="8" cy="8" r="6.2" fill="none" stroke="currentColor"
 stroke-width="1.6" stroke-dasharray="2.6 2.2"/></symbol>
<symbol id="mark-dot" viewBox="0 0 16 16"><circle cx="8" cy="8" r="4.4" fill="currentColor"/></symbol>
<symbol id="mark-half" viewBox="0 0 16 16"><circle cx="8" cy="8" r="4" fill="none" stroke="currentColor"
 stroke-width="1.5"/><path d="M8 4a4 4 0 0 0 0 8Z" fill="currentColor"/></symbol>
<symbol id="mark-ring" viewBox="0 0 16 16"><circle cx="8" cy="8" r="4" fill="none" stroke="currentColor"
 stroke-width="1.5"/></symbol>
</svg>"""


@dataclass(frozen=True)
class Section:
    """One numbered section. `finding` is one sentence in plain text; `warnings` (HTML) are never folded.

    `why`: the reason, where the body only says why there is nothing.
    """

    key: str
    number: int
    title: str
    question: str
    body: str
    finding: str = ""
    warnings: tuple[str, ...] = ()
    folded: bool = False
    why: str = ""


@dataclass
class Notes:
    """Notes under one table: each distinct reason gets a letter the first time it is asked for; `plain` ones none."""

    texts: list[str] = field(default_factory=list)
    plain: list[str] = field(default_factory=list)

    def missing(self, text: str) -> str:
        """A dash with the letter of its reason, as HTML."""
        if text not in self.texts:
            self.texts.append(text)
        return f'<span class="none">—</span><sup class="note">{_letter(self.texts.index(text))}</sup>'

    def html(self) -> str:
        """The notes, lettered ones first; nothing where there are none."""
        lines = [f"<li><sup>{_letter(k)}</sup> {prose(text)}</li>" for k, text in enumerate(self.texts)]
        lines += [f"<li>{prose(text)}</li>" for text in dict.fromkeys(self.plain)]
        return f'<ul class="notes">{"".join(lines)}</ul>' if lines else ""


def _letter(index: int) -> str:
    return chr(ord("a") + index) if index < 26 else str(index + 1)


def esc(text: Any) -> str:
    """Data-born text as HTML."""
    return escape(str(text))


def prose(text: Any) -> str:
    """A data-born sentence as HTML, with a capital and a full stop; what stands in back quotes is set as code."""
    return _QUOTED.sub(r"<code>\1</code>", esc(sentence(str(text))))


def mark(word: str) -> str:
    """The shape that goes with a word of state."""
    shape = MARKS.get(word, "open")
    return f'<svg class="mark {shape}" viewBox="0 0 16 16" aria-hidden="true"><use href="#mark-{shape}"/></svg>'


def status(word: str) -> str:
    """A state as its shape and its word."""
    return f'<span class="state {MARKS.get(word, "open")}">{mark(word)}{esc(word)}</span>'


def absent(what: str, why: str) -> str:
    """A sentence in place of something that isn't there."""
    return f'<p class="absent"><b>{esc(what)}</b> {prose(why)}</p>'


def sentence(text: str) -> str:
    """Text with a capital first, unless it begins with a symbol (σ) or the name of a thing (joint_2, a.mcap), and a
    full stop last."""
    text = text.strip()
    if not text:
        return ""
    first = text[0].upper() if _WORD.match(text) and not _GREEK <= text[0] <= _LAST_GREEK else text[0]
    return first + text[1:] + ("" if text[-1] in ".!?…" else ".")


def fold(title: str, body: str, finding: str = "") -> str:
    """A native fold; `title` and `finding` are plain text."""
    named = f"<b>{esc(title)}</b> " if title else ""
    found = f'<span class="finding">{esc(sentence(finding) if not title else finding)}</span>' if finding else ""
    return f"<details><summary>{named}{found}</summary><div>{body}</div></details>"


def warned(sentences: Sequence[str]) -> str:
    """Warnings (HTML), each with its mark; nothing where there are none."""
    shown = "".join(f"<li>{mark('warn')}<span>{text}</span></li>" for text in sentences)
    return f'<ul class="warnings">{shown}</ul>' if shown else ""


def figures(panels: Sequence[tuple[str, str, str]], columns: int = 2) -> str:
    """Small multiples: (title HTML, remark HTML, SVG) each."""
    cells = "".join(
        f"<figure><figcaption><b>{title}</b>{f'<span>{remark}</span>' if remark else ''}</figcaption>{svg}</figure>"
        for title, remark, svg in panels
    )
    return f'<div class="panels columns-{columns}">{cells}</div>'


def legend(*entries: tuple[str, str]) -> str:
    """A line of (swatch class, words)."""
    shown = "".join(f'<li><i class="swatch {kind}"></i>{esc(words)}</li>' for kind, words in entries)
    return f'<ul class="legend">{shown}</ul>'


def table(
    head: Sequence[tuple[str, str]], rows: Sequence[Sequence[str] | str], label: str, notes: Notes | None = None
) -> str:
    """A table of HTML cells. `head`: (title HTML, class of the column); a row that is a string is a subheading."""
    titles = "".join(f'<th scope="col" class="{kind}">{title}</th>' for title, kind in head)
    body = []
    for row in rows:
        if isinstance(row, str):
            body.append(f'<tr class="group"><th scope="rowgroup" colspan="{len(head)}">{row}</th></tr>')
            continue
        cells = [f'<td class="{kind}">{cell}</td>' for cell, (_, kind) in zip(row, head, strict=True)]
        cells[0] = f'<th scope="row" class="{head[0][1]}">{row[0]}</th>'
        body.append(f"<tr>{''.join(cells)}</tr>")
    short = " short" if len(rows) <= 12 else ""
    return (
        f'<div class="table{short}" role="region" tabindex="0" aria-label="{esc(label)}"><table>'
        f"<thead><tr>{titles}</tr></thead><tbody>{''.join(body)}</tbody></table></div>{notes.html() if notes else ''}"
    )


def unit(text: Any) -> str:
    """A unit as it stands in a table's head."""
    return f' <span class="unit">[{esc(text)}]</span>'


def listing(sentences: Sequence[Any], kind: str = "") -> str:
    """Sentences as a list."""
    return f'<ul class="{kind}">{"".join(f"<li>{prose(s)}</li>" for s in sentences)}</ul>' if sentences else ""
