"""Logs and files for the tests of this folder."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from mcap_ros2.writer import Writer

from identify.logs import joint_state
from identify.logs.log import Log

NAMES = ("shoulder", "β", "elbow_3", "w4")
START_NS = 1_700_000_000_123_456_789


def make_log(samples: int = 1500, joints: tuple[str, ...] = NAMES, velocity: bool = True, effort: bool = True) -> Log:
    """A log of unequal joints at 1 kHz, with noise in every bit."""
    rng = np.random.default_rng(7)
    n = len(joints)
    time = np.arange(samples) / 1000
    phase = np.outer(time, 2.0 + np.arange(n)) + rng.uniform(0, 6, n)
    position = np.sin(phase) * (0.5 + np.arange(n)) + rng.normal(size=(samples, n)) * 1e-5
    speed = np.cos(phase) * 1.5 + rng.normal(size=(samples, n)) * 1e-3
    torque = 30 * np.cos(phase) / (1 + np.arange(n)) + rng.normal(size=(samples, n)) * 0.1
    metadata = {"simulated": "true", "noise": "standard", "größe": "7"}
    return Log(time, position, speed if velocity else None, torque if effort else None, joints, metadata=metadata)


def message(log: Log, row: int, stamp_ns: int, order: list[int] | None = None) -> dict:
    """One JointState as mcap-ros2-support takes it, joints in the given order."""
    order = list(range(len(log.joints))) if order is None else order
    return {
        "header": {"stamp": {"sec": stamp_ns // 10**9, "nanosec": stamp_ns % 10**9}, "frame_id": "base_link"},
        "name": [log.joints[j] for j in order],
        "position": [float(log.position[row, j]) for j in order],
        "velocity": [] if log.velocity is None else [float(log.velocity[row, j]) for j in order],
        "effort": [] if log.effort is None else [float(log.effort[row, j]) for j in order],
    }


def write_by_others(
    path: Path,
    messages: list[tuple[str, int, dict]],
    compression: CompressionType = CompressionType.ZSTD,
    chunk_size: int = 1 << 20,
) -> None:
    """Messages (topic, log time, JointState) as mcap-ros2-support writes them."""
    with open(path, "wb") as stream, Writer(stream, chunk_size=chunk_size, compression=compression) as writer:
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", joint_state.DEFINITION)
        for topic, when, content in messages:
            writer.write_message(topic, schema, content, log_time=when)


def write_payloads(
    path: Path,
    payloads: list[tuple[str, int, bytes]],
    type_name: str = "sensor_msgs/msg/JointState",
    encoding: str = "cdr",
    use_chunking: bool = True,
) -> None:
    """Payloads (topic, log time, bytes) in an MCAP of the mcap package's own writer."""
    with open(path, "wb") as stream:
        writer = McapWriter(stream, use_chunking=use_chunking)
        writer.start(profile="ros2")
        schema = writer.register_schema(type_name, "ros2msg", joint_state.DEFINITION.encode())
        channels = {}
        for topic, when, data in payloads:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, encoding, schema)
            writer.add_message(channels[topic], when, data, when)
        writer.finish()


def payload_by_others(content: dict) -> bytes:
    """One JointState as the encoder of mcap-ros2-support writes it."""
    from mcap.reader import NonSeekingReader

    stream = io.BytesIO()
    with Writer(stream) as writer:
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", joint_state.DEFINITION)
        writer.write_message("/x", schema, content, log_time=0)
    stream.seek(0)
    return next(record.data for _, _, record in NonSeekingReader(stream).iter_messages())


def same(a: np.ndarray | None, b: np.ndarray | None) -> bool:
    """Whether two arrays agree in every bit, NaN included, or are both None."""
    if a is None or b is None:
        return a is b
    return a.shape == b.shape and np.ascontiguousarray(a).tobytes() == np.ascontiguousarray(b).tobytes()
