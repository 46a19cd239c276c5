"""An MCAP file as a stream of what matters, whole records only, whatever state the file is in.

It is read front to back without the index at its end, so that a file that was cut, or whose index is missing
or wrong, gives back every complete chunk; what could not be used comes as Damage. Memory does not grow with
the file. Format: the MCAP specification, version 0.
"""

from __future__ import annotations

import io
import os
import re
import struct
import zlib
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Footer, Header, McapRecord, Metadata, Schema

from identify.logs.damage import Damage

MAGIC = b"\x89MCAP0\r\n"
MESSAGE_HEAD = 31
"""Bytes before a message's payload: opcode, length, channel, sequence, log time, publish time."""
RECORD_HEAD = struct.Struct("<BQ")
LARGEST_RECORD = 1 << 28
"""A chunk that unpacks to more bytes, or an attachment of more, is hostile or unusable, and is passed over."""

_CHUNK_HEAD = struct.Struct("<QQQII")
_LOOSE_BYTES = 1 << 20
_MOST_COMPRESSED = 512
_MOST_DEFINITIONS = 1 << 17
_MOST_RUNS = 1 << 22
# Plain numbers, as a member of an enumeration takes longer to look up than to compare.
_MESSAGE, _CHUNK, _MESSAGE_INDEX = int(Opcode.MESSAGE), int(Opcode.CHUNK), int(Opcode.MESSAGE_INDEX)
_DATA_END, _FOOTER, _HEADER = int(Opcode.DATA_END), int(Opcode.FOOTER), int(Opcode.HEADER)
_FOOTER_BYTES = 29
_DEFINITIONS: dict[int, type[McapRecord]] = {int(Opcode.SCHEMA): Schema, int(Opcode.CHANNEL): Channel}
_KEPT: dict[int, type[McapRecord]] = {
    **_DEFINITIONS,
    int(Opcode.METADATA): Metadata,
    int(Opcode.ATTACHMENT): Attachment,
}
_UNREADABLE = (struct.error, ValueError, OverflowError, McapError, MemoryError)
_COMPRESSED = re.compile(rb"\x04\0\0\0zstd|\x03\0\0\0lz4")
"""How a chunk names its compression, by which one is found again behind damage."""
_NAME_AT = RECORD_HEAD.size + _CHUNK_HEAD.size - 4
_ENDS = ((_DATA_END, 4), (_FOOTER, 20))
"""Records after which no message comes, and their lengths."""
_CHUNK_PEEK = 64
_FEW_DEFINITIONS = 64
_STRIDE_GROWTH = 32


@dataclass(frozen=True, eq=False)
class Batch:
    """Neighbouring message records: content (bytes) uint8, offsets (k,) and lengths (k,) in it, heads included.

    chunk: the chunk record they come from, as it stands in the file; None for messages outside of chunks, or of one
    that is not sound. grid: (k, length) uint8, all
    of them as a view where they are of one length and nothing lies between them, else None. stop: the place in
    the file up to which they were read.
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


Item = Schema | Channel | Metadata | Attachment | Batch | Damage


def is_mcap(path: Path) -> bool:
    """Whether the file starts as every MCAP does."""
    with open(path, "rb") as stream:
        return stream.read(len(MAGIC)) == MAGIC


def profile(path: Path) -> str:
    """What the file's header says its messages are for; "" where there is none."""
    with open(path, "rb") as stream:
        stream.seek(len(MAGIC))
        body = _body(stream, _HEADER)
    try:
        return Header.read(ReadDataStream(io.BytesIO(body))).profile
    except _UNREADABLE:
        return ""


