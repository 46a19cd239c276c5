"""Files of other programs are read, and other programs read ours.

rosbags and the Foxglove SDK are the extra `foreign`; without them these tests say that they were left out.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from beside import optional_module
from log_files import NAMES, START_NS, make_log, message, same, write_by_others
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap_ros2.decoder import DecoderFactory

from identify.logs import joint_state
from identify.logs.log import Log
from identify.logs.mcap_writer import write_mcap
from identify.logs.reading import read_log

STEP = 1_000_000


def needed(name: str) -> ModuleType:
    return optional_module(name, "foreign", "what becomes of its files")


def agrees(back: Log, log: Log) -> None:
    assert back.joints == log.joints
    assert same(back.time, log.time)
    for name in ("position", "velocity", "effort"):
        assert same(getattr(back, name), getattr(log, name))
    assert back.findings == ()


def header_time(when: int) -> dict[str, int]:
    return {"sec": when // 10**9, "nanosec": when % 10**9}


def rosbag(folder: Path, logs: dict[str, Log], compressed: str = "none") -> None:
    """A bag that rosbags writes, JointState by its own serializer."""
    needed("rosbags")
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = {name.rsplit("/", 1)[1]: kind for name, kind in store.types.items()}
    writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode[compressed.upper()], CompressionFormat.ZSTD)
    with writer:
        for topic, log in logs.items():
            connection = writer.add_connection(topic, "sensor_msgs/msg/JointState", typestore=store)
            for k in range(log.samples):
                when = START_NS + STEP * k
                stamp = kinds["Time"](**header_time(when))
                content = kinds["JointState"](
                    kinds["Header"](stamp, "base"),
                    list(log.joints),
                    log.position[k],
                    np.empty(0) if log.velocity is None else log.velocity[k],
                    np.empty(0) if log.effort is None else log.effort[k],
                )
                writer.write(connection, when, store.serialize_cdr(content, "sensor_msgs/msg/JointState"))


@pytest.mark.parametrize(("velocity", "effort"), [(True, True), (False, True), (False, False)])
def test_a_bag_of_rosbags(tmp_path: Path, velocity, effort) -> None:
    log = make_log(700, velocity=velocity, effort=effort)
    rosbag(tmp_path / "bag", {"/joint_states": log})
    assert (tmp_path / "bag" / "metadata.yaml").is_file()
    agrees(read_log(tmp_path / "bag"), log)
    (file,) = (tmp_path / "bag").glob("*.mcap")
    agrees(read_log(file), log)


def test_a_bag_of_rosbags_whose_messages_are_compressed_one_by_one(tmp_path: Path) -> None:
    log = make_log(300)
    rosbag(tmp_path / "bag", {"/joint_states": log}, "message")
    agrees(read_log(tmp_path / "bag"), log)


@pytest.mark.parametrize("compression", ["Zstd", "Lz4", None])
@pytest.mark.parametrize("options", [{}, {"use_chunks": False}, {"emit_message_indexes": False, "chunk_size": 10_000}])
def test_cdr_of_the_foxglove_sdk(tmp_path: Path, compression, options) -> None:
    foxglove = needed("foxglove")
    from foxglove.mcap import MCAPCompression, MCAPWriteOptions
    from log_files import payload_by_others

    log = make_log(400)
    chosen = None if compression is None else getattr(MCAPCompression, compression)
    schema = foxglove.Schema(
        name="sensor_msgs/msg/JointState", encoding="ros2msg", data=joint_state.DEFINITION.encode()
    )
    context = foxglove.Context()
    path = tmp_path / "a.mcap"
    settings = MCAPWriteOptions(compression=chosen, profile="ros2", **options)
    with foxglove.open_mcap(str(path), context=context, writer_options=settings):
        channel = foxglove.Channel("/joint_states", message_encoding="cdr", schema=schema, context=context)
        for k in range(log.samples):
            when = START_NS + STEP * k
            channel.log(payload_by_others(message(log, k, when)), log_time=when)
    agrees(read_log(path), log)


def test_json_of_the_foxglove_sdk(tmp_path: Path) -> None:
    foxglove = needed("foxglove")
    log = make_log(200)
    context = foxglove.Context()
    with foxglove.open_mcap(str(tmp_path / "a.mcap"), context=context):
        channel = foxglove.Channel("/joint_states", message_encoding="json", context=context)
        for k in range(log.samples):
            when = START_NS + STEP * k
            content = message(log, k, when)
            content["header"]["stamp"] = {"sec": when // 10**9, "nsec": when % 10**9}
            channel.log(content, log_time=when)
    agrees(read_log(tmp_path / "a.mcap"), log)


def test_joint_states_of_the_foxglove_sdk(tmp_path: Path) -> None:
    """Its own message, in protobuf, where a value may be missing."""
    foxglove = needed("foxglove")
    from foxglove.channels import JointStatesChannel
    from foxglove.messages import JointState, JointStates, Timestamp

    log = make_log(200)
    context = foxglove.Context()
    with foxglove.open_mcap(str(tmp_path / "a.mcap"), context=context):
        channel = JointStatesChannel("/arm", context=context)
        for k in range(log.samples):
            when = START_NS + STEP * k
            rows = zip(log.joints, log.position[k], log.velocity[k], log.effort[k], strict=True)
            joints = [
                JointState(name=name, position=q, velocity=None if name == NAMES[1] else dq, effort=tau)
                for name, q, dq, tau in rows
            ]
            stamp = Timestamp(when // 10**9, when % 10**9)
            channel.log(JointStates(timestamp=stamp, joints=joints), log_time=when + 5)
    back = read_log(tmp_path / "a.mcap")
    assert same(back.time, log.time)
    assert same(back.position, log.position)
    assert same(back.effort, log.effort)
    # A channel that one joint lacks throughout is derived from position altogether.
    assert back.velocity is None
    assert back.findings == ("the velocity is NaN in 100.0 % of the rows; all of it is derived from position",)


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_file_of_mcap_ros2_support(tmp_path: Path, compression) -> None:
    log = make_log(500)
    messages = [("/joint_states", START_NS + STEP * k, message(log, k, START_NS + STEP * k)) for k in range(500)]
    write_by_others(tmp_path / "a.mcap", messages, compression, chunk_size=50_000)
    agrees(read_log(tmp_path / "a.mcap"), log)


@pytest.mark.parametrize(("velocity", "effort"), [(True, True), (False, False)])
def test_rosbags_reads_ours(tmp_path: Path, velocity, effort) -> None:
    needed("rosbags")
    from rosbags.highlevel import AnyReader

    log = make_log(3000, velocity=velocity, effort=effort)
    write_mcap(log, tmp_path / "a.mcap", {"robot.toml": b"x = 1"}, start_ns=START_NS)
    with AnyReader([tmp_path / "a.mcap"]) as reader:
        (connection,) = reader.connections
        assert (connection.topic, connection.msgtype) == ("/joint_states", "sensor_msgs/msg/JointState")
        found = [(when, reader.deserialize(data, connection.msgtype)) for _, when, data in reader.messages()]
    assert [when for when, _ in found] == [START_NS + STEP * k for k in range(log.samples)]
    assert {tuple(content.name) for _, content in found} == {log.joints}
    assert same(np.array([content.position for _, content in found]), log.position)
    for name in ("velocity", "effort"):
        values = getattr(log, name)
        got = np.array([getattr(content, name) for _, content in found])
        assert same(got, np.empty((log.samples, 0)) if values is None else values)


def test_the_reader_of_foxglove_reads_ours_with_every_checksum(tmp_path: Path) -> None:
    """Its SDK for Python writes alone; `mcap`, by the same makers, is its reader."""
    log = make_log(1200)
    write_mcap(log, tmp_path / "a.mcap", {"robot.toml": b"x = 1"}, start_ns=START_NS)
    with open(tmp_path / "a.mcap", "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        found = [content for *_, content in reader.iter_decoded_messages(topics=["/joint_states"])]
    assert same(np.array([content.position for content in found]), log.position)
    assert same(np.array([content.effort for content in found]), log.effort)
