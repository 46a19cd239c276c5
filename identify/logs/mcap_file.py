"""An MCAP file as it is written: records one after the other, and at its end the index of them all."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from identify import __version__

if TYPE_CHECKING:
    from mcap.records import Attachment, Channel, ChunkIndex, McapRecord, Metadata, Schema

MAGIC = b"\x89MCAP0\r\n"
_CHUNK, _MESSAGE_INDEX, _FOOTER = 6, 7, 2
_RECORD_HEAD = struct.Struct("<BQ")


class McapFile:
    """Writes to `stream`, a chunk at a time, each of them handed to the operating system whole.

    What has been written can be read at any time, by readers that do without the index; `finish` adds it.
    """

    def __init__(self, stream: BinaryIO, profile: str = "ros2") -> None:
        from mcap.records import Header

        self._stream = stream
        self._at = 0
        self._metadata: list[McapRecord] = []
        self._attachments: list[McapRecord] = []
        self._chunks: list[ChunkIndex] = []
        self._counts: dict[int, int] = {}
        self._write(MAGIC + packed(Header(profile, f"identify {__version__}")))

    def define(self, record: Schema | Channel) -> None:
        """Write a schema or a channel outside of the chunks."""
        self._write(packed(record))

    def metadata(self, record: Metadata) -> None:
        """Write a metadata record."""
        from mcap.records import MetadataIndex

        part = packed(record)
        self._metadata.append(MetadataIndex(self._at, len(part), record.name))
        self._write(part)

    def attachment(self, record: Attachment) -> None:
        """Write an attachment."""
        from mcap.records import AttachmentIndex

        part = packed(record)
        self._attachments.append(
            AttachmentIndex(
                self._at,
                len(part),
                record.log_time,
                record.create_time,
                len(record.data),
                record.name,
                record.media_type,
            )
        )
        self._write(part)

    def chunk(
        self,
        body: bytes,
        span: tuple[int, int],
        compression: str,
        sizes: tuple[int, int],
        entries: Mapping[int, np.ndarray],
    ) -> None:
        """Write a chunk record and the indices of its messages, and flush them.

        body: the record after opcode and length; span: first and last log time [ns]; sizes: of the content, unpacked
        and packed; entries: channel → (k, 2) log time and offset in the content of its messages.
        """
        from mcap.records import ChunkIndex

        parts = [_RECORD_HEAD.pack(_CHUNK, len(body)), body]
        length = at = _RECORD_HEAD.size + len(body)
        offsets = {}
        for channel, rows in entries.items():
            index = rows.astype("<u8").tobytes()
            head = struct.pack("<BQHI", _MESSAGE_INDEX, 6 + len(index), channel, len(index))
            offsets[channel] = self._at + at
            self._counts[channel] = self._counts.get(channel, 0) + len(rows)
            parts += [head, index]
            at += len(head) + len(index)
        self._chunks.append(
            ChunkIndex(length, self._at, compression, sizes[1], span[1], at - length, offsets, span[0], sizes[0])
        )
        self._write(b"".join(parts))
        self._stream.flush()

    def finish(self, schemas: Sequence[Schema], channels: Sequence[Channel]) -> None:
        """End the data and write the index."""
        from mcap.records import DataEnd, Footer, Statistics, SummaryOffset

        self._write(packed(DataEnd(0)))
        first = min((chunk.message_start_time for chunk in self._chunks), default=0)
        last = max((chunk.message_end_time for chunk in self._chunks), default=0)
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=last,
            message_start_time=first,
            metadata_count=len(self._metadata),
            schema_count=len(schemas),
        )
        groups: list[Sequence[McapRecord]] = [
            schemas,
            channels,
            [statistics],
            self._chunks,
            self._attachments,
            self._metadata,
        ]
        summary, shortcuts = b"", b""
        for records in groups:
            group = packed(*records)
            if group:
                shortcuts += packed(SummaryOffset(group[0], self._at + len(summary), len(group)))
                summary += group
        offsets_at = self._at + len(summary)
        summary += shortcuts
        head = struct.pack("<BQQQ", _FOOTER, 20, self._at, offsets_at)
        footer = packed(Footer(self._at, offsets_at, zlib.crc32(head, zlib.crc32(summary))))
        self._write(summary + footer + MAGIC)

    def _write(self, part: bytes) -> None:
        self._stream.write(part)
        self._at += len(part)


def packed(*records: McapRecord) -> bytes:
    """The bytes of whole records."""
    from mcap.data_stream import RecordBuilder

    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return builder.end()