def records(path: Path) -> Iterator[Item]:
    """Schemas, channels, metadata, attachments and messages of an MCAP file in order, and what is damaged.

    What the index at the end repeats of schemas and channels comes first: the chunk that held them may be lost.
    """
    size = os.path.getsize(path)
    with open(path, "rb", buffering=_LOOSE_BYTES) as stream:
        yield from _summary(stream, size)
        stream.seek(len(MAGIC))
        cut = False
        for item in _data_section(stream, size):
            cut |= isinstance(item, Damage) and item.cut
            yield item
        stream.seek(max(0, size - len(MAGIC)))
        if not cut and stream.read() != MAGIC:
            yield Damage(size, 0, "its index at the end is incomplete")


def _body(stream: BinaryIO, opcode: int) -> bytes:
    """What the record at this place of the stream holds; nothing where it is of another kind, or too long."""
    head = stream.read(RECORD_HEAD.size)
    found, length = RECORD_HEAD.unpack(head) if len(head) == RECORD_HEAD.size else (0, 0)
    return stream.read(length) if found == opcode and length < _LOOSE_BYTES else b""


def _summary(stream: BinaryIO, size: int) -> Iterator[Schema | Channel]:
    """Schemas and channels of the index at the end, where it is whole and its checksum is right."""
    stream.seek(max(0, size - _FOOTER_BYTES - len(MAGIC)))
    tail = stream.read()
    if tail[-len(MAGIC) :] != MAGIC or tail[: RECORD_HEAD.size] != RECORD_HEAD.pack(_FOOTER, _FOOTER_BYTES - 9):
        return
    footer = Footer.read(ReadDataStream(io.BytesIO(tail[RECORD_HEAD.size :])))
    length = size - _FOOTER_BYTES - len(MAGIC) - footer.summary_start
    if not footer.summary_start or not 0 < length < LARGEST_RECORD:
        return
    stream.seek(footer.summary_start)
    content = stream.read(length)
    # The specification: over the summary and the footer up to the checksum itself.
    if footer.summary_crc and zlib.crc32(tail[: _FOOTER_BYTES - 4], zlib.crc32(content)) != footer.summary_crc:
        return
    here = 0
    while here + RECORD_HEAD.size <= len(content):
        opcode, length = RECORD_HEAD.unpack_from(content, here)
        start = here + RECORD_HEAD.size
        if opcode not in _DEFINITIONS:
            return
        here = start + length
        item = _record(opcode, content[start:here], start)
        if isinstance(item, Damage):
            return
        yield item


def _data_section(stream: BinaryIO, size: int) -> Iterator[Item]:
    decompress = _decompressors()
    loose = bytearray()
    seen: set[bytes] = set()
    barren = False
    at = stream.tell()
    head = stream.read(RECORD_HEAD.size)
    while True:
        opcode, length = RECORD_HEAD.unpack(head) if len(head) == RECORD_HEAD.size else (0, 0)
        after = at + RECORD_HEAD.size + length
        complete = opcode > 0 and after <= size
        usable = complete and length < LARGEST_RECORD
        is_message = opcode == _MESSAGE and usable
        if loose and (not is_message or len(loose) > _LOOSE_BYTES):
            yield from _split(bytes(loose), at, seen, None, None)
            loose.clear()
        if complete and (opcode, length) in _ENDS:
            return
        lost: Damage | None = None
        adrift = False
        here, head = head, b""
        if not complete:
            lost, adrift = _end_of_file(stream, at, size, opcode, here), True
        elif is_message:
            loose += here + stream.read(length)
        elif opcode == _CHUNK and usable:
            body = stream.read(length)
            hints, after, head = _indices(stream, after, size)
            if _agrees(length, body):
                yield from _chunk(body, at, decompress, seen, hints)
            else:
                lost, adrift = Damage(at, length, "a chunk's lengths do not agree"), True
        elif opcode in _KEPT and usable:
            yield _record(opcode, stream.read(length), at)
        elif _agrees(length, stream.read(_CHUNK_PEEK)):
            lost = Damage(at, length, "a chunk is not marked as one, or claims more than 256 MiB")
        elif opcode in (_CHUNK, _MESSAGE, _DATA_END, _FOOTER):
            lost, adrift = Damage(at, length, "a record has a length that it can't have"), True
        if adrift and lost is not None:
            # What claims to go far may have swallowed what is sound, and what claims too little leads nowhere.
            found = None if barren else _next_chunk(stream, at + 1, size)
            barren = found is None
            if found is not None:
                lost, after, head = Damage(at, found - at, lost.reason, lost.span), found, b""
            elif not complete:
                yield lost
                return
        if lost is not None:
            yield lost
        stream.seek(after + len(head))
        at = after
        head = head or stream.read(RECORD_HEAD.size)


