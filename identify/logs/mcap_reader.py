"""MCAP files with sensor_msgs/msg/JointState, from whatever recorder, as a Log.

Messages of constant length are decoded in bulk; anything else goes through mcap-ros2-support, one by one.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identify.errors import LogError
from identify.logs import joint_state
from identify.logs.log import START_TIME, Log
from identify.logs.mcap_writer import PROVENANCE, TOPIC
from identify.logs.wording import counted, printable

_SECOND = joint_state.NANOSECONDS
_LAYOUTS_PER_RUN = 8
_LAYOUTS_KEPT = 64


@dataclass(frozen=True)
class Recording:
    """All that an MCAP file holds of interest.

    log: the joint states as recorded, not yet cleaned: time may repeat or run backward, values may be NaN;
    attachments: name → content; metadata: record name → its entries; topics: topic → message type.
    """

    log: Log
    attachments: dict[str, bytes]
    metadata: dict[str, dict[str, str]]
    topics: dict[str, str]


@dataclass(frozen=True, eq=False)
class Block:
    """Joint states with the same names: places (k,) in file order, stamps and log times (k,) [ns], values (k, n)."""

    joints: tuple[str, ...]
    places: np.ndarray
    stamp: np.ndarray
    log_time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None
    effort: np.ndarray | None


def read_mcap(path: str | os.PathLike[str], topic: str | None = None, joints: Sequence[str] | None = None) -> Recording:
    """Read the joint states of an MCAP file, and what is attached to it.

    topic: which one to read; by default /joint_states, else the one with the most messages. joints: names
    wanted, which decides between several publishers on one topic. A cut or damaged file gives every complete
    chunk, and a finding that counts what was lost. Time counts from the first message, by the header stamps,
    or by log time where they do not run. Raises LogError where the file holds no joint states.
    """
    from mcap.records import Attachment, Channel, Metadata, Schema

    from identify.logs.mcap_records import Damage, Messages, is_mcap, records

    path = Path(path)
    if not is_mcap(path):
        raise LogError(f"{path}: is not an MCAP file (it does not start as one); a table needs the suffix .csv or .npz")
    schemas: dict[int, str] = {}
    channels: dict[int, Channel] = {}
    blocks: dict[str, list[Block]] = {}
    attachments: dict[str, bytes] = {}
    metadata: dict[str, dict[str, str]] = {}
    damages: list[Damage] = []
    layouts: list[joint_state.Layout] = []
    unreadable = 0
    for item in records(path):
        match item:
            case Schema():
                schemas[item.id] = item.name
            case Channel():
                channels[item.id] = item
            case Attachment():
                attachments[item.name] = item.data
            case Metadata():
                metadata.setdefault(item.name, {}).update(item.metadata)
            case Damage():
                damages.append(item)
            case Messages():
                for number, messages in item.by_channel():
                    channel = channels.get(number)
                    if channel is None or not _holds_joint_states(channel, schemas):
                        continue
                    found = _blocks(messages, layouts)
                    good = blocks.setdefault(channel.topic, [])
                    good.extend(block for block in found if block is not None)
                    unreadable += sum(block is None for block in found)
    topics = {c.topic: printable(schemas.get(c.schema_id, "no type")) for c in channels.values()}
    findings = [f"{counted(unreadable, 'joint state message')} could not be decoded and not used"] if unreadable else []
    chosen = _choose_topic(path, topics, blocks, topic, damages, findings)
    log = _assemble(path, blocks[chosen], joints, findings)
    findings = [*_describe(damages, log, blocks[chosen]), *findings]
    provenance = {**metadata.get(PROVENANCE, {}), **log.metadata}
    log = Log(log.time, log.position, log.velocity, log.effort, log.joints, str(path), "", tuple(findings), provenance)
    return Recording(log, attachments, metadata, topics)


def _holds_joint_states(channel: Any, schemas: dict[int, str]) -> bool:
    return channel.message_encoding == "cdr" and schemas.get(channel.schema_id) in joint_state.NAMES


def _blocks(messages: Any, layouts: list[joint_state.Layout]) -> list[Block | None]:
    """Decode messages of one length, a layout at a time; None for each one that can't be decoded."""
    payloads, places, log_times = messages.payloads, messages.places, messages.log_times
    found: list[Block | None] = []
    for _ in range(_LAYOUTS_PER_RUN):
        if not len(payloads):
            return found
        known = _layout_of(payloads[0].tobytes(), layouts)
        if known is None:
            break
        same = joint_state.matches(known, payloads)
        if same.all():
            found.append(Block(known.joints, places, *_times_first(known, payloads, log_times)))
            return found
        found.append(Block(known.joints, places[same], *_times_first(known, payloads[same], log_times[same])))
        payloads, places, log_times = payloads[~same], places[~same], log_times[~same]
    decode = _slow_decoder()
    for payload, place, log_time in zip(payloads, places, log_times, strict=True):
        found.append(_decode_one(decode, payload.tobytes(), place, log_time))
    return found


