"""What lies in a chunk, or one behind the other in the file: message records, found all at once where they can be."""

from __future__ import annotations

import io
import struct
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, McapRecord, Metadata, Schema

from identify.logs.damage import Damage

MESSAGE_HEAD = 31
"""Bytes before a message's payload: opcode, length, channel, sequence, log time, publish time."""
RECORD_HEAD = struct.Struct("<BQ")
MESSAGE = int(Opcode.MESSAGE)
# Plain numbers, as a member of an enumeration takes longer to look up than to compare.
DEFINITIONS: dict[int, type[McapRecord]] = {int(Opcode.SCHEMA): Schema, int(Opcode.CHANNEL): Channel}
KEPT: dict[int, type[McapRecord]] = {
    **DEFINITIONS,
    int(Opcode.METADATA): Metadata,
    int(Opcode.ATTACHMENT): Attachment,
}
UNREADABLE = (struct.error, ValueError, OverflowError, McapError, MemoryError)

_MOST_DEFINITIONS = 1 << 17
_MOST_RUNS = 1 << 22
_FEW_DEFINITIONS = 64
_STRIDE_GROWTH = 32


@dataclass(frozen=True, eq=False)
class Batch:
    """Neighbouring message records: content (bytes) uint8, offsets (k,) and lengths (k,) in it, heads included.

    chunk: the chunk record they come from, as it stands in the file; None for messages outside of chunks, or of one
    that is not sound. grid: (k, length) uint8, all of them as a view where they are of one length and nothing lies
    between them, else None. stop: the place in the file up to which they were read.
    """

    content: np.ndarray
    offsets: np.ndarray
    lengths: np.ndarray
    chunk: Chunk | None
    grid: np.ndarray | None
    stop: int

    @property
    def channels(self) -> np.ndarray:
        """(k,) uint16, the number of every message's channel."""
        return self._column("<u2", 9)

    @property
    def log_times(self) -> np.ndarray:
        """(k,) uint64, when every message was recorded [ns]."""
        return self._column("<u8", 15)

    def rows(self, which: np.ndarray, length: int) -> np.ndarray:
        """(m, length) uint8, the records at `which` (m,), all of one length."""
        return _at(self.content, f"V{length}", self.offsets[which]).view(np.uint8).reshape(-1, length)

    def payload(self, k: int) -> bytes:
        """The message of the k-th record."""
        start = int(self.offsets[k])
        return self.content[start + MESSAGE_HEAD : start + int(self.lengths[k])].tobytes()

    def _column(self, kind: str, place: int) -> np.ndarray:
        if self.grid is None:
            return _at(self.content, kind, self.offsets + place)
        return self.grid[:, place : place + np.dtype(kind).itemsize].view(kind)[:, 0]


@dataclass(frozen=True)
class Chunk:
    """A chunk record, whole: its bytes after opcode and length, times [ns], compression, unpacked and packed size."""

    body: bytes
    start: int
    stop: int
    compression: str
    size: int
    packed: int


def split(
    content: bytes | memoryview, at: int, seen: set[bytes], hints: np.ndarray | None, chunk: Chunk | None
) -> Iterator[Schema | Channel | Batch | Damage]:
    """Records that lie one behind the other: schemas, channels and messages.

    at: where the content begins in the file; seen: the schemas and channels that have come already; hints: where
    an index says that messages start.
    """
    view = np.frombuffer(content, dtype=np.uint8)
    reason, grid = "", None
    found = _by_grid(content, view) or (None if hints is None else _by_hints(view, hints))
    if found is None:
        offsets, lengths, others, reason = _by_walking(content, view)
    else:
        offsets, lengths, others, grid = found
    for here in others:
        opcode, length = RECORD_HEAD.unpack_from(content, here)
        record = bytes(content[here : here + RECORD_HEAD.size + length])
        # Every chunk may repeat them, and reading one takes as long as many messages.
        if record in seen:
            continue
        seen.add(record)
        yield read_record(opcode, record[RECORD_HEAD.size :], at)
    if len(offsets):
        stop = at if chunk is None else at + len(chunk.body)
        chunk = None if reason else chunk
        yield Batch(view, offsets, lengths, chunk, grid, stop)
    if reason:
        used = int(offsets[-1] + lengths[-1]) if len(offsets) else 0
        yield Damage(at, len(content) - used, reason)


_Found = tuple[np.ndarray, np.ndarray, list[int], np.ndarray | None]
"""Offsets and lengths of the messages, offsets of the definitions, and the messages' grid where they are one."""


