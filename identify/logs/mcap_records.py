"""An MCAP file as a stream of what matters, whole records only, whatever state the file is in.

It is read front to back without its index, so that a file that was cut, or whose index is missing or
wrong, gives back every complete chunk; what could not be used comes as Damage. Memory does not grow with
the file. Format: the MCAP specification, version 0.
"""

from __future__ import annotations

import io
import itertools
import os
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, McapRecord, Metadata, Schema

MAGIC = b"\x89MCAP0\r\n"
MESSAGE_HEAD = 31
"""Bytes before a message's payload: opcode, length, channel, sequence, log time, publish time."""

_RECORD_HEAD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQII")
_LOOSE_BYTES = 1 << 20
_STRIDE_GROWTH = 32
_LARGEST_CHUNK = 1 << 30
_KEPT: dict[int, type[McapRecord]] = {
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
}


@dataclass(frozen=True, eq=False)
class Messages:
    """Message records of one length, heads included: rows (k, length) uint8 and their places (k,) in file order."""

    rows: np.ndarray
    places: np.ndarray

    def by_channel(self) -> Iterator[tuple[int, Messages]]:
        """The messages of one channel after the other, with its number."""
        channels = self.rows[:, 9:11].view("<u2")[:, 0]
        if (channels == channels[0]).all():
            yield int(channels[0]), self
            return
        for number in np.unique(channels):
            mine = channels == number
            yield int(number), Messages(self.rows[mine], self.places[mine])

    @property
    def log_times(self) -> np.ndarray:
        """(k,) int64, when every message was recorded [ns]."""
        return self.rows[:, 15:23].view("<u8")[:, 0].astype(np.int64)

    @property
    def payloads(self) -> np.ndarray:
        """(k, length - MESSAGE_HEAD) uint8, the messages themselves."""
        return self.rows[:, MESSAGE_HEAD:]


@dataclass(frozen=True)
class Damage:
    """Bytes that could not be used: where they start, how many, why, and the log times they span where known [ns].

    `cut`: the file ends there, before its time.
    """

    offset: int
    lost_bytes: int
    reason: str
    span: tuple[int, int] | None = None
    cut: bool = False


Item = Schema | Channel | Metadata | Attachment | Messages | Damage


def is_mcap(path: Path) -> bool:
    """Whether the file starts as every MCAP does."""
    with open(path, "rb") as stream:
        return stream.read(len(MAGIC)) == MAGIC


def records(path: Path) -> Iterator[Item]:
    """Schemas, channels, metadata, attachments and messages of an MCAP file in order, and what is damaged."""
    size = os.path.getsize(path)
    with open(path, "rb", buffering=_LOOSE_BYTES) as stream:
        stream.seek(len(MAGIC))
        cut = False
        for item in _data_section(stream, size):
            cut |= isinstance(item, Damage) and item.cut
            yield item
        stream.seek(max(0, size - len(MAGIC)))
        if not cut and stream.read() != MAGIC:
            yield Damage(size, 0, "its index at the end is incomplete")


def _data_section(stream: BinaryIO, size: int) -> Iterator[Item]:
    decompress = _decompressors()
    loose = bytearray()
    seen: set[bytes] = set()
    at = stream.tell()
    for number in itertools.count():
        head = stream.read(_RECORD_HEAD.size)
        opcode, length = _RECORD_HEAD.unpack(head) if len(head) == _RECORD_HEAD.size else (0, 0)
        complete = opcode > 0 and length <= size - at - _RECORD_HEAD.size
        is_message = opcode == Opcode.MESSAGE and complete
        if loose and (not is_message or len(loose) > _LOOSE_BYTES):
            yield from _split(bytes(loose), at, number, seen)
            loose.clear()
        if not complete:
            yield _end_of_file(stream, at, size, opcode, head)
            return
        if opcode == Opcode.DATA_END:
            return
        if is_message:
            loose += head + stream.read(length)
        elif opcode == Opcode.CHUNK:
            yield from _chunk(stream.read(length), at, number, decompress, seen)
        elif opcode in _KEPT:
            yield _record(opcode, stream.read(length), at)
        else:
            stream.seek(length, os.SEEK_CUR)
        at += _RECORD_HEAD.size + length


def _end_of_file(stream: BinaryIO, at: int, size: int, opcode: int, head: bytes) -> Damage:
    """What is to be said where no whole record follows."""
    lost = size - at
    if not lost:
        return Damage(at, 0, "it ends without its end record", cut=True)
    if opcode == 0 and len(head) == _RECORD_HEAD.size:
        return Damage(at, lost, "no record starts there")
    body = stream.read(_CHUNK_HEAD.size) if opcode == Opcode.CHUNK else b""
    if len(body) < _CHUNK_HEAD.size:
        return Damage(at, lost, "it ends inside a record", cut=True)
    start, stop, *_ = _CHUNK_HEAD.unpack(body)
    return Damage(at, lost, "it ends inside a chunk", (start, stop), cut=True)


