"""Joint states as an MCAP file that ROS 2 tools, PlotJuggler and Foxglove read, written while they come.

Every chunk carries its own schema and channel, so that each one can be read alone, and spans less than
half a second, which is what a file can lose at most whose writer is killed.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np

from identify.errors import OutputError
from identify.logs import joint_state
from identify.logs.files import growing, replacing
from identify.logs.log import START_TIME, Log
from identify.logs.mcap_file import McapFile, packed

TOPIC = "/joint_states"
PROVENANCE = "identify"
"""Name of the metadata record that holds Log.metadata."""
DEFAULT_START_NS = 1_577_836_800 * joint_state.NANOSECONDS
"""2020-01-01 00:00 UTC, the first stamp of a log without absolute time: the same log makes the same file."""

CHUNK_BYTES = 128 * 1024
CHUNK_SPAN = 450_000_000
"""A chunk ends at so many bytes, or when so much time has passed since its first message [ns]."""
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

    attachments: name → content (the robot's TOML, the settings), beside those of the log. start_ns: absolute time of
    t = 0 [ns]; by default what `log.metadata` says, else DEFAULT_START_NS. Times are kept to the nanosecond, numbers
    bit by bit. The same input makes the same bytes. Raises OutputError where the file can't be written.
    """
    if log.samples == 0 or not log.joints:
        raise OutputError(f"{path}: the log holds no samples or no joints, so there is nothing to write")
    channels = [name for name in ("velocity", "effort") if getattr(log, name) is not None]
    # Not by way of path + ".partial", which may be what the log was read from.
    with replacing(path) as stream:
        attached = {**(attachments or {}), **log.attachments}
        recorder = _started(stream, path, log.joints, channels, log.metadata, attached, start_ns)
        recorder.append(log.time, log.position, log.velocity, log.effort)
        recorder.close()


@contextmanager
def recording(
    path: str | os.PathLike[str],
    joints: Sequence[str],
    channels: Sequence[str] = ("velocity", "effort"),
    metadata: Mapping[str, str] | None = None,
    attachments: Mapping[str, bytes] | None = None,
    start_ns: int | None = None,
) -> Iterator[Recorder]:
    """A recorder that writes joint states to `path` as they come, and makes it a whole file at the end.

    channels: which of velocity and effort will come. Until the end the file is called `path` + ".partial": whoever is
    killed leaves it readable, without the last half second at most, and an older `path` as it was. After an error
    the partial file goes. Raises OutputError where the file can't be written, or is being written already.
    """
    with growing(path) as stream:
        recorder = _started(stream, path, joints, channels, metadata, attachments, start_ns)
        stream.flush()
        yield recorder
        recorder.close()


def _started(
    stream: BinaryIO,
    path: str | os.PathLike[str],
    joints: Sequence[str],
    channels: Sequence[str],
    metadata: Mapping[str, str] | None,
    attachments: Mapping[str, bytes] | None,
    start_ns: int | None,
) -> Recorder:
    """A recorder on a stream that holds all but the samples."""
    from mcap.records import Attachment, Metadata

    start = _start_of(metadata or {}) if start_ns is None else start_ns
    file = McapFile(stream)
    # Before the chunks, so that a cut file keeps its provenance.
    provenance = {str(k): str(v) for k, v in (metadata or {}).items() if k != START_TIME}
    file.metadata(Metadata(PROVENANCE, provenance))
    for name, data in (attachments or {}).items():
        kind = "application/toml" if Path(name).suffix == ".toml" else "application/octet-stream"
        file.attachment(Attachment(start, start, name, kind, bytes(data)))
    return Recorder(file, str(path), tuple(joints), tuple(channels), start)


