"""What is written is what other tools read, byte for byte where the format leaves no choice."""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from log_files import NAMES, START_NS, make_log, message, payload_by_others, same
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from identify.errors import OutputError
from identify.logs import joint_state
from identify.logs.log import Log
from identify.logs.mcap_reader import read_mcap
from identify.logs.mcap_writer import DEFAULT_START_NS, write_mcap


@pytest.mark.parametrize(("velocity", "effort"), [(True, True), (False, True), (True, False), (False, False)])
def test_other_tools_read_the_same_values(tmp_path, velocity, effort) -> None:
    log = make_log(velocity=velocity, effort=effort)
    write_mcap(log, tmp_path / "a.mcap", {"robot.toml": b"name = 'x'", "note.bin": b"\0\1"}, start_ns=START_NS)
    with open(tmp_path / "a.mcap", "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        found = list(reader.iter_decoded_messages())
        attachments = {a.name: (a.media_type, a.data) for a in reader.iter_attachments()}
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    (channel,), (schema,) = summary.channels.values(), summary.schemas.values()
    assert (channel.topic, channel.message_encoding) == ("/joint_states", "cdr")
    assert "reliability" in channel.metadata["offered_qos_profiles"]
    assert (schema.name, schema.encoding) == ("sensor_msgs/msg/JointState", "ros2msg")
    assert summary.statistics.message_count == log.samples == len(found)
    assert attachments == {
        "robot.toml": ("application/toml", b"name = 'x'"),
        "note.bin": ("application/octet-stream", b"\0\1"),
    }
    assert metadata == {"identify": log.metadata}

    decoded = [content for *_, content in found]
    stamps = [content.header.stamp.sec * 10**9 + content.header.stamp.nanosec for content in decoded]
    expected = [START_NS + 1_000_000 * k for k in range(log.samples)]
    assert stamps == expected
    assert [record.log_time for _, _, record, _ in found] == expected
    assert [record.sequence for _, _, record, _ in found] == list(range(log.samples))
    assert {tuple(content.name) for content in decoded} == {log.joints}
    assert same(np.array([content.position for content in decoded]), log.position)
    for name, values in (("velocity", log.velocity), ("effort", log.effort)):
        got = np.array([getattr(content, name) for content in decoded])
        assert same(got, np.zeros((log.samples, 0)) if values is None else values)


def test_chunks_lose_less_than_half_a_second_and_their_index_finds_any_time(tmp_path) -> None:
    log = make_log(3000, tuple(f"joint_{j}" for j in range(1, 7)))
    write_mcap(log, tmp_path / "a.mcap", start_ns=START_NS)
    with open(tmp_path / "a.mcap", "rb") as stream:
        reader = make_reader(stream)
        chunks = reader.get_summary().chunk_indexes
        begin, end = START_NS + 1_234_000_000, START_NS + 1_240_000_000
        part = [m.log_time for _, _, m in reader.iter_messages(starting_at=begin, ending_before=end)]
    assert all(64 * 1024 <= chunk.uncompressed_size <= 256 * 1024 for chunk in chunks[:-1])
    assert all(chunk.message_end_time - chunk.message_start_time < 0.5e9 for chunk in chunks)
    assert part == list(range(begin, end, 1_000_000))


def test_every_index_points_at_what_it_says(tmp_path) -> None:
    """Offsets, lengths and checksums, followed with the record classes of the mcap package."""
    log = make_log(1200)
    write_mcap(log, tmp_path / "a.mcap", {"robot.toml": b"x = 1"}, start_ns=START_NS)
    data = (tmp_path / "a.mcap").read_bytes()

    def body(offset: int, opcode: int) -> bytes:
        found, length = struct.unpack_from("<BQ", data, offset)
        assert found == opcode
        return data[offset + 9 : offset + 9 + length]

    def stream(content: bytes) -> ReadDataStream:
        return ReadDataStream(io.BytesIO(content))

    footer_at = len(data) - 8 - 29
    footer = records.Footer.read(stream(body(footer_at, Opcode.FOOTER)))
    # The specification: over the summary and the footer up to the checksum itself.
    assert footer.summary_crc == zlib.crc32(data[footer.summary_start : footer_at + 25])
    with open(tmp_path / "a.mcap", "rb") as file:
        summary = make_reader(file).get_summary()
    seen = 0
    for entry in summary.chunk_indexes:
        assert entry.chunk_length == 9 + len(body(entry.chunk_start_offset, Opcode.CHUNK))
        chunk = records.Chunk.read(stream(body(entry.chunk_start_offset, Opcode.CHUNK)))
        assert entry.compressed_size == len(chunk.data)
        content = zstandard.decompress(chunk.data)
        assert (len(content), zlib.crc32(content)) == (chunk.uncompressed_size, chunk.uncompressed_crc)
        ((_, offset),) = entry.message_index_offsets.items()
        index = records.MessageIndex.read(stream(body(offset, Opcode.MESSAGE_INDEX)))
        for when, at in index.records:
            opcode, length = struct.unpack_from("<BQ", content, at)
            assert opcode == Opcode.MESSAGE
            message = records.Message.read(stream(content[at + 9 : at + 9 + length]), length)
            assert (message.log_time, message.sequence) == (when, seen)
            seen += 1
    assert seen == log.samples
    (attachment,) = summary.attachment_indexes
    assert len(body(attachment.offset, Opcode.ATTACHMENT)) == attachment.length - 9
    (metadata,) = summary.metadata_indexes
    assert len(body(metadata.offset, Opcode.METADATA)) == metadata.length - 9


@settings(max_examples=60, deadline=None)
@given(
    joints=st.lists(
        st.text(st.characters(exclude_characters="\0", codec="utf-8"), min_size=1, max_size=9),
        unique=True,
        min_size=1,
        max_size=5,
    ),
    velocity=st.booleans(),
    effort=st.booleans(),
    stamp=st.integers(0, 2**31 * 10**9 - 1),
    data=st.data(),
)
def test_a_message_is_what_another_encoder_makes_of_it(joints, velocity, effort, stamp, data) -> None:
    """The alignment of CDR, for names of every length: against the encoder of mcap-ros2-support."""
    numbers = st.lists(st.floats(width=64), min_size=len(joints), max_size=len(joints))
    rows = [np.array([data.draw(numbers)]) for _ in range(3)]
    log = Log(np.zeros(1), rows[0], rows[1] if velocity else None, rows[2] if effort else None, tuple(joints))
    content = message(log, 0, stamp)
    content["header"]["frame_id"] = ""
    known = joint_state.layout(log.joints, velocity, effort)
    mine = np.empty((1, known.template.size), dtype=np.uint8)
    values = {"position": log.position, "velocity": log.velocity, "effort": log.effort}
    joint_state.encode(known, mine, np.array([stamp]), values)
    assert mine.tobytes() == payload_by_others(content)
    assert joint_state.stamps(joint_state.rows(known, mine)).tolist() == [stamp]


@settings(max_examples=30, deadline=None)
@given(
    values=st.lists(st.lists(st.floats(width=64), min_size=3, max_size=3), min_size=1, max_size=20),
    nanoseconds=st.lists(st.integers(0, 10**15), min_size=20, max_size=20, unique=True).map(sorted),
)
def test_a_round_trip_keeps_every_bit(tmp_path_factory, values, nanoseconds) -> None:
    path = tmp_path_factory.getbasetemp() / "bits.mcap"
    position = np.array(values)
    time = (np.array(nanoseconds[: len(values)]) - nanoseconds[0]) / 1e9
    log = Log(time, position, -position, position[::-1], ("a", "bb", "ccc"), metadata={"k": "v\n=;"})
    write_mcap(log, path, start_ns=START_NS)
    back = read_mcap(path).log
    assert back.joints == log.joints
    assert back.metadata == {**log.metadata, "start_time_ns": str(START_NS)}
    assert not back.findings
    for name in ("time", "position", "velocity", "effort"):
        assert same(getattr(back, name), getattr(log, name))


def test_the_same_log_makes_the_same_bytes_and_keeps_its_start(tmp_path) -> None:
    log = make_log()
    write_mcap(log, tmp_path / "a.mcap")
    write_mcap(log, tmp_path / "b.mcap")
    first = (tmp_path / "a.mcap").read_bytes()
    assert first == (tmp_path / "b.mcap").read_bytes()
    back = read_mcap(tmp_path / "a.mcap").log
    assert back.metadata["start_time_ns"] == str(DEFAULT_START_NS)
    write_mcap(back, tmp_path / "c.mcap")
    assert first == (tmp_path / "c.mcap").read_bytes()


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(b"old")
    with pytest.raises(TypeError):
        write_mcap(make_log(), path, {"robot.toml": object()})
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.mcap"]


@pytest.mark.parametrize(
    ("target", "start", "words"),
    [
        ("missing/a.mcap", None, "does not exist"),
        (".", None, "is a folder"),
        ("a.mcap", 2**31 * 10**9 - 5, "do not fit a ROS 2 stamp"),
    ],
)
def test_where_it_can_not_write_it_says_why(tmp_path, target, start, words) -> None:
    with pytest.raises(OutputError, match=words) as caught:
        write_mcap(make_log(), tmp_path / target, start_ns=start)
    assert "\n" not in str(caught.value)
    assert not [entry for entry in tmp_path.iterdir() if entry.is_file()]


def test_a_log_without_samples_is_not_written(tmp_path) -> None:
    empty = Log(np.empty(0), np.empty((0, 4)), None, None, NAMES)
    with pytest.raises(OutputError, match="no samples"):
        write_mcap(empty, tmp_path / "a.mcap")