def _chunk(
    body: bytes, at: int, number: int, decompress: dict[str, Callable[[bytes, int], bytes]], seen: set[bytes]
) -> Iterator[Item]:
    """What a chunk record holds; Damage where it can't be unpacked or its checksum is wrong."""
    span = None
    try:
        start, stop, size, checksum, name_length = _CHUNK_HEAD.unpack_from(body)
        span = (start, stop)
        name_end = _CHUNK_HEAD.size + name_length
        compression = body[_CHUNK_HEAD.size : name_end].decode()
        (length,) = struct.unpack_from("<Q", body, name_end)
        data = body[name_end + 8 : name_end + 8 + length]
        if compression not in decompress:
            raise ValueError(f"compression {compression!r} is unknown")
        if size > _LARGEST_CHUNK:
            raise ValueError("it claims more than 1 GiB")
        content = decompress[compression](data, size)
        if len(content) != size:
            raise ValueError("it unpacks to another size than it says")
        if checksum and zlib.crc32(content) != checksum:
            raise ValueError("its checksum is wrong")
    except (struct.error, ValueError, RuntimeError, MemoryError) as error:
        yield Damage(at, len(body), f"a chunk can't be unpacked: {error}", span)
        return
    yield from _split(content, at, number, seen)


def _split(content: bytes, at: int, number: int, seen: set[bytes]) -> Iterator[Item]:
    """Records that lie one behind the other: schemas and channels, then the messages in groups of one length.

    at: where the content begins in the file; number: how many records of the file come before it; seen: the
    schemas and channels that have come already.
    """
    # length → runs (offset, count) of neighbours
    runs: dict[int, list[tuple[int, int]]] = {}
    view = np.frombuffer(content, dtype=np.uint8)
    here = 0
    while here < len(content):
        if here + _RECORD_HEAD.size > len(content):
            yield Damage(at, len(content) - here, "a chunk ends inside a record")
            break
        opcode, length = _RECORD_HEAD.unpack_from(content, here)
        step = _RECORD_HEAD.size + length
        if step > len(content) - here:
            yield Damage(at, len(content) - here, "a chunk ends inside a record")
            break
        if opcode == Opcode.MESSAGE and step >= MESSAGE_HEAD:
            count = _neighbours(content, view, here, step)
            runs.setdefault(step, []).append((here, count))
            here += step * count
            continue
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            body = content[here + _RECORD_HEAD.size : here + step]
            # Every chunk may repeat them, and reading one takes as long as many messages.
            if body not in seen:
                seen.add(body)
                yield _record(opcode, body, at)
        here += step
    for step, pieces in runs.items():
        places = np.concatenate([start + step * np.arange(count) for start, count in pieces])
        if len(pieces) == 1:
            rows = view[places[0] : places[-1] + step].reshape(-1, step)
        else:
            rows = view[places[:, None] + np.arange(step)]
        yield Messages(rows, (number << _LARGEST_CHUNK.bit_length()) + places)


def _neighbours(content: bytes, view: np.ndarray, start: int, step: int) -> int:
    """How many message records of the same length follow one another from `start`, in growing strides."""
    head = content[start : start + _RECORD_HEAD.size]
    room = (len(content) - start) // step
    count = 1
    while count < room:
        here = start + count * step
        if content[here : here + _RECORD_HEAD.size] != head:
            break
        stride = min(_STRIDE_GROWTH * count, room - count)
        rows = view[here : here + stride * step].reshape(stride, step)
        same = (rows[:, 1:9].view("<u8")[:, 0] == step - _RECORD_HEAD.size) & (rows[:, 0] == Opcode.MESSAGE)
        if not same.all():
            return count + int(same.argmin())
        count += stride
    return count


def _record(opcode: int, body: bytes, at: int) -> Item:
    kind: Any = _KEPT[opcode]
    try:
        return kind.read(ReadDataStream(io.BytesIO(body)))
    except (struct.error, ValueError, OverflowError, McapError, MemoryError):
        return Damage(at, len(body), f"a {kind.__name__.lower()} record can't be read")


def _decompressors() -> dict[str, Callable[[bytes, int], bytes]]:
    import lz4.frame
    import zstandard

    unpack = zstandard.ZstdDecompressor()

    def zstd(data: bytes, size: int) -> bytes:
        try:
            # The frame's own word on its size is what would be allocated.
            if zstandard.frame_content_size(data) > size:
                raise ValueError("it unpacks to another size than it says")
            return unpack.decompress(data, max_output_size=size) if size else b""
        except zstandard.ZstdError as error:
            raise ValueError(str(error)) from error

    def lz4_frame(data: bytes, size: int) -> bytes:
        return lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size)

    return {"": lambda data, _: data, "zstd": zstd, "lz4": lz4_frame}
