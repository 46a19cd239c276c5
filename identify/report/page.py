"""The page: one self-contained HTML file from a record and its arrays."""

from __future__ import annotations

import json
import os
import re
import threading
import zipfile
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from identify.errors import InputError, OutputError
from identify.estimation.identification import CURVES, FORMAT, RECORD
from identify.report import data, evidence, friction, parameters, physics, prediction, residuals, verdict
from identify.report.drawing import drawing
from identify.report.markup import SPRITE, Section, esc, fold, prose, warned
from identify.report.record import Record, part, rejected

_STYLE = re.compile(r' style="([^"]*)"')
_UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


def render(record: dict[str, Any], curves: Mapping[str, np.ndarray]) -> str:
    """The report as HTML, a pure function of the record of `parameters.json` and the arrays of `curves.npz`.

    The page needs no network and no script, and equal input gives equal bytes. Missing values appear with the
    reason that stands beside them in the record.
    """
    clean: Record = printable(record)
    with drawing():
        sections = [
            verdict.section(clean),
            prediction.section(clean),
            prediction.curves_section(clean, curves),
            parameters.section(clean),
            friction.section(clean, curves),
            physics.section(clean),
            data.section(clean),
            evidence.models_section(clean),
            residuals.section(clean, curves),
            evidence.checks_section(clean),
            evidence.provenance_section(clean),
        ]
    name = part(clean, "robot", "name") or "robot"
    return sectioned(f"{name}: identified parameters", verdict.header(clean), sections, rejected(clean))


def sectioned(title: str, header: str, sections: Sequence[Section], brief: bool = False) -> str:
    """A whole page of a title (plain text), a header (HTML) and sections, with links to these; brief: those with
    nothing to show are told in one list."""
    links = "".join(f'<li><a href="#{s.key}">{s.title}</a></li>' for s in sections)
    main = (
        f'{SPRITE}\n<main>\n{header}\n<nav aria-label="Sections"><ol>{links}</ol></nav>\n'
        f"{_body(sections, brief)}\n</main>"
    )
    return document(title, main)


def document(title: str, body: str) -> str:
    """A whole self-contained page of a title (plain text) and a body (HTML)."""
    style = resources.files("identify.report").joinpath("style.css").read_text(encoding="utf-8")
    body, classes = _shared_styles(body)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n"
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{esc(title)}</title>\n<style>\n{style}{classes}</style>\n"
        f"</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def write(folder: str | os.PathLike[str]) -> Path:
    """Write `report.html` into a result folder from its `parameters.json` and `curves.npz`; return its path.

    The old report is replaced whole or not at all. Raises InputError where the folder holds no result,
    OutputError where the report can't be written.
    """
    folder = Path(folder)
    page = render(_read_record(folder), _read_curves(folder))
    path = folder / "report.html"
    partial = folder / f".report-{os.getpid()}-{threading.get_ident()}.html"
    try:
        partial.write_text(page, encoding="utf-8", newline="\n")
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise OutputError(f"{path}: can't be written ({error.strerror}); check the folder's permissions") from error
    return path


def _read_record(folder: Path) -> dict[str, Any]:
    path = folder / RECORD
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"{path}: not found; give a folder that `identify fit -o` has written") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: can't be read; run `identify fit` again") from error
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: not JSON at line {error.lineno}; run `identify fit` again") from error
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise InputError(f"{path}: its format is not {FORMAT}; run `identify fit` again")
    return record


def _read_curves(folder: Path) -> dict[str, np.ndarray]:
    """The arrays of curves.npz; none where there is no such file."""
    path = folder / CURVES
    if not path.exists():
        return {}
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not a file of arrays; run `identify fit` again") from error


def _body(sections: Sequence[Section], brief: bool) -> str:
    """All sections in order; where `brief`, those with nothing to show become lines of one list before the last."""
    empty = [s for s in sections if s.why] if brief else []
    shown = [section_html(s) for s in sections if s not in empty]
    rows = []
    for why in dict.fromkeys(s.why for s in empty):
        names = ", ".join(f'<span id="{s.key}">{s.number}\u00a0{esc(s.title)}</span>' for s in empty if s.why == why)
        rows.append(f"<li><b>{names}</b><span>{prose(why)}</span></li>")
    if rows:
        shown.insert(-1, f'<section><h2>Not made</h2><ul class="not-made">{"".join(rows)}</ul></section>')
    return "\n".join(shown)


def section_html(section: Section) -> str:
    """Heading and warnings always in sight; the body of a folded section behind its finding."""
    number, title, question = section.number, esc(section.title), esc(section.question)
    head = f'<h2><span class="number">{number}</span>{title} <small>{question}</small></h2>'
    shown = head + warned(section.warnings)
    shown += fold("", section.body, section.finding or "Details") if section.folded else section.body
    return f'<section id="{section.key}">{shown}</section>'


def _shared_styles(body: str) -> tuple[str, str]:
    """The body with every style that its drawings repeat as a short class, and the rules of these classes."""
    names: dict[str, str] = {}

    def named(match: re.Match[str]) -> str:
        return f' class="{names.setdefault(match.group(1), f"s{len(names)}")}"'

    body = _STYLE.sub(named, body)
    return body, "".join(f".{name} {{ {style} }}\n" for style, name in names.items())


def printable(value: Any) -> Any:
    """The record with every character that no page can hold replaced."""
    if isinstance(value, str):
        return _UNPRINTABLE.sub("�", value)
    if isinstance(value, Mapping):
        return {printable(str(k)): printable(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [printable(v) for v in value]
    return value