def _by_grid(content: bytes | memoryview, view: np.ndarray) -> _Found | None:
    """Definitions, then messages of one length up to the end; None for anything else."""
    here, size = 0, len(content)
    others: list[int] = []
    while here + MESSAGE_HEAD <= size and len(others) < _FEW_DEFINITIONS:
        opcode, length = RECORD_HEAD.unpack_from(content, here)
        step = RECORD_HEAD.size + length
        if opcode in DEFINITIONS:
            others.append(here)
            here += step
            continue
        if opcode != MESSAGE or step < MESSAGE_HEAD or (size - here) % step:
            return None
        count = (size - here) // step
        grid = view[here:].reshape(count, step)
        if grid[:, : RECORD_HEAD.size].tobytes() != bytes(content[here : here + RECORD_HEAD.size]) * count:
            return None
        return np.arange(here, size, step), np.full(count, step), others, grid
    return None


def _by_hints(view: np.ndarray, hints: np.ndarray) -> _Found | None:
    """Offsets and lengths of the messages, and offsets of definitions; None unless they cover the content exactly.

    An index is no more than a hint: every record that it names is looked at, and every gap between them.
    """
    size = len(view)
    if not len(hints) or hints[-1] > size - MESSAGE_HEAD:
        return None
    offsets = hints.astype(np.int64)
    lengths = _at(view, "<u8", offsets + 1)
    if (view[offsets] != MESSAGE).any() or int(lengths.max()) > size or int(lengths.min()) < MESSAGE_HEAD - 9:
        return None
    lengths = lengths.astype(np.int64) + RECORD_HEAD.size
    ends = offsets + lengths
    starts = np.append(offsets[1:], size)
    gaps = np.flatnonzero(ends != starts)
    if len(gaps) > _MOST_DEFINITIONS:
        return None
    others: list[int] = []
    for here, stop in [(0, int(offsets[0])), *((int(ends[k]), int(starts[k])) for k in gaps)]:
        while here < stop:
            if here + RECORD_HEAD.size > stop or view[here] not in DEFINITIONS:
                return None
            others.append(here)
            here += RECORD_HEAD.size + int(view[here + 1 : here + 9].view("<u8")[0])
        if here != stop:
            return None
    return offsets, lengths, others, None


def _by_walking(content: bytes | memoryview, view: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[int], str]:
    """Offsets and lengths of the messages, offsets of definitions, and why the walk ended before its time, or ""."""
    offsets, lengths = array("q"), array("q")
    others: list[int] = []
    reason = ""
    here, size, runs = 0, len(content), 0
    while here < size:
        opcode, length = RECORD_HEAD.unpack_from(content, here) if here + RECORD_HEAD.size <= size else (0, 0)
        step = RECORD_HEAD.size + length
        if step > size - here or here + RECORD_HEAD.size > size:
            reason = "a chunk ends inside a record"
            break
        if opcode == MESSAGE and step >= MESSAGE_HEAD:
            count = _neighbours(view, here, step)
            if count == 1:
                offsets.append(here)
                lengths.append(step)
            else:
                offsets.frombytes(np.arange(here, here + step * count, step, dtype=np.int64).tobytes())
                lengths.frombytes(np.full(count, step, dtype=np.int64).tobytes())
            here += step * count
            runs += 1
            if runs < _MOST_RUNS:
                continue
            reason = "a chunk holds more messages than can be told apart without its index"
            break
        if opcode not in DEFINITIONS or len(others) == _MOST_DEFINITIONS:
            reason = "a chunk holds something else than messages"
            break
        others.append(here)
        here += step
    return np.array(offsets, dtype=np.int64), np.array(lengths, dtype=np.int64), others, reason


def _neighbours(view: np.ndarray, start: int, step: int) -> int:
    """How many message records of the same length follow one another from `start`, in growing strides."""
    room = (len(view) - start) // step
    head = view[start : start + RECORD_HEAD.size].tobytes()
    count = 1
    while count < room:
        here = start + count * step
        if view[here : here + RECORD_HEAD.size].tobytes() != head:
            break
        stride = min(_STRIDE_GROWTH * count, room - count)
        rows = view[here : here + stride * step].reshape(stride, step)
        same = (rows[:, 1:9].view("<u8")[:, 0] == step - RECORD_HEAD.size) & (rows[:, 0] == MESSAGE)
        if not same.all():
            return count + int(same.argmin())
        count += stride
    return count


def _at(view: np.ndarray, kind: str, offsets: np.ndarray) -> np.ndarray:
    """(k,) values of a dtype that start at these bytes, aligned or not."""
    dtype = np.dtype(kind)
    every = np.ndarray((len(view) - dtype.itemsize + 1,), dtype, view, strides=(1,))
    return every[offsets]


def read_record(opcode: int, body: bytes, at: int) -> Any:
    """The record of an opcode in KEPT, or the damage that its body, at this place in the file, is."""
    kind: Any = KEPT[opcode]
    try:
        return kind.read(ReadDataStream(io.BytesIO(body)))
    except UNREADABLE:
        return Damage(at, len(body), f"a {kind.__name__.lower()} record can't be read")