class Recorder:
    """Takes joint states and hands every full chunk on; made by `recording`."""

    def __init__(
        self, file: McapFile, path: str, joints: tuple[str, ...], channels: tuple[str, ...], start_ns: int
    ) -> None:
        import zstandard
        from mcap.records import Channel, Schema

        qos = {"offered_qos_profiles": _QOS_PROFILES}
        self._schema = Schema(_SCHEMA_ID, joint_state.DEFINITION.encode(), "ros2msg", joint_state.NAMES[0])
        self._channel = Channel(_CHANNEL_ID, TOPIC, "cdr", qos, _SCHEMA_ID)
        self._preamble = packed(self._schema, self._channel)
        self._file = file
        self._path = path
        self._names = ("position", *channels)
        self._layout = joint_state.layout(joints, "velocity" in channels, "effort" in channels)
        self._shape = len(joints)
        self._start = start_ns
        self._compress = zstandard.ZstdCompressor(level=_ZSTD_LEVEL).compress
        self._pending: list[tuple[np.ndarray, dict[str, np.ndarray]]] = []
        self._held = 0
        self._first = 0
        self._sequence = 0

    def append(
        self,
        time: np.ndarray,
        position: np.ndarray,
        velocity: np.ndarray | None = None,
        effort: np.ndarray | None = None,
    ) -> None:
        """Take k samples: time (k,) [s from the start], position and the channels announced (k, n)."""
        stamp = self._start + np.round(np.asarray(time, dtype=float) * joint_state.NANOSECONDS).astype(np.int64)
        if not len(stamp):
            return
        if stamp.min() < 0 or stamp.max() >= _LATEST_STAMP:
            raise OutputError(
                f"{self._path}: its times do not fit a ROS 2 stamp (1970 to 2038); times count seconds from zero"
            )
        given = {"position": position, "velocity": velocity, "effort": effort}
        values = {name: value for name, value in given.items() if value is not None}
        if set(values) != set(self._names) or any(v.shape != (len(stamp), self._shape) for v in values.values()):
            raise OutputError(f"{self._path}: samples need {', '.join(self._names)} of {self._shape} joints, each time")
        if not self._pending:
            self._first = int(stamp[0])
        # Copied, as whoever hands over samples one by one may use the same array again.
        self._pending.append((stamp, values if len(stamp) > 1 else {k: v.copy() for k, v in values.items()}))
        self._held += len(stamp)
        if self._held >= self._rows or abs(int(stamp[-1]) - self._first) >= CHUNK_SPAN or len(stamp) > 1:
            self._write_full(last=False)

    def note(self, entries: Mapping[str, str]) -> None:
        """Add to the provenance what was not known at the start."""
        from mcap.records import Metadata

        self._file.metadata(Metadata(PROVENANCE, dict(entries)))

    def close(self) -> None:
        """Write what is left, and the index."""
        self._write_full(last=True)
        self._file.finish([self._schema], [self._channel])

    @property
    def _rows(self) -> int:
        return max(1, (CHUNK_BYTES - len(self._preamble)) // (MESSAGE_HEAD + self._layout.template.size))

    def _write_full(self, last: bool) -> None:
        """Write every chunk that is full, or all."""
        if not self._pending:
            return
        stamp, values = self._pending[0]
        if len(self._pending) > 1:
            stamp = np.concatenate([part for part, _ in self._pending])
            values = {name: np.concatenate([part[name] for _, part in self._pending]) for name in values}
        begin = 0
        while begin < len(stamp):
            window = stamp[begin : begin + self._rows]
            late = np.abs(window - window[0]) >= CHUNK_SPAN
            count = int(late.argmax()) if late.any() else len(window)
            if not last and count == len(window) < self._rows:
                break
            part = slice(begin, begin + count)
            self._write_chunk(stamp[part], {name: value[part] for name, value in values.items()})
            begin += count
        rest = slice(begin, None)
        self._held = len(stamp) - begin
        kept = {name: value[rest].copy() for name, value in values.items()}
        self._pending = [(stamp[rest].copy(), kept)] if self._held else []
        self._first = int(stamp[begin]) if self._held else 0

    def _write_chunk(self, times: np.ndarray, values: dict[str, np.ndarray]) -> None:
        length = MESSAGE_HEAD + self._layout.template.size
        messages = np.empty((len(times), length), dtype=np.uint8)
        heads = messages[:, :MESSAGE_HEAD].view(_MESSAGE_DTYPE)[:, 0]
        heads["opcode"], heads["length"], heads["channel"] = 5, length - 9, _CHANNEL_ID
        heads["sequence"] = np.arange(self._sequence, self._sequence + len(times))
        heads["log_time"] = heads["publish_time"] = times
        joint_state.encode(self._layout, messages[:, MESSAGE_HEAD:], times, {**values})
        content = self._preamble + messages.tobytes()
        data = self._compress(content)
        span = int(times.min()), int(times.max())
        body = _CHUNK_HEAD.pack(*span, len(content), zlib.crc32(content), 4, b"zstd", len(data)) + data
        entries = np.column_stack([times, len(self._preamble) + length * np.arange(len(times))])
        self._file.chunk(body, span, "zstd", (len(content), len(data)), {_CHANNEL_ID: entries})
        self._sequence += len(times)


_CHUNK_HEAD = struct.Struct("<QQQII4sQ")
"""First and last log time, size, checksum, "zstd" with its length, length of what follows."""
_MESSAGE_DTYPE = np.dtype(
    {
        "names": ["opcode", "length", "channel", "sequence", "log_time", "publish_time"],
        "formats": ["u1", "<u8", "<u2", "<u4", "<u8", "<u8"],
        "offsets": [0, 1, 9, 11, 15, 23],
        "itemsize": MESSAGE_HEAD,
    }
)


def _start_of(metadata: Mapping[str, str]) -> int:
    text = metadata.get(START_TIME, "")
    return int(text) if text.isdecimal() else DEFAULT_START_NS
