"""MCAP files with joint states, from whatever recorder, as a Log.

Messages of constant length are decoded in bulk; anything else one by one.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from identify.errors import LogError
from identify.logs import joint_state
from identify.logs.damage import Damage, describe
from identify.logs.joint_blocks import blocks_of
from identify.logs.joint_messages import KNOWN, UNCERTAIN, Kind, kind_of
from identify.logs.joint_series import Block, Series
from identify.logs.log import KEPT, START_TIME, Log
from identify.logs.mcap_writer import PROVENANCE, TOPIC
from identify.logs.slicing import no_such_joint
from identify.logs.wording import counted, listed, printable

_SERIES_KEPT = 256
_UNPACKED = 4


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


@dataclass(eq=False)
class _Gathered:
    """What has been read so far. series: (topic, names) → its joint states; unreadable, untold: messages."""

    wanted: frozenset[str]
    topic: str | None
    order: tuple[str, ...]
    skip: tuple[str, ...]
    series: dict[tuple[str, frozenset[str]], Series] = field(default_factory=dict)
    topics: dict[str, str] = field(default_factory=dict)
    kinds: dict[str, bool] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    damages: list[Damage] = field(default_factory=list)
    several: bool = False
    unreadable: int = 0
    untold: int = 0
    strangers: int = 0
    total_bytes: int = 1
    read_bytes: int = 0
    done_bytes: int = 0


def read_mcap(
    path: str | os.PathLike[str],
    topic: str | None = None,
    joints: Sequence[str] | None = None,
    skip: Sequence[str] = (),
) -> Recording:
    """Read the joint states of an MCAP file, and what is attached to it. See read_files."""
    return read_files([Path(path)], Path(path), topic, joints, skip)


def read_files(
    paths: Sequence[Path],
    source: Path,
    topic: str | None = None,
    joints: Sequence[str] | None = None,
    skip: Sequence[str] = (),
) -> Recording:
    """Read the joint states of MCAP files that continue one another, `source` by name.

    topic: which one to read. joints: names wanted, the log's joints then, in this order; by default all that a
    publisher names. Of several publishers one that has the joints is taken: rather joint states than a controller's,
    rather /joint_states than another topic, then the one with the most messages. skip: channels (velocity,
    effort) that are not wanted. A cut or damaged file gives every complete chunk, and a finding that counts what
    was lost. Time counts from the first message, by the header stamps, or by log time where they do not run.
    Raises LogError where there are no joint states, or not those wanted.
    """
    for path in paths:
        _refuse_other(path)
    found = _Gathered(frozenset(joints or ()), topic, tuple(joints or ()), tuple(skip))
    found.several = len(paths) > 1
    found.total_bytes = sum(path.stat().st_size for path in paths)
    for path in paths:
        _gather(path, found)
        found.done_bytes += path.stat().st_size
    findings: list[str] = []
    if found.unreadable:
        findings.append(f"{counted(found.unreadable, 'joint state message')} could not be decoded and not used")
    if found.strangers:
        left = counted(found.strangers, "message")
        findings.append(f"{left} of channels that are described nowhere could not be used")
    chosen = _choose(source, found, findings)
    log = _assemble(chosen, findings)
    recovered = f"{counted(log.samples, 'sample')} before that recovered, up to {log.time.max():.3f} s"
    told = describe(found.damages, recovered, chosen.first_log_time)
    provenance = {**found.metadata.get(PROVENANCE, {}), **log.metadata}
    log = Log(
        log.time,
        log.position,
        log.velocity,
        log.effort,
        log.joints,
        str(source),
        findings=(*told, *findings),
        metadata=provenance,
        attachments={name: found.attachments[name] for name in KEPT if name in found.attachments},
    )
    return Recording(log, found.attachments, found.metadata, found.topics)


def _refuse_other(path: Path) -> None:
    from identify.logs.mcap_records import is_mcap

    if not is_mcap(path):
        raise LogError(f"{path}: is not an MCAP file (it does not start as one); a table needs the suffix .csv or .npz")


def _gather(path: Path, found: _Gathered) -> None:
    """Take in one file."""
    from mcap.records import Attachment, Channel, Metadata, Schema

    from identify.logs.mcap_content import Batch
    from identify.logs.mcap_records import records

    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    kinds: dict[int, Kind | None] = {}
    layouts: dict[int, list[joint_state.Layout]] = {}
    proven: set[int] = set()
    for item in records(path):
        match item:
            case Batch():
                found.read_bytes = found.done_bytes + item.stop
                numbers = item.channels
                first = int(numbers[0]) if len(numbers) else 0
                alone = bool(len(numbers)) and bool((numbers == first).all())
                for number in [first] if alone else np.unique(numbers).tolist():
                    kind = kinds.get(number)
                    if number not in channels:
                        found.strangers += int((numbers == number).sum())
                    if kind is None or (found.topic and channels[number].topic != found.topic):
                        continue
                    if kind.rank == UNCERTAIN and number not in proven:
                        if kind.decode(item.payload(int((numbers == number).argmax()))) is None:
                            kinds[number] = None
                            continue
                        proven.add(number)
                    which = None if alone else np.flatnonzero(numbers == number)
                    _take_in(item, which, channels[number].topic, kind, layouts.setdefault(number, []), found)
            case Schema():
                schemas[item.id] = item
            case Channel():
                channels[item.id] = item
                schema = schemas.get(item.schema_id)
                kinds[item.id] = kind_of(item, schema)
                found.topics[item.topic] = printable(schema.name) if schema and schema.name else "no type"
                kind = kinds[item.id]
                found.kinds[item.topic] = kind is not None and kind.rank != UNCERTAIN
            case Attachment():
                found.attachments[item.name] = item.data
            case Metadata():
                found.metadata.setdefault(item.name, {}).update(item.metadata)
            case Damage():
                found.damages.append(replace(item, file=path.name) if found.several else item)


def _take_in(
    batch: Any, which: np.ndarray | None, topic: str, kind: Kind, layouts: list[joint_state.Layout], found: _Gathered
) -> None:
    """Add the messages of one channel, at `which` in the batch or all, to their series in the order of the file."""
    from identify.logs.mcap_content import MESSAGE_HEAD

    log_times = batch.log_times.view(np.int64)
    blocks: list[tuple[np.ndarray, Block | None]] = []
    if which is None and batch.grid is not None:
        blocks = blocks_of(batch.grid[:, MESSAGE_HEAD:], np.arange(len(log_times)), log_times, kind, layouts)
    else:
        which = np.arange(len(log_times)) if which is None else which
        lengths = batch.lengths[which]
        for length in np.unique(lengths).tolist():
            mine = which[lengths == length]
            payloads = batch.rows(mine, length)[:, MESSAGE_HEAD:]
            blocks.extend(blocks_of(payloads, mine, log_times[mine], kind, layouts))
    by_names: dict[frozenset[str], list[tuple[np.ndarray, Block]]] = {}
    for places, block in blocks:
        if block is None or len(set(block.joints)) != len(block.joints):
            found.unreadable += len(places)
        else:
            by_names.setdefault(frozenset(block.joints), []).append((places, block))
    for names, parts in by_names.items():
        series = _series(topic, kind, names, parts[0][1].joints, found)
        if series is None:
            found.untold += sum(len(places) for places, _ in parts)
            continue
        share = found.read_bytes / found.total_bytes
        # What a few messages let expect of a file is never taken for more than it could hold.
        most = _UNPACKED * found.total_bytes // (8 * (2 + 3 * len(series.joints or ())))
        for block in _in_order(parts):
            series.add(block, share, most)


def _series(topic: str, kind: Kind, names: frozenset[str], joints: tuple[str, ...], found: _Gathered) -> Series | None:
    """The series of this publisher; None where there are more than anyone has."""
    if (topic, names) not in found.series:
        if len(found.series) == _SERIES_KEPT:
            return None
        keep = joints if not found.wanted else found.order if found.wanted <= names else None
        found.series[topic, names] = Series(topic, kind.rank, joints, keep, found.skip)
    return found.series[topic, names]


def _in_order(parts: list[tuple[np.ndarray, Block]]) -> list[Block]:
    """The blocks cut so that their messages come in the order of the file."""
    if len(parts) == 1:
        return [parts[0][1]]
    places = np.concatenate([place for place, _ in parts])
    owner = np.concatenate([np.full(len(place), k) for k, (place, _) in enumerate(parts)])
    row = np.concatenate([np.arange(len(place)) for place, _ in parts])
    order = np.argsort(places, kind="stable")
    owner, row = owner[order], row[order]
    # Neighbours of one block stay together.
    cuts = np.flatnonzero(np.diff(owner)) + 1
    return [_rows(parts[int(owner[run[0]])][1], row[run]) for run in np.split(np.arange(len(order)), cuts)]


def _rows(block: Block, which: np.ndarray) -> Block:
    pick = slice(int(which[0]), int(which[-1]) + 1)
    velocity, effort = (None if values is None else values[pick] for values in (block.velocity, block.effort))
    return Block(block.joints, block.stamp[pick], block.log_time[pick], block.position[pick], velocity, effort)


def _choose(source: Path, found: _Gathered, findings: list[str]) -> Series:
    """The publisher to read, and findings on those left out; LogError where there is none."""
    every = list(found.series.values())
    if not every:
        raise LogError(_nothing(source, found))
    counts: dict[str, int] = {}
    for series in every:
        counts[series.topic] = counts.get(series.topic, 0) + series.samples

    def order(series: Series) -> tuple[Any, ...]:
        # Where the joints are known, what else a publisher names is no merit.
        names = 0 if found.wanted else len(series.publishes)
        topic = (series.topic == TOPIC, counts[series.topic], series.topic)
        return series.joints is not None, -series.rank, *topic, names, series.samples

    chosen = max(every, key=order)
    if chosen.joints is None:
        raise no_such_joint(str(source), found.order, chosen.publishes)
    others = sorted(topic for topic in counts if topic != chosen.topic)
    if others:
        findings.append(
            f"joint states come on several topics: {printable(chosen.topic)} was read, {listed(others)} left out"
        )
    for series in every:
        if series.topic == chosen.topic and series is not chosen:
            left = f"{counted(series.samples, 'message')} with other joints ({listed(sorted(series.publishes))})"
            findings.append(f"{left} were left out")
    if found.untold:
        findings.append(f"{counted(found.untold, 'message')} of ever more joints were left out")
    return chosen


def _nothing(source: Path, found: _Gathered) -> str:
    """Why there is nothing to choose from."""
    topics = ", ".join(f"{printable(name)} ({kind})" for name, kind in sorted(found.topics.items())) or "none"
    holding = sorted(name for name, known in found.kinds.items() if known)
    if found.topic is not None and found.topic not in holding:
        return f"{source}: holds no joint states on the topic {printable(found.topic)}; its topics: {topics}"
    if holding:
        return f"{source}: holds no usable message on {listed(holding)}; record while the robot runs"
    if found.damages and not found.topics:
        return f"{source}: was cut or damaged before its first joint state; nothing can be recovered"
    return f"{source}: holds no {KNOWN}; its topics: {topics}"


def _assemble(series: Series, findings: list[str]) -> Log:
    """The series as a log, not yet cleaned."""
    assert series.joints is not None, "a series without its joints is never chosen"
    stamp, log_time = series.times("stamp"), series.times("log_time")
    clock = "stamp"
    if stamp.max() == stamp.min() and (not stamp[0] or len(stamp) > 1):
        clock = "log_time"
        if stamp[0]:
            findings.append("the header stamps do not run; the time at which messages were recorded stands in")
    metadata = {START_TIME: str(int((stamp if clock == "stamp" else log_time)[0]))}
    position = series.take("position")
    assert position is not None, "every message has positions"
    velocity, effort = series.take("velocity"), series.take("effort")
    del stamp, log_time
    return Log(series.take_seconds(clock), position, velocity, effort, series.joints, metadata=metadata)