def _agrees(length: int, body: bytes) -> bool:
    """Whether a record of this length, whose first bytes are given, holds a chunk by the lengths in it."""
    if len(body) < _CHUNK_HEAD.size + 8:
        return False
    (name,) = struct.unpack_from("<I", body, _CHUNK_HEAD.size - 4)
    if len(body) < _CHUNK_HEAD.size + name + 8:
        return False
    (packed,) = struct.unpack_from("<Q", body, _CHUNK_HEAD.size + name)
    return length == _CHUNK_HEAD.size + name + 8 + packed


def _next_chunk(stream: BinaryIO, start: int, stop: int) -> int | None:
    """Where between start and stop the first compressed chunk begins whose lengths agree with each other."""
    step = _LOOSE_BYTES
    for window in range(start, stop, step):
        stream.seek(window)
        # Windows overlap, so that no head is cut in two.
        data = stream.read(step + _CHUNK_PEEK + RECORD_HEAD.size)
        places = sorted(found.start() - _NAME_AT for found in _COMPRESSED.finditer(data) if found.start() >= _NAME_AT)
        for place in places:
            opcode, length = RECORD_HEAD.unpack_from(data, place)
            start_of_body = place + RECORD_HEAD.size
            if opcode == _CHUNK and _agrees(length, data[start_of_body : start_of_body + _CHUNK_PEEK]):
                return window + place
    return None


def _indices(stream: BinaryIO, at: int, size: int) -> tuple[np.ndarray | None, int, bytes]:
    """Where the message indices behind a chunk say its messages start, in order; what follows them, and its head."""
    found: list[np.ndarray] = []
    while True:
        head = stream.read(RECORD_HEAD.size)
        opcode, length = RECORD_HEAD.unpack(head) if len(head) == RECORD_HEAD.size else (0, 0)
        if opcode != _MESSAGE_INDEX or length > min(size - at - RECORD_HEAD.size, LARGEST_RECORD):
            break
        body = stream.read(length)
        if length < 6 or body[2:6] != (length - 6).to_bytes(4, "little") or (length - 6) % 16:
            break
        at += RECORD_HEAD.size + length
        if length > 6:
            found.append(np.frombuffer(body, "<u8", offset=6)[1::2])
    if not found:
        return None, at, head
    hints = found[0] if len(found) == 1 else np.concatenate(found)
    return (hints if (hints[1:] > hints[:-1]).all() else np.unique(hints)), at, head


def _end_of_file(stream: BinaryIO, at: int, size: int, opcode: int, head: bytes) -> Damage:
    """What is to be said where no whole record follows."""
    lost = size - at
    if not lost:
        return Damage(at, 0, "it ends without its end record", cut=True)
    if opcode == 0 and len(head) == RECORD_HEAD.size:
        return Damage(at, lost, "no record starts there")
    body = stream.read(_CHUNK_HEAD.size) if opcode == _CHUNK else b""
    if len(body) < _CHUNK_HEAD.size:
        return Damage(at, lost, "it ends inside a record", cut=True)
    start, stop, *_ = _CHUNK_HEAD.unpack(body)
    return Damage(at, lost, "it ends inside a chunk", (start, stop), cut=True)


