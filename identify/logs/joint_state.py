"""sensor_msgs/msg/JointState and control_msgs/msg/JointTrajectoryControllerState as CDR bytes, many at once.

As long as the joint names stay the same, so does the length of the message: one template serves them
all, and the times and numbers are columns at fixed places in it. CDR (OMG DDS-XTypes 1.3, section 7.4)
aligns every value to its own size, counted from the end of the 4-byte encapsulation header.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

NAMES = ("sensor_msgs/msg/JointState", "sensor_msgs/JointState")
CONTROLLER_NAMES = ("control_msgs/msg/JointTrajectoryControllerState", "control_msgs/JointTrajectoryControllerState")
DEFINITION = "\n".join(
    (
        "std_msgs/Header header",
        "string[] name",
        "float64[] position",
        "float64[] velocity",
        "float64[] effort",
        "=" * 80,
        "MSG: std_msgs/Header",
        "builtin_interfaces/Time stamp",
        "string frame_id",
        "=" * 80,
        "MSG: builtin_interfaces/Time",
        "int32 sec",
        "uint32 nanosec",
        "",
    )
)
"""The message definition with everything it refers to, as schema encoding `ros2msg` wants it."""

NANOSECONDS = 1_000_000_000
_LITTLE_ENDIAN = b"\x00\x01"
_STAMP = 4
_FRAME = 12
_DURATION = 8
_MAX_TRAILING = 7
_MOST_AT_ONCE = 1 << 13
_CHANNELS = ("position", "velocity", "effort")


@dataclass(frozen=True, eq=False)
class Layout:
    """Where a JointState message of constant length holds what.

    joints: the names in the message's order; template (length,) uint8, a whole message with time and numbers
    zero; constant (length,) uint8, 255 where every message of this layout agrees with the template and 0
    elsewhere; spans: the parts (start, stop) around stamp and numbers that hold something constant; fields:
    structured dtype of one message (sec, nanosec, position, and velocity and effort where it carries them).
    """

    joints: tuple[str, ...]
    template: np.ndarray
    constant: np.ndarray
    spans: tuple[tuple[int, int], ...]
    fields: np.dtype


def layout(joints: Sequence[str], velocity: bool, effort: bool) -> Layout:
    """Layout of a message with these joints, an empty frame name, and velocity and effort or none."""
    out = bytearray(_LITTLE_ENDIAN + bytes(2) + bytes(8))
    _put_string(out, "")
    _put_count(out, len(joints))
    for joint in joints:
        _put_string(out, joint)
    for present in (True, velocity, effort):
        _put_count(out, len(joints) if present else 0)
        if present:
            out.extend(bytes(_padding(len(out), 8) + 8 * len(joints)))
    return _parse(bytes(out))


def parse(message: bytes) -> Layout | None:
    """Layout of a little-endian message; None where it has no regular one.

    Regular: as many positions as names, velocity and effort as many or none. Bytes of padding may hold
    anything, since some writers leave them as they were.
    """
    try:
        return _parse(message)
    except (struct.error, ValueError):
        return None


def parse_controller_state(message: bytes) -> Layout | None:
    """The same of a controller's state: its second point, the measured one, is what is taken."""
    try:
        return _parse_controller_state(message)
    except (struct.error, ValueError):
        return None


def matches(known: Layout, messages: np.ndarray) -> np.ndarray:
    """(N,) bool: which messages (N, length) uint8 have this layout."""
    if len(messages) > _MOST_AT_ONCE:
        parts = range(0, len(messages), _MOST_AT_ONCE)
        return np.concatenate([matches(known, messages[start : start + _MOST_AT_ONCE]) for start in parts])
    # Nearly always all agree, and comparing bytes as such is far cheaper than a look at every row.
    if all(
        messages[:, start:stop].tobytes() == expected
        for (start, stop), expected in zip(known.spans, _repeated(known, len(messages)), strict=True)
    ):
        return np.ones(len(messages), dtype=bool)
    return ~((messages ^ known.template) & known.constant).any(axis=1)


@functools.lru_cache(maxsize=8)
def _repeated(known: Layout, count: int) -> tuple[bytes, ...]:
    """The bytes of every span of `count` messages."""
    return tuple(known.template[start:stop].tobytes() * count for start, stop in known.spans)


def rows(known: Layout, messages: np.ndarray) -> np.ndarray:
    """(N,) structured view of messages (N, length) uint8 by the layout's fields; nothing is copied."""
    return messages.view(known.fields)[:, 0]


