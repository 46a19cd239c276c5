"""What one message says of the joints, in every encoding that is known.

CDR messages of constant length are read in bulk by their layout; this is for all the others, one by one.
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import re
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from identify.logs import joint_state

if TYPE_CHECKING:
    from mcap.records import Channel, Schema

FOXGLOVE_NAMES = ("foxglove.JointStates",)
KNOWN = "sensor_msgs/msg/JointState in cdr or JSON, no JointTrajectoryControllerState and no foxglove.JointStates"
"""For messages: what is looked for."""

UNCERTAIN = 2

_SECOND = joint_state.NANOSECONDS
_LATEST = 1 << 62
_ZSTD = b"\x28\xb5\x2f\xfd"
_LARGEST = 1 << 20
_JSON_NAME = re.compile(r"joint_?states?$", re.IGNORECASE)


@dataclass(frozen=True)
class State:
    """One message: joints, header stamp [ns] (0 where it has none), and one number a joint or None."""

    joints: tuple[str, ...]
    stamp: int
    position: list[float]
    velocity: list[float] | None
    effort: list[float] | None


@dataclass(frozen=True, eq=False)
class Kind:
    """How the messages of a channel are read.

    rank: measured joint states come before a controller's, and those before UNCERTAIN ones, of which only a look at a
    message tells whether they are joint states; parse: message → layout for reading in bulk, or None;
    decode: message → State, or None where it can't be read.
    """

    rank: int
    parse: Callable[[bytes], joint_state.Layout | None]
    decode: Callable[[bytes], State | None]


def kind_of(channel: Channel, schema: Schema | None) -> Kind | None:
    """How this channel's messages are read; None where they are no joint states."""
    name = schema.name if schema else ""
    encoding = channel.message_encoding
    if encoding == "cdr" and name in joint_state.NAMES:
        text = joint_state.DEFINITION
        return Kind(0, joint_state.parse, _guarded(lambda: _ros2(text, joint_state.NAMES[0], _of_joint_state)))
    if encoding == "cdr" and schema and name in joint_state.CONTROLLER_NAMES:
        return _controller_kind(schema)
    if encoding == "json":
        return Kind(0 if _JSON_NAME.search(name) else UNCERTAIN, _no_layout, _guarded(lambda: _of_json))
    if encoding == "protobuf" and name in FOXGLOVE_NAMES:
        return Kind(0, _no_layout, _guarded(lambda: _of_protobuf))
    return None


def _no_layout(message: bytes) -> None:
    return None


def _guarded(make: Callable[[], Callable[[bytes], State]]) -> Callable[[bytes], State | None]:
    """The decoder that `make` makes when it is first used; it gives None for what it can't read."""
    made: list[Callable[[bytes], State]] = []

    def decode(message: bytes) -> State | None:
        try:
            if not made:
                made.append(make())
            state = made[0](_unpacked(message))
        except Exception:
            # Decoders of others raise what they like on bytes that are no message.
            return None
        return state if state.joints and abs(state.stamp) < _LATEST else None

    return decode


def _unpacked(message: bytes) -> bytes:
    """The message, which `ros2 bag` may have compressed by itself."""
    if message[:4] != _ZSTD:
        return message
    import zstandard

    try:
        size = zstandard.frame_content_size(message)
        if size > _LARGEST:
            raise ValueError("it unpacks to more than a message can hold")
        return zstandard.ZstdDecompressor().decompress(message, max_output_size=_LARGEST)
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from error


def _controller_kind(schema: Schema) -> Kind | None:
    """Its measured point is the second one, called actual or feedback; None where the definition says otherwise."""
    text = schema.data.decode(errors="replace")
    own = text.split("=" * 20)[0]
    points = re.findall(r"^\s*trajectory_msgs/(?:msg/)?JointTrajectoryPoint\s+(\w+)", own, re.MULTILINE)
    if schema.encoding != "ros2msg" or points[1:2] not in (["actual"], ["feedback"]):
        return None
    first = re.findall(r"^\s*[\w/]+(?:\[\])?\s+(\w+)\s*(?:#.*)?$", own, re.MULTILINE)[:4]
    regular = first == ["header", "joint_names", *points[:2]]
    parse = joint_state.parse_controller_state if regular else _no_layout
    return Kind(1, parse, _guarded(lambda: _ros2(text, schema.name, lambda message: _of_point(message, points[1]))))


