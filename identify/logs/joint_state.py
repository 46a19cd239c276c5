"""sensor_msgs/msg/JointState as CDR bytes, many messages at once.

As long as the joint names stay the same, so does the length of the message: one template serves them
all, and the times and numbers are columns at fixed places in it. CDR (OMG DDS-XTypes 1.3, section 7.4)
aligns every value to its own size, counted from the end of the 4-byte encapsulation header.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

NAMES = ("sensor_msgs/msg/JointState", "sensor_msgs/JointState")
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
_MAX_TRAILING = 7


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


def matches(known: Layout, messages: np.ndarray) -> np.ndarray:
    """(N,) bool: which messages (N, length) uint8 have this layout."""
    # Nearly always all agree, and comparing bytes as such is far cheaper than a look at every row.
    if all(
        messages[:, start:stop].tobytes() == known.template[start:stop].tobytes() * len(messages)
        for start, stop in known.spans
    ):
        return np.ones(len(messages), dtype=bool)
    return ~((messages ^ known.template) & known.constant).any(axis=1)


def decode(known: Layout, messages: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Stamp (N,) int64 [ns], position, velocity and effort (N, n), or None, of messages (N, length) uint8."""
    rows = messages.view(known.fields)[:, 0]
    stamp = rows["sec"].astype(np.int64) * NANOSECONDS + rows["nanosec"]
    velocity, effort = (
        np.ascontiguousarray(rows[name]) if name in (known.fields.names or ()) else None
        for name in ("velocity", "effort")
    )
    return stamp, np.ascontiguousarray(rows["position"]), velocity, effort


def encode(known: Layout, messages: np.ndarray, stamp: np.ndarray, values: dict[str, np.ndarray | None]) -> None:
    """Fill messages (N, length) uint8 with the template, stamps (N,) int64 [ns] and the values (N, n) by name."""
    messages[:] = known.template
    rows = messages.view(known.fields)[:, 0]
    rows["sec"], rows["nanosec"] = np.divmod(stamp, NANOSECONDS)
    for name, value in values.items():
        if value is not None:
            rows[name] = value


def _parse(message: bytes) -> Layout:
    if message[:2] != _LITTLE_ENDIAN:
        raise ValueError("not little-endian CDR")
    constant = np.zeros(len(message), dtype=np.uint8)
    constant[:2] = 255
    at = _FRAME

    def take_count() -> int:
        nonlocal at
        at += _padding(at, 4)
        (value,) = struct.unpack_from("<I", message, at)
        constant[at : at + 4] = 255
        at += 4
        return value

    def take_string() -> str:
        nonlocal at
        length = take_count()
        if length > len(message) - at:
            raise ValueError("a string runs past the end")
        constant[at : at + length] = 255
        at += length
        return message[at - length : at - 1].decode() if length else ""

    take_string()
    joints = tuple(take_string() for _ in range(take_count()))
    names, formats, offsets = ["sec", "nanosec"], ["<i4", "<u4"], [_STAMP, _STAMP + 4]
    for name in ("position", "velocity", "effort"):
        count = take_count()
        if count not in ((len(joints),) if name == "position" else (0, len(joints))):
            raise ValueError(f"{name} of another length than the names")
        if count:
            at += _padding(at, 8)
            names, formats, offsets = [*names, name], [*formats, f"({count},)<f8"], [*offsets, at]
            at += 8 * count
    if not joints or not 0 <= len(message) - at <= _MAX_TRAILING:
        raise ValueError("no joints, or bytes left over")
    fields = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": len(message)})
    template = np.frombuffer(message, dtype=np.uint8) & constant
    starts = [0, _FRAME, *(offset + 8 * len(joints) for offset in offsets[2:])]
    stops = [_STAMP, *offsets[2:], len(message)]
    spans = tuple((start, stop) for start, stop in zip(starts, stops, strict=True) if constant[start:stop].any())
    return Layout(joints, template, constant, spans, fields)


def _padding(at: int, size: int) -> int:
    return -(at - 4) % size


def _put_count(out: bytearray, count: int) -> None:
    out.extend(bytes(_padding(len(out), 4)))
    out.extend(struct.pack("<I", count))


def _put_string(out: bytearray, text: str) -> None:
    data = text.encode() + b"\0"
    _put_count(out, len(data))
    out.extend(data)