def _times_first(known: joint_state.Layout, payloads: np.ndarray, log_times: np.ndarray) -> tuple[Any, ...]:
    stamp, position, velocity, effort = joint_state.decode(known, payloads)
    return stamp, log_times, position, velocity, effort


def _layout_of(message: bytes, layouts: list[joint_state.Layout]) -> joint_state.Layout | None:
    """The message's layout, found among those already seen or added to them."""
    row = np.frombuffer(message, dtype=np.uint8)[None]
    for known in layouts:
        if known.template.size == len(message) and joint_state.matches(known, row)[0]:
            return known
    parsed = joint_state.parse(message)
    if parsed is not None:
        layouts.insert(0, parsed)
        del layouts[_LAYOUTS_KEPT:]
    return parsed


def _slow_decoder() -> Callable[[bytes], Any]:
    from mcap.records import Schema
    from mcap_ros2.decoder import DecoderFactory

    schema = Schema(id=1, data=joint_state.DEFINITION.encode(), encoding="ros2msg", name=joint_state.NAMES[0])
    decode = DecoderFactory().decoder_for("cdr", schema)
    if decode is None:
        raise LogError("mcap-ros2-support has no decoder for sensor_msgs/msg/JointState; update it")
    return decode


def _decode_one(decode: Callable[[bytes], Any], payload: bytes, place: int, log_time: int) -> Block | None:
    try:
        message = decode(payload)
    except (struct.error, ValueError, IndexError, MemoryError):
        return None
    joints = tuple(message.name)
    if not joints or len(message.position) != len(joints):
        return None
    stamp = message.header.stamp.sec * _SECOND + message.header.stamp.nanosec
    velocity, effort = (
        np.array([values]) if len(values) == len(joints) else None for values in (message.velocity, message.effort)
    )
    times = np.array([stamp], dtype=np.int64), np.array([log_time], dtype=np.int64)
    return Block(joints, np.array([place]), *times, np.array([message.position]), velocity, effort)


def _choose_topic(
    path: Path,
    topics: dict[str, str],
    blocks: dict[str, list[Block]],
    topic: str | None,
    damages: list[Any],
    findings: list[str],
) -> str:
    """The topic to read; LogError where there is none, with the topics that there are."""
    listed = ", ".join(f"{printable(name)} ({kind})" for name, kind in sorted(topics.items())) or "none"
    counts = {name: sum(len(block.places) for block in found) for name, found in blocks.items()}
    counts = {name: count for name, count in counts.items() if count}
    holding = [name for name, kind in topics.items() if kind in joint_state.NAMES]
    if topic is not None and topic not in counts:
        raise LogError(f"{path}: holds no joint states on the topic {topic}; its topics: {listed}")
    if not counts and holding:
        raise LogError(
            f"{path}: holds no usable message on {printable(', '.join(sorted(holding)))}; record while the robot runs"
        )
    if not counts and not topics and damages:
        raise LogError(f"{path}: was cut or damaged before its first joint state; nothing can be recovered")
    if not counts:
        raise LogError(f"{path}: holds no sensor_msgs/msg/JointState in cdr encoding; its topics: {listed}")
    chosen = topic or (TOPIC if TOPIC in counts else max(sorted(counts), key=counts.__getitem__))
    others = sorted(name for name in counts if name != chosen)
    if others and topic is None:
        left = printable(", ".join(others))
        findings.append(f"joint states come on several topics: {printable(chosen)} was read, {left} left out")
    return chosen