def _ros2(text: str, name: str, state: Callable[[Any], State]) -> Callable[[bytes], State]:
    """Decoding by mcap-ros2-support."""
    from mcap.records import Schema
    from mcap_ros2.decoder import DecoderFactory

    # Its parser knows types without the middle part, and prints what it does not know.
    text = re.sub(r"\b(\w+)/msg/(\w+)", r"\1/\2", text)
    schema = Schema(id=1, data=text.encode(), encoding="ros2msg", name=name)
    with contextlib.redirect_stderr(io.StringIO()):
        decode = DecoderFactory().decoder_for("cdr", schema)
    if decode is None:
        raise ValueError(f"mcap-ros2-support has no decoder for {name}")
    return lambda message: state(decode(message))


def _of_joint_state(message: Any) -> State:
    return _state(message.name, _stamp_of(message), message.position, message.velocity, message.effort)


def _of_point(message: Any, name: str) -> State:
    point = getattr(message, name)
    return _state(message.joint_names, _stamp_of(message), point.positions, point.velocities, point.effort)


def _stamp_of(message: Any) -> int:
    return message.header.stamp.sec * _SECOND + message.header.stamp.nanosec


def _state(names: Any, stamp: int, position: Any, velocity: Any, effort: Any) -> State:
    """The state; ValueError where positions do not fit the names. Velocity and effort of another length are none."""
    joints = tuple(names)
    if len(position) != len(joints):
        raise ValueError("positions and names differ in number")
    position, velocity, effort = (
        [_number(value) for value in values] if len(values or ()) == len(joints) else None
        for values in (position, velocity, effort)
    )
    return State(joints, stamp, position or [], velocity, effort)


def _number(value: Any) -> float:
    """A number; null is none."""
    if value is None:
        return math.nan
    if isinstance(value, bool | str):
        raise ValueError("a value is no number")
    return float(value)


def _of_json(message: bytes) -> State:
    """{"header": {"stamp": …}, "name": […], "position": […], …} or {"timestamp": …, "joints": [{"name": …}, …]}."""
    entries = json.loads(message)
    stamp = _json_time(entries.get("header", {}).get("stamp", entries.get("timestamp")))
    if "joints" in entries:
        joints = entries["joints"]
        names = [joint["name"] for joint in joints]
        columns = {key: [joint.get(key) for joint in joints] for key in ("position", "velocity", "effort")}
    else:
        names = entries["name"]
        columns = {key: entries.get(key) or [] for key in ("position", "velocity", "effort")}
    if not all(isinstance(name, str) for name in names):
        raise ValueError("a name is no text")
    return _state(names, stamp, *(_none_if_empty(values) for values in columns.values()))


def _none_if_empty(values: list[Any]) -> list[Any]:
    return [] if all(value is None for value in values) else values


def _json_time(value: Any) -> int:
    """Time [ns] of {"sec": …, "nanosec" or "nsec": …} or of seconds; 0 where there is none."""
    if isinstance(value, dict):
        return int(value.get("sec", 0)) * _SECOND + int(value.get("nanosec") or value.get("nsec") or 0)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return round(value * _SECOND)
    if isinstance(value, str):
        from datetime import UTC, datetime

        when = datetime.fromisoformat(value)
        return round((when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp() * _SECOND)
    return 0


def _of_protobuf(message: bytes) -> State:
    """foxglove.JointStates: 1 timestamp (1 seconds, 2 nanos), 2 joints (1 name, 2 position, 3 velocity, 5 effort)."""
    stamp, names = 0, []
    columns: dict[int, list[float | None]] = {2: [], 3: [], 5: []}
    for number, value in _fields(message):
        if number == 1:
            parts = dict(_fields(value))
            stamp = parts.get(1, 0) * _SECOND + parts.get(2, 0)
        elif number == 2:
            parts = dict(_fields(value))
            names.append(parts.get(1, b"").decode())
            for key, column in columns.items():
                column.append(struct.unpack("<d", parts[key])[0] if key in parts else None)
    return _state(names, stamp, *(_none_if_empty(column) for column in columns.values()))


def _fields(message: bytes) -> Iterator[tuple[int, Any]]:
    """Field numbers and values of a message in protobuf's wire format: varints as int, all others as bytes."""
    at = 0

    def varint() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = message[at]
            at += 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value
            if shift > 63:
                raise ValueError("a varint is too long")

    while at < len(message):
        key = varint()
        if key & 7 == 0:
            yield key >> 3, varint()
            continue
        length = {1: 8, 5: 4}.get(key & 7) or (varint() if key & 7 == 2 else -1)
        if length < 0 or at + length > len(message):
            raise ValueError("a field runs past the end")
        yield key >> 3, message[at : at + length]
        at += length
