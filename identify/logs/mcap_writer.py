"""A Log as an MCAP file that ROS 2 tools, PlotJuggler and Foxglove read.

Every chunk carries its own schema and channel, so that each one can be read alone, and spans less than
half a second of a six-axis arm at 1 kHz, which is what a cut file can lose at most.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from identify import __version__
from identify.errors import OutputError
from identify.logs import joint_state
from identify.logs.files import replacing
from identify.logs.log import START_TIME, Log

TOPIC = "/joint_states"
PROVENANCE = "identify"
"""Name of the metadata record that holds Log.metadata."""
DEFAULT_START_NS = 1_577_836_800 * joint_state.NANOSECONDS
"""2020-01-01 00:00 UTC, the first stamp of a log without absolute time: the same log makes the same file."""

MAGIC = b"\x89MCAP0\r\n"
CHUNK_BYTES = 128 * 1024
MESSAGE_HEAD = 31
_CHANNEL_ID = 1
_SCHEMA_ID = 1
_ZSTD_LEVEL = 1
_LATEST_STAMP = 2**31 * joint_state.NANOSECONDS
_QOS_PROFILES = "\n".join(
    (
        "- history: 1",
        "  depth: 10",
        "  reliability: 1",
        "  durability: 2",
        "  deadline: {sec: 9223372036, nsec: 854775807}",
        "  lifespan: {sec: 9223372036, nsec: 854775807}",
        "  liveliness: 1",
        "  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}",
        "  avoid_ros_namespace_conventions: false",
    )
)
"""Keep-last 10, reliable, volatile: what a joint state broadcaster offers; `ros2 bag` wants it in the channel."""


def write_mcap(
    log: Log,
    path: str | os.PathLike[str],
    attachments: Mapping[str, bytes] | None = None,
    start_ns: int | None = None,
) -> None:
    """Write a log to an MCAP file, replacing it whole or not at all.

    attachments: name → content (the robot's TOML, the settings). start_ns: absolute time of t = 0 [ns];
    by default what `log.metadata` says, else DEFAULT_START_NS. Times are kept to the nanosecond, numbers
    bit by bit. The same input makes the same bytes. Raises OutputError where the file can't be written.
    """
    if log.samples == 0 or not log.joints:
        raise OutputError(f"{path}: the log holds no samples or no joints, so there is nothing to write")
    if start_ns is None:
        start_ns = _start_of(log)
    stamp = start_ns + np.round(np.asarray(log.time, dtype=float) * joint_state.NANOSECONDS).astype(np.int64)
    if stamp.min() < 0 or stamp.max() >= _LATEST_STAMP:
        raise OutputError(f"{path}: its times do not fit a ROS 2 stamp (1970 to 2038); times count seconds from zero")
    with replacing(path) as stream:
        for part in _file(log, stamp, dict(attachments or {})):
            stream.write(part)


def _start_of(log: Log) -> int:
    text = log.metadata.get(START_TIME, "")
    return int(text) if text.isdecimal() else DEFAULT_START_NS


def _file(log: Log, stamp: np.ndarray, attachments: dict[str, bytes]) -> Iterator[bytes]:
    """The file's bytes, in order; the index at its end knows the offset of every record before it."""
    from mcap.data_stream import RecordBuilder
    from mcap.opcode import Opcode
    from mcap.records import (
        Attachment,
        AttachmentIndex,
        Channel,
        ChunkIndex,
        DataEnd,
        Footer,
        Header,
        McapRecord,
        Metadata,
        MetadataIndex,
        Schema,
        Statistics,
        SummaryOffset,
    )

    def packed(*records: McapRecord) -> bytes:
        builder = RecordBuilder()
        for record in records:
            record.write(builder)
        return builder.end()

    qos = {"offered_qos_profiles": _QOS_PROFILES}
    schema = Schema(_SCHEMA_ID, joint_state.DEFINITION.encode(), "ros2msg", joint_state.NAMES[0])
    channel = Channel(_CHANNEL_ID, TOPIC, "cdr", qos, _SCHEMA_ID)
    first, last = int(stamp.min()), int(stamp.max())

    at = 0
    for part in (MAGIC, packed(Header("ros2", f"identify {__version__}"))):
        at += len(part)
        yield part

    # Before the chunks, so that a cut file keeps its provenance.
    provenance = {str(k): str(v) for k, v in log.metadata.items() if k != START_TIME}
    part = packed(Metadata(PROVENANCE, provenance))
    metadata_index = [MetadataIndex(at, len(part), PROVENANCE)]
    at += len(part)
    yield part

    attachment_index = []
    for name, data in attachments.items():
        kind = "application/toml" if Path(name).suffix == ".toml" else "application/octet-stream"
        part = packed(Attachment(first, first, name, kind, bytes(data)))
        attachment_index.append(AttachmentIndex(at, len(part), first, first, len(data), name, kind))
        at += len(part)
        yield part

    chunk_index = []
    for chunk, index, start, stop, size in _chunks(log, stamp, packed(schema, channel)):
        compressed = len(chunk) - _CHUNK_HEAD.size
        offsets = {_CHANNEL_ID: at + len(chunk)}
        entry = ChunkIndex(len(chunk), at, "zstd", compressed, stop, len(index), offsets, start, size)
        chunk_index.append(entry)
        at += len(chunk) + len(index)
        yield chunk
        yield index

    part = packed(DataEnd(0))
    at += len(part)
    yield part

    counts = {_CHANNEL_ID: log.samples}
    statistics = Statistics(len(attachments), 1, counts, len(chunk_index), log.samples, last, first, 1, 1)
    groups: dict[Opcode, list[McapRecord]] = {
        Opcode.SCHEMA: [schema],
        Opcode.CHANNEL: [channel],
        Opcode.STATISTICS: [statistics],
        Opcode.CHUNK_INDEX: [*chunk_index],
        Opcode.ATTACHMENT_INDEX: [*attachment_index],
        Opcode.METADATA_INDEX: [*metadata_index],
    }
    summary, shortcuts = b"", b""
    for opcode, records in groups.items():
        group = packed(*records)
        if group:
            shortcuts += packed(SummaryOffset(opcode, at + len(summary), len(group)))
            summary += group
    offsets_at = at + len(summary)
    summary += shortcuts
    head = struct.pack("<BQQQ", Opcode.FOOTER, 20, at, offsets_at)
    yield summary
    yield packed(Footer(at, offsets_at, zlib.crc32(head, zlib.crc32(summary))))
    yield MAGIC


_CHUNK_HEAD = struct.Struct("<BQQQQII4sQ")
"""Opcode, length, first and last log time, size, checksum, "zstd" with its length, length of what follows."""


def _chunks(log: Log, stamp: np.ndarray, preamble: bytes) -> Iterator[tuple[bytes, bytes, int, int, int]]:
    """Every chunk record with its message index record, first and last time [ns] and uncompressed size."""
    import zstandard

    compress = zstandard.ZstdCompressor(level=_ZSTD_LEVEL).compress
    known = joint_state.layout(log.joints, log.velocity is not None, log.effort is not None)
    length = MESSAGE_HEAD + known.template.size
    head = np.dtype(
        {
            "names": ["opcode", "length", "channel", "sequence", "log_time", "publish_time"],
            "formats": ["u1", "<u8", "<u2", "<u4", "<u8", "<u8"],
            "offsets": [0, 1, 9, 11, 15, 23],
            "itemsize": MESSAGE_HEAD,
        }
    )
    rows = max(1, (CHUNK_BYTES - len(preamble)) // length)
    for begin in range(0, log.samples, rows):
        part = slice(begin, begin + rows)
        times = stamp[part]
        messages = np.empty((len(times), length), dtype=np.uint8)
        heads = messages[:, :MESSAGE_HEAD].view(head)[:, 0]
        heads["opcode"], heads["length"], heads["channel"] = 5, length - 9, _CHANNEL_ID
        heads["sequence"] = np.arange(begin, begin + len(times))
        heads["log_time"] = heads["publish_time"] = times
        values = {
            "position": log.position[part],
            "velocity": None if log.velocity is None else log.velocity[part],
            "effort": None if log.effort is None else log.effort[part],
        }
        joint_state.encode(known, messages[:, MESSAGE_HEAD:], times, values)
        content = preamble + messages.tobytes()
        data = compress(content)
        start, stop = int(times.min()), int(times.max())
        chunk = _CHUNK_HEAD.pack(
            6, _CHUNK_HEAD.size - 9 + len(data), start, stop, len(content), zlib.crc32(content), 4, b"zstd", len(data)
        )
        entries = np.column_stack([times, len(preamble) + length * np.arange(len(times))]).astype("<u8").tobytes()
        index = struct.pack("<BQHI", 7, 6 + len(entries), _CHANNEL_ID, len(entries)) + entries
        yield chunk + data, index, start, stop, len(content)
