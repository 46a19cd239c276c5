"""A damaged MCAP file made whole again: every message that can be read, bit by bit, and what was lost."""

from __future__ import annotations

import os
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Attachment, Channel, Metadata, Schema

from identify.errors import LogError
from identify.logs.damage import Damage, describe
from identify.logs.files import replacing
from identify.logs.mcap_content import Batch
from identify.logs.mcap_file import McapFile
from identify.logs.mcap_records import is_mcap, profile, records
from identify.logs.wording import counted, printable


@dataclass(frozen=True)
class Recovered:
    """What was saved: messages by topic, their first and last log time [ns], and sentences on what was lost."""

    topics: dict[str, int]
    first: int
    last: int
    lost: tuple[str, ...]

    @property
    def messages(self) -> int:
        """How many were saved."""
        return sum(self.topics.values())

    @property
    def duration(self) -> float:
        """Time between the first and the last message [s]."""
        return (self.last - self.first) / 1e9


def recover(path: str | os.PathLike[str], output: str | os.PathLike[str]) -> Recovered:
    """Write all that can be read of the MCAP file at `path` to `output`, whole or not at all.

    Sound chunks are copied as they are; messages outside of chunks, or from a chunk that ends too early, get
    chunks of their own. Schemas, channels, attachments and metadata come along. Raises LogError where `path` is
    no MCAP file or nothing of it can be read, OutputError where `output` can't be written.
    """
    path = Path(path)
    if not path.is_file():
        raise LogError(f"{path}: there is no such file; check the name of the log")
    if not is_mcap(path):
        raise LogError(f"{path}: is not an MCAP file, and of a table every row that is sound is read anyway")
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    damages: list[Damage] = []
    counts: dict[str, int] = {}
    span: tuple[int, int] | None = None
    strangers = 0
    # Never by way of output + ".partial", which is what is recovered more often than not.
    with replacing(output) as stream:
        file = McapFile(stream, profile(path))
        for item in records(path):
            match item:
                case Schema() if schemas.get(item.id) != item:
                    schemas[item.id] = item
                    file.define(item)
                case Channel() if channels.get(item.id) != item:
                    channels[item.id] = item
                    file.define(item)
                case Metadata():
                    file.metadata(item)
                case Attachment():
                    file.attachment(item)
                case Damage():
                    damages.append(item)
                case Batch():
                    known = np.isin(item.channels, list(channels))
                    strangers += int((~known).sum())
                    if not known.any():
                        continue
                    own = _write(file, item, known)
                    span = own if span is None else (min(span[0], own[0]), max(span[1], own[1]))
                    for number, count in zip(*np.unique(item.channels[known], return_counts=True), strict=True):
                        topic = channels[int(number)].topic
                        counts[topic] = counts.get(topic, 0) + int(count)
        if span is None:
            raise LogError(f"{path}: holds no message that can be read; nothing can be recovered")
        file.finish(list(schemas.values()), list(channels.values()))
    total = sum(counts.values())
    lost = describe(damages, f"{counted(total, 'message')} recovered", span[0])
    if strangers:
        lost.append(f"{counted(strangers, 'message')} of channels that are described nowhere left out")
    return Recovered({printable(topic): count for topic, count in sorted(counts.items())}, *span, tuple(lost))


def _write(file: McapFile, batch: Batch, known: np.ndarray) -> tuple[int, int]:
    """Write the known messages of a batch as one chunk; their first and last log time [ns]."""
    times = batch.log_times[known]
    span = int(times.min()), int(times.max())
    numbers, offsets = batch.channels[known], batch.offsets[known]
    chunk = batch.chunk
    if chunk is not None and known.all():
        head = np.array(span, dtype="<u8").tobytes()
        body, sizes, compression = head + chunk.body[16:], (chunk.size, chunk.packed), chunk.compression
    else:
        body, sizes, offsets = _packed_anew(batch, np.flatnonzero(known), span)
        compression = "zstd"
    entries = {}
    for number in np.unique(numbers).tolist():
        mine = numbers == number
        entries[number] = np.column_stack([times[mine], offsets[mine].astype("<u8")])
    file.chunk(body, span, compression, sizes, entries)
    return span


def _packed_anew(batch: Batch, which: np.ndarray, span: tuple[int, int]) -> tuple[bytes, tuple[int, int], np.ndarray]:
    """A chunk record of the messages at `which`, its sizes unpacked and packed, and the messages' offsets in it."""
    starts, lengths = batch.offsets[which], batch.lengths[which]
    parts = [batch.content[a : a + n].tobytes() for a, n in zip(starts.tolist(), lengths.tolist(), strict=True)]
    content = b"".join(parts)
    data = zstandard.ZstdCompressor(level=1).compress(content)
    builder = RecordBuilder()
    for value in (*span, len(content)):
        builder.write8(value)
    builder.write4(zlib.crc32(content))
    builder.write_prefixed_string("zstd")
    builder.write8(len(data))
    offsets = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    return builder.end() + data, (len(content), len(data)), offsets