def _chunk(
    body: bytes,
    at: int,
    decompress: dict[str, Callable[[memoryview, int], bytes]],
    seen: set[bytes],
    hints: np.ndarray | None,
) -> Iterator[Item]:
    """What a chunk record holds; Damage where it can't be unpacked or its checksum is wrong."""
    span = None
    try:
        start, stop, size, checksum, name_length = _CHUNK_HEAD.unpack_from(body)
        span = (start, stop)
        name_end = _CHUNK_HEAD.size + name_length
        compression = body[_CHUNK_HEAD.size : name_end].decode()
        (length,) = struct.unpack_from("<Q", body, name_end)
        data = memoryview(body)[name_end + 8 : name_end + 8 + length]
        if compression not in decompress:
            raise ValueError(f"compression {compression!r} is unknown")
        if size > LARGEST_RECORD:
            raise ValueError("it claims more than 256 MiB")
        if size > _LOOSE_BYTES and size > _MOST_COMPRESSED * len(data):
            raise ValueError("it claims to be packed more tightly than joint states can be")
        content = decompress[compression](data, size)
        if len(content) != size:
            raise ValueError("it unpacks to another size than it says")
        if checksum and zlib.crc32(content) != checksum:
            raise ValueError("its checksum is wrong")
    except (struct.error, ValueError, RuntimeError, MemoryError) as error:
        yield Damage(at, len(body), f"a chunk can't be unpacked: {error}", span)
        return
    yield from _split(content, at, seen, hints, Chunk(body, start, stop, compression, size, length))


def _split(
    content: bytes | memoryview, at: int, seen: set[bytes], hints: np.ndarray | None, chunk: Chunk | None
) -> Iterator[Item]:
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
        yield _record(opcode, record[RECORD_HEAD.size :], at)
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
        if opcode in _DEFINITIONS:
            others.append(here)
            here += step
            continue
        if opcode != _MESSAGE or step < MESSAGE_HEAD or (size - here) % step:
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
    if (view[offsets] != _MESSAGE).any() or int(lengths.max()) > size or int(lengths.min()) < MESSAGE_HEAD - 9:
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
            if here + RECORD_HEAD.size > stop or view[here] not in _DEFINITIONS:
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
        if opcode == _MESSAGE and step >= MESSAGE_HEAD:
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
        if opcode not in _DEFINITIONS or len(others) == _MOST_DEFINITIONS:
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
        same = (rows[:, 1:9].view("<u8")[:, 0] == step - RECORD_HEAD.size) & (rows[:, 0] == _MESSAGE)
        if not same.all():
            return count + int(same.argmin())
        count += stride
    return count


def _at(view: np.ndarray, kind: str, offsets: np.ndarray) -> np.ndarray:
    """(k,) values of a dtype that start at these bytes, aligned or not."""
    dtype = np.dtype(kind)
    every = np.ndarray((len(view) - dtype.itemsize + 1,), dtype, view, strides=(1,))
    return every[offsets]


def _record(opcode: int, body: bytes, at: int) -> Any:
    kind: Any = _KEPT[opcode]
    try:
        return kind.read(ReadDataStream(io.BytesIO(body)))
    except _UNREADABLE:
        return Damage(at, len(body), f"a {kind.__name__.lower()} record can't be read")


def _decompressors() -> dict[str, Callable[[memoryview, int], Any]]:
    import lz4.frame
    import zstandard

    unpack = zstandard.ZstdDecompressor()

    def zstd(data: memoryview, size: int) -> bytes:
        try:
            # The frame's own word on its size is what would be allocated.
            if zstandard.frame_content_size(data) > size:
                raise ValueError("it unpacks to another size than it says")
            return unpack.decompress(data, max_output_size=size) if size else b""
        except zstandard.ZstdError as error:
            raise ValueError(str(error)) from error

    def lz4_frame(data: memoryview, size: int) -> bytes:
        return lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size) if size else b""

    return {"": lambda data, _: data, "zstd": zstd, "lz4": lz4_frame}