def stamps(rows: np.ndarray) -> np.ndarray:
    """(N,) int64, the header stamps of structured rows [ns]."""
    return rows["sec"].astype(np.int64) * NANOSECONDS + rows["nanosec"]


def encode(known: Layout, messages: np.ndarray, stamp: np.ndarray, values: dict[str, np.ndarray | None]) -> None:
    """Fill messages (N, length) uint8 with the template, stamps (N,) int64 [ns] and the values (N, n) by name."""
    messages[:] = known.template
    into = rows(known, messages)
    into["sec"], into["nanosec"] = np.divmod(stamp, NANOSECONDS)
    for name, value in values.items():
        if value is not None:
            into[name] = value


def _parse(message: bytes) -> Layout:
    cursor = _Cursor(message)
    joints = cursor.head()
    offsets = {name: cursor.sequence(len(joints), needed=name == "position") for name in _CHANNELS}
    if not 0 <= len(message) - cursor.at <= _MAX_TRAILING:
        raise ValueError("bytes left over")
    return cursor.layout(joints, offsets)


def _parse_controller_state(message: bytes) -> Layout:
    """Header and names, then points of positions, velocities, accelerations, effort and a duration."""
    cursor = _Cursor(message)
    joints = cursor.head()
    for needed in (False, True):
        found = [
            cursor.sequence(len(joints), needed and name == "position")
            for name in ("position", "velocity", "acceleration", "effort")
        ]
        cursor.at += _padding(cursor.at, 4) + _DURATION
    return cursor.layout(joints, dict(zip(_CHANNELS, (found[0], found[1], found[3]), strict=True)))


class _Cursor:
    """A place in a message, and which of the bytes before it have to be the same in every message of its layout."""

    def __init__(self, message: bytes) -> None:
        if message[:2] != _LITTLE_ENDIAN:
            raise ValueError("not little-endian CDR")
        self.message = message
        self.constant = np.zeros(len(message), dtype=np.uint8)
        self.constant[:2] = 255
        self.at = _FRAME

    def head(self) -> tuple[str, ...]:
        """Frame name and joint names."""
        self._string()
        joints = tuple(self._string() for _ in range(self._count()))
        if not joints:
            raise ValueError("no joints")
        return joints

    def sequence(self, length: int, needed: bool) -> int | None:
        """Where the numbers of a sequence start, which has `length` of them, or may have none."""
        count = self._count()
        if count not in ((length,) if needed else (0, length)):
            raise ValueError("a sequence of another length than the names")
        if not count:
            return None
        self.at += _padding(self.at, 8)
        start, self.at = self.at, self.at + 8 * count
        return start

    def layout(self, joints: tuple[str, ...], offsets: dict[str, int | None]) -> Layout:
        """The layout with the numbers at these offsets."""
        message, constant = self.message, self.constant
        if self.at > len(message):
            raise ValueError("it ends before its time")
        places = {"sec": ("<i4", _STAMP), "nanosec": ("<u4", _STAMP + 4)}
        places |= {name: (f"({len(joints)},)<f8", at) for name, at in offsets.items() if at is not None}
        formats, starts = zip(*places.values(), strict=True)
        fields = np.dtype(
            {"names": list(places), "formats": list(formats), "offsets": list(starts), "itemsize": len(message)}
        )
        template = np.frombuffer(message, dtype=np.uint8) & constant
        # Neighbours with no more than padding between them are compared in one go.
        fixed = np.flatnonzero(constant)
        parts = np.split(fixed, np.flatnonzero(np.diff(fixed) > 8) + 1)
        spans = tuple((int(part[0]), int(part[-1]) + 1) for part in parts)
        return Layout(joints, template, constant, spans, fields)

    def _count(self) -> int:
        self.at += _padding(self.at, 4)
        (value,) = struct.unpack_from("<I", self.message, self.at)
        self.constant[self.at : self.at + 4] = 255
        self.at += 4
        return value

    def _string(self) -> str:
        length = self._count()
        if length > len(self.message) - self.at:
            raise ValueError("a string runs past the end")
        start, self.at = self.at, self.at + length
        self.constant[start : self.at] = 255
        return self.message[start : self.at - 1].decode() if length else ""


def _padding(at: int, size: int) -> int:
    return -(at - 4) % size


def _put_count(out: bytearray, count: int) -> None:
    out.extend(bytes(_padding(len(out), 4)))
    out.extend(struct.pack("<I", count))


def _put_string(out: bytearray, text: str) -> None:
    data = text.encode() + b"\0"
    _put_count(out, len(data))
    out.extend(data)