def _assemble(path: Path, blocks: list[Block], wanted: Sequence[str] | None, findings: list[str]) -> Log:
    """One log from blocks of one topic, in file order."""
    groups: dict[frozenset[str], list[Block]] = {}
    for block in blocks:
        groups.setdefault(frozenset(block.joints), []).append(block)
    counts = {names: sum(len(block.places) for block in group) for names, group in groups.items()}
    need = frozenset(wanted or ())
    chosen = max(groups, key=lambda names: (need <= names, len(names), counts[names]))
    for names in groups:
        if names != chosen:
            listed = printable(", ".join(sorted(names)))
            findings.append(f"{counted(counts[names], 'message')} with other joints ({listed}) were left out")
    group = groups[chosen]
    joints = group[0].joints
    if len(chosen) != len(joints):
        raise LogError(f"{path}: its messages name a joint twice ({printable(', '.join(joints))}); mend the publisher")

    places = np.concatenate([block.places for block in group])
    order = np.argsort(places, kind="stable") if (np.diff(places) < 0).any() else slice(None)
    stamp, log_time = (
        np.concatenate([getattr(block, name) for block in group])[order] for name in ("stamp", "log_time")
    )
    time = stamp
    if stamp.max() == stamp.min() and (not stamp[0] or len(stamp) > 1):
        time = log_time
        if stamp[0]:
            findings.append("the header stamps do not run; the time at which messages were recorded stands in")
    velocity, effort = (
        _column(group, joints, name, order) if any(getattr(block, name) is not None for block in group) else None
        for name in ("velocity", "effort")
    )
    position = _column(group, joints, "position", order)
    metadata = {START_TIME: str(int(time[0]))}
    return Log((time - time[0]) / _SECOND, position, velocity, effort, joints, metadata=metadata)


def _column(group: list[Block], joints: tuple[str, ...], name: str, order: Any) -> np.ndarray:
    """(N, n) of one signal in the order of `joints`; NaN where some messages lack it."""
    parts = []
    for block in group:
        values = getattr(block, name)
        if values is None:
            values = np.full(block.position.shape, np.nan)
        elif block.joints != joints:
            values = values[:, [block.joints.index(joint) for joint in joints]]
        parts.append(values)
    return np.concatenate(parts)[order]


def _describe(damages: list[Any], log: Log, blocks: list[Block]) -> list[str]:
    """A sentence for every damage: what was lost, and how far the recording goes."""
    first = min(int(block.log_time[0]) for block in blocks)
    recovered = f"{counted(log.samples, 'sample')} before that recovered, up to {log.time.max():.3f} s"
    sentences = []
    for damage in damages:
        lost = f"{counted(damage.lost_bytes, 'byte')} lost" if damage.lost_bytes else "no sample lost"
        if damage.span is not None:
            start, stop = ((when - first) / _SECOND for when in damage.span)
            lost += f", which spanned {start:.3f} to {stop:.3f} s"
        if damage.cut and damage.lost_bytes:
            sentences.append(f"the file is cut: {damage.reason} at byte {damage.offset}; {recovered}; {lost}")
        elif damage.cut:
            sentences.append(f"the file is cut: {damage.reason}; {recovered}; what followed is not known")
        else:
            sentences.append(f"the file is damaged at byte {damage.offset}: {damage.reason}; {lost}")
    return sentences
