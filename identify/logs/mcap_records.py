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
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Footer, Header, Metadata, Schema

from identify.logs.damage import Damage
from identify.logs.mcap_content import (
    DEFINITIONS,
    KEPT,
    MESSAGE,
    RECORD_HEAD,
    UNREADABLE,
    Batch,
    Chunk,
    read_record,
    split,
)

MAGIC = b"\x89MCAP0\r\n"
LARGEST_RECORD = 1 << 28
"""A chunk that unpacks to more bytes, or an attachment of more, is hostile or unusable, and is passed over."""

_CHUNK_HEAD = struct.Struct("<QQQII")
_LOOSE_BYTES = 1 << 20
_MOST_COMPRESSED = 512
_CHUNK, _MESSAGE_INDEX = int(Opcode.CHUNK), int(Opcode.MESSAGE_INDEX)
_DATA_END, _FOOTER, _HEADER = int(Opcode.DATA_END), int(Opcode.FOOTER), int(Opcode.HEADER)
_FOOTER_BYTES = 29
_COMPRESSED = re.compile(rb"\x04\0\0\0zstd|\x03\0\0\0lz4")
"""How a chunk names its compression, by which one is found again behind damage."""
_NAME_AT = RECORD_HEAD.size + _CHUNK_HEAD.size - 4
_ENDS = ((_DATA_END, 4), (_FOOTER, 20))
"""Records after which no message comes, and their lengths."""
_CHUNK_PEEK = 64

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
    except UNREADABLE:
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
        if opcode not in DEFINITIONS:
            return
        here = start + length
        item = read_record(opcode, content[start:here], start)
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
        is_message = opcode == MESSAGE and usable
        if loose and (not is_message or len(loose) > _LOOSE_BYTES):
            yield from split(bytes(loose), at, seen, None, None)
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
        elif opcode in KEPT and usable:
            yield read_record(opcode, stream.read(length), at)
        elif _agrees(length, stream.read(_CHUNK_PEEK)):
            lost = Damage(at, length, "a chunk is not marked as one, or claims more than 256 MiB")
        elif opcode in (_CHUNK, MESSAGE, _DATA_END, _FOOTER):
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
    yield from split(content, at, seen, hints, Chunk(body, start, stop, compression, size, length))


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
