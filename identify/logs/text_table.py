"""Columns of a delimited text file, whatever state its rows are in.

A row that can't be used keeps its place and becomes NaN, since in a table without time the place is the
time. Lines that start with # and empty lines are passed over.
"""

from __future__ import annotations

import csv
import itertools
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identify.errors import LogError
from identify.logs.wording import printable

OTHER_LENGTH, NO_NUMBER, CUT = (
    "of another length",
    "that hold something else than numbers",
    "cut at the end of the file",
)
"""Why a row could not be used."""

_BLOCK_LINES = 1 << 14
_LOOK_AHEAD = 64
_NAMES_SHOWN = 12


@dataclass(frozen=True)
class Shape:
    """How the text is laid out.

    delimiter: None for blanks; header: the names of the columns, or (); width: columns of most rows; skip: how
    many lines come before the rows, comments not counted.
    """

    delimiter: str | None
    header: tuple[str, ...]
    width: int
    skip: int


def read_shape(path: Path) -> Shape:
    """Delimiter, header and width, from the first lines. Raises LogError where the file holds no rows."""
    start = list(itertools.islice(_lines(path), _LOOK_AHEAD))
    rows = [line for line in start if not _is_comment(line)]
    if not rows:
        raise LogError(f"{path}: holds no rows; record again, or check the name")
    if "\0" in rows[0] or "\ufffd" in rows[0]:
        raise LogError(f"{path}: is not a text table; logs may be MCAP, CSV, TSV or NPZ")
    delimiter = _delimiter(rows[0], rows[-1])
    header = tuple(split(rows[0], delimiter))
    skip = 0 if all(_is_number(cell) for cell in header) else 1
    rows = rows[skip:]
    if not rows:
        raise LogError(f"{path}: has a header and no rows; record again, or check the name")
    widths = Counter(len(split(row, delimiter)) for row in rows)
    width = max(widths, key=lambda value: (widths[value], value == len(header)))
    if not skip:
        header = _commented_header(start, delimiter, width)
    elif width != len(header):
        raise LogError(f"{path}: its header names {len(header)} columns and its rows hold {width}; mend the header")
    return Shape(delimiter, header, width, skip)


def read_columns(path: Path, shape: Shape, wanted: Sequence[str | int]) -> tuple[np.ndarray, dict[str, int]]:
    """(N, k) the wanted columns, by name or by number from 0, and how many rows are unusable, by reason.

    Empty cells are NaN. Raises LogError where a column is not there.
    """
    indices = [_index(path, shape, column) for column in wanted]
    rows = itertools.islice((line for line in _lines(path) if not _is_comment(line)), shape.skip, None)
    faults: Counter[str] = Counter()
    blocks = [np.empty((0, len(indices)))]
    while block := list(itertools.islice(rows, _BLOCK_LINES)):
        values = _clean_block(block, shape, indices)
        blocks.append(_any_block(block, shape, indices, faults) if values is None else values)
    return np.concatenate(blocks), dict(faults)


def split(line: str, delimiter: str | None) -> list[str]:
    """The cells of a line, without the blanks and quotes around them."""
    if delimiter is None:
        return [cell.strip('"') for cell in line.split()]
    if '"' in line:
        try:
            return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))]
        except csv.Error:
            pass
    return [cell.strip() for cell in line.split(delimiter)]


def _lines(path: Path) -> Iterator[str]:
    """Lines that are not empty."""
    with open(path, encoding="utf-8-sig", errors="replace") as stream:
        yield from (line for line in stream if not line.isspace())


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith("#")


def _is_number(cell: str) -> bool:
    try:
        float(cell or "nan")
    except ValueError:
        return False
    return True


def _delimiter(first: str, last: str) -> str | None:
    """The one of tab, semicolon and comma that both lines hold; None for blanks."""
    for delimiter in "\t;,":
        if delimiter in first and delimiter in last:
            return delimiter
    for delimiter in "\t;,":
        if delimiter in first:
            return delimiter
    return None


def _commented_header(start: list[str], delimiter: str | None, width: int) -> tuple[str, ...]:
    """The names in the last comment before the rows, as some programs write them; () where there are none."""
    comments = list(itertools.takewhile(_is_comment, start))
    names = split(comments[-1].strip().lstrip("#"), delimiter) if comments else []
    return tuple(names) if len(names) == width and not all(_is_number(name) for name in names) else ()


def _index(path: Path, shape: Shape, column: str | int) -> int:
    if isinstance(column, int):
        if column < shape.width:
            return column
        raise LogError(f"{path}: has {shape.width} columns, numbered from 0, and the map asks for column {column}")
    if not shape.header:
        raise LogError(
            f"{path}: has {shape.width} columns and no header, so {column!r} can't be found; "
            "number them from 0 in the map"
        )
    found = [number for number, name in enumerate(shape.header) if name == column]
    if len(found) == 1:
        return found[0]
    shown = printable(", ".join(shape.header[:_NAMES_SHOWN])) + (", …" if len(shape.header) > _NAMES_SHOWN else "")
    problem = "more than one column is named" if found else "has no column"
    raise LogError(f"{path}: {problem} {column!r}; its {len(shape.header)} columns are {shown}")


def _clean_block(block: list[str], shape: Shape, indices: list[int]) -> np.ndarray | None:
    """The wanted columns of rows that are all in order; None where one is not."""
    delimiter = shape.delimiter
    if delimiter is None:
        regular = all(len(line.split()) == shape.width for line in block)
    else:
        regular = all(line.count(delimiter) == shape.width - 1 for line in block)
    if not regular:
        return None
    try:
        return np.loadtxt(block, delimiter=delimiter, usecols=indices, comments=None, ndmin=2)
    except ValueError:
        return None


def _any_block(block: list[str], shape: Shape, indices: list[int], faults: Counter[str]) -> np.ndarray:
    """The wanted columns row by row: NaN for a row that can't be used, counted by its reason."""
    unusable = [np.nan] * len(indices)
    values = []
    for line in block:
        cells = split(line, shape.delimiter)
        regular = len(cells) == shape.width
        row = _numbers([cells[index] for index in indices]) if regular else None
        if row is None and not line.endswith("\n"):
            faults[CUT] += 1
            continue
        if row is None:
            faults[NO_NUMBER if regular else OTHER_LENGTH] += 1
        values.append(unusable if row is None else row)
    return np.array(values, dtype=float).reshape(-1, len(indices))


def _numbers(cells: list[str]) -> list[float] | None:
    try:
        return [float(cell.replace(",", ".")) if cell else np.nan for cell in cells]
    except ValueError:
        return None
