"""A file that was cut, damaged or left by a process that was killed gives back what is whole in it."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from log_files import NAMES, START_NS, make_log, message, payload_by_others, same, write_by_others, write_payloads
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap_ros2.decoder import DecoderFactory

from identify.errors import LogError, OutputError
from identify.logs.files import partial_path
from identify.logs.mcap_reader import read_mcap
from identify.logs.mcap_writer import recording, write_mcap
from identify.logs.recovery import recover

STEP = 1_000_000


def read_by_others(path: Path) -> list:
    """Every message in order of its time, by the mcap package with every checksum looked at."""
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, record.log_time, content) for _, channel, record, content in reader.iter_decoded_messages()
        ]


def chunks_of(path: Path) -> list:
    with open(path, "rb") as stream:
        return make_reader(stream).get_summary().chunk_indexes


@pytest.mark.parametrize("compression", list(CompressionType))
def test_every_message_of_a_cut_file_is_saved_with_its_neighbours(tmp_path: Path, compression) -> None:
    """Two topics, cut in the middle: what others read of the recovered file is what the whole one's chunks held."""
    log, other = make_log(1500), make_log(1500, ("finger",))
    messages = []
    for k in range(1500):
        when = START_NS + k * STEP
        messages += [("/joint_states", when, message(log, k, when)), ("/grip", when + 7, message(other, k, when))]
    whole, cut, saved = (tmp_path / name for name in ("whole.mcap", "cut.mcap", "saved.mcap"))
    write_by_others(whole, messages, compression, chunk_size=20_000)
    data = whole.read_bytes()
    at = len(data) * 2 // 3
    cut.write_bytes(data[:at])
    ends = [c.message_end_time for c in chunks_of(whole) if c.chunk_start_offset + c.chunk_length <= at]
    expected = [entry for entry in read_by_others(whole) if entry[1] <= max(ends)]
    found = recover(cut, saved)
    assert [(topic, when) for topic, when, _ in read_by_others(saved)] == [entry[:2] for entry in expected]
    assert found.messages == len(expected) == sum(found.topics.values())
    assert set(found.topics) == {"/joint_states", "/grip"}
    assert (found.first, found.last) == (START_NS, max(ends))
    (lost,) = found.lost
    assert "the file is cut" in lost
    assert f"{found.messages:,} messages recovered" in lost
    assert read_mcap(saved).log.findings == (
        "joint states come on several topics: /joint_states was read, /grip left out",
    )
    again = recover(saved, tmp_path / "again.mcap")
    assert again.lost == ()
    assert again.messages == found.messages


def test_a_recovered_file_keeps_attachments_provenance_and_every_bit(tmp_path: Path) -> None:
    log = make_log(3000)
    write_mcap(log, tmp_path / "a.mcap", {"robot.toml": b"x = 1"}, start_ns=START_NS)
    data = (tmp_path / "a.mcap").read_bytes()
    (tmp_path / "b.mcap").write_bytes(data[: len(data) - 9])
    found = recover(tmp_path / "b.mcap", tmp_path / "c.mcap")
    assert found.topics == {"/joint_states": 3000}
    assert found.duration == pytest.approx(2.999)
    back = read_mcap(tmp_path / "c.mcap")
    assert back.attachments == {"robot.toml": b"x = 1"}
    assert back.metadata == {"identify": log.metadata}
    for name in ("time", "position", "velocity", "effort"):
        assert same(getattr(back.log, name), getattr(log, name))
    with open(tmp_path / "c.mcap", "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        statistics = reader.get_summary().statistics
        assert (statistics.message_count, statistics.attachment_count, statistics.metadata_count) == (3000, 1, 1)
        assert [(a.name, a.media_type) for a in reader.iter_attachments()] == [("robot.toml", "application/toml")]


def test_messages_outside_of_chunks_are_saved(tmp_path: Path) -> None:
    log = make_log(200)
    stamps = [START_NS + k * STEP for k in range(200)]
    payloads = [("/joint_states", when, payload_by_others(message(log, k, when))) for k, when in enumerate(stamps)]
    write_payloads(tmp_path / "a.mcap", payloads, use_chunking=False)
    (tmp_path / "a.mcap").write_bytes((tmp_path / "a.mcap").read_bytes()[:20_000])
    found = recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert 50 < found.messages < 200
    saved = read_by_others(tmp_path / "b.mcap")
    assert same(np.array([content.effort for *_, content in saved]), log.effort[: found.messages])


def test_a_length_gone_wrong_costs_its_chunk_alone(tmp_path: Path) -> None:
    """A length that claims more or less than there is: the next chunk is found by its own."""
    log = make_log(4000)
    write_mcap(log, tmp_path / "a.mcap", start_ns=START_NS)
    sound = (tmp_path / "a.mcap").read_bytes()
    chunks = chunks_of(tmp_path / "a.mcap")
    when = START_NS + np.arange(4000) * STEP
    for place, value in ((3, 2**50), (3, 300_000), (3, 7), (0, 2**63), (len(chunks) - 1, 2**40)):
        chunk = chunks[place]
        data = bytearray(sound)
        data[chunk.chunk_start_offset + 1 : chunk.chunk_start_offset + 9] = struct.pack("<Q", value)
        (tmp_path / "b.mcap").write_bytes(data)
        kept = (when < chunk.message_start_time) | (when > chunk.message_end_time)
        back = read_mcap(tmp_path / "b.mcap").log
        assert same(back.position, log.position[kept])
        assert any("bytes lost" in finding for finding in back.findings)
        recover(tmp_path / "b.mcap", tmp_path / "c.mcap")
        assert same(read_mcap(tmp_path / "c.mcap").log.effort, log.effort[kept])


@pytest.mark.parametrize("opcode", [0, 1, 2, 3, 4, 5, 7, 8, 9, 11, 12, 15, 0x46, 0x86])
def test_a_chunk_that_is_not_marked_as_one_is_missed(tmp_path: Path, opcode) -> None:
    log = make_log(2500)
    write_mcap(log, tmp_path / "a.mcap", start_ns=START_NS)
    chunk = chunks_of(tmp_path / "a.mcap")[2]
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    data[chunk.chunk_start_offset] = opcode
    (tmp_path / "a.mcap").write_bytes(data)
    when = START_NS + np.arange(2500) * STEP
    kept = (when < chunk.message_start_time) | (when > chunk.message_end_time)
    back = read_mcap(tmp_path / "a.mcap").log
    assert same(back.position, log.position[kept])
    assert any(
        f"damaged at byte {chunk.chunk_start_offset}" in finding or "described nowhere" in finding
        for finding in back.findings
    )


def test_a_lost_first_chunk_takes_no_definitions_with_it(tmp_path: Path) -> None:
    """Other writers describe a channel in its first chunk alone, and again in the index."""
    log = make_log(900)
    messages = [("/joint_states", START_NS + k * STEP, message(log, k, START_NS + k * STEP)) for k in range(900)]
    write_by_others(tmp_path / "a.mcap", messages, chunk_size=30_000)
    first = chunks_of(tmp_path / "a.mcap")[0]
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    data[first.chunk_start_offset + 200] ^= 0xFF
    (tmp_path / "a.mcap").write_bytes(data)
    kept = START_NS + np.arange(900) * STEP > first.message_end_time
    assert same(read_mcap(tmp_path / "a.mcap").log.position, log.position[kept])
    found = recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert found.messages == kept.sum()
    assert len(read_by_others(tmp_path / "b.mcap")) == kept.sum()
    # Cut as well, nothing says what the messages are; that is told, and nothing is written.
    (tmp_path / "c.mcap").write_bytes(data[:-3000])
    with pytest.raises(LogError, match="holds no message that can be read"):
        recover(tmp_path / "c.mcap", tmp_path / "d.mcap")
    assert not list(tmp_path.glob("d.mcap*"))


def test_what_can_not_be_recovered_is_refused(tmp_path: Path) -> None:
    write_mcap(make_log(), tmp_path / "a.mcap")
    (tmp_path / "stub.mcap").write_bytes((tmp_path / "a.mcap").read_bytes()[:300])
    (tmp_path / "table.csv").write_text("t,q1\n0,1\n")
    for name, words in (
        ("none", "there is no such file"),
        ("stub", "nothing can be recovered"),
        ("table", "is not an"),
    ):
        suffix = "csv" if name == "table" else "mcap"
        with pytest.raises(LogError, match=words):
            recover(tmp_path / f"{name}.{suffix}", tmp_path / "out.mcap")
        assert not list(tmp_path.glob("out*"))


def test_a_recorder_writes_the_same_file_however_its_samples_come(tmp_path: Path) -> None:
    log = make_log(2600)
    write_mcap(log, tmp_path / "whole.mcap", {"a.toml": b""}, START_NS)
    rng = np.random.default_rng(5)
    for name in ("one", "many"):
        with recording(
            tmp_path / name, log.joints, metadata=log.metadata, attachments={"a.toml": b""}, start_ns=START_NS
        ) as recorder:
            begin = 0
            while begin < log.samples:
                end = begin + (1 if name == "one" else int(rng.integers(1, 900)))
                part = slice(begin, end)
                recorder.append(log.time[part], log.position[part], log.velocity[part], log.effort[part])
                begin = end
        assert (tmp_path / name).read_bytes() == (tmp_path / "whole.mcap").read_bytes()


def test_slow_recordings_lose_no_more_than_half_a_second_either(tmp_path: Path) -> None:
    log = make_log(3000)
    write_mcap(log.__class__(log.time * 50, log.position, None, None, NAMES), tmp_path / "a.mcap", start_ns=START_NS)
    assert all(chunk.message_end_time - chunk.message_start_time < 0.5e9 for chunk in chunks_of(tmp_path / "a.mcap"))


WRITER = """
import sys, time
import numpy as np
from identify.logs.mcap_writer import recording
with recording(sys.argv[1], ("a", "b"), ("effort",), {"noise": "none"}) as recorder:
    for k in range(10**9):
        q = np.array([[k, -k]], dtype=float)
        recorder.append(np.array([k / 1000]), q, effort=q + 0.5)
        if k % 100 == 0:
            print(k, flush=True)
            time.sleep(0.004)
"""


def killed_writer(path: Path, samples: int) -> int:
    """Kill a writer after about so many samples; how many it had surely taken."""
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        written = 0
        while written < samples:
            written = int(writer.stdout.readline())
        os.kill(writer.pid, signal.SIGKILL)
        return max([written, *(int(word) for word in writer.stdout.read().split())])


def test_a_writer_that_is_killed_leaves_all_but_half_a_second_and_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    write_mcap(make_log(), path)
    old = path.read_bytes()
    for _ in range(3):
        written = killed_writer(path, 3000)
        assert path.read_bytes() == old
        log = read_mcap(partial_path(path)).log
        assert log.samples > written - 500
        assert same(log.position[:, 0], np.arange(log.samples, dtype=float))
        assert same(log.effort, log.position + 0.5)
        assert log.metadata["noise"] == "none"
        assert "is cut" in log.findings[0]
    recover(partial_path(path), tmp_path / "saved.mcap")
    assert same(read_mcap(tmp_path / "saved.mcap").log.position, log.position)
    # The next one starts anew.
    with recording(path, ("a",), ()) as recorder:
        recorder.append(np.arange(20.0), np.ones((20, 1)))
    assert read_mcap(path).log.samples == 20
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["run.mcap", "saved.mcap"]


def test_two_writers_of_one_file_do_not_meet(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with recording(path, ("a",), ()) as recorder:
        recorder.append(np.zeros(1), np.ones((1, 1)))
        with pytest.raises(OutputError, match="another process is writing it"):
            interrupted(path)
        recorder.append(np.ones(1), np.ones((1, 1)))
    assert read_mcap(path).log.samples == 2
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.mcap"]


def test_a_partial_file_is_no_working_file_of_what_is_made_of_it(tmp_path: Path) -> None:
    """Recovered or imported under the name it was to have, it stays as it was."""
    path = tmp_path / "run.mcap"
    write_mcap(make_log(3000), path)
    partial = path.read_bytes()[:-20_000]
    partial_path(path).write_bytes(partial)
    recover(partial_path(path), path)
    assert partial_path(path).read_bytes() == partial
    log = read_mcap(path).log
    assert log.samples == read_mcap(partial_path(path)).log.samples > 1000
    read_mcap(partial_path(path)).log.save(path, force=True)
    assert partial_path(path).read_bytes() == partial
    assert same(read_mcap(path).log.effort, log.effort)


def interrupted(path: Path) -> None:
    with recording(path, ("a",), ()) as recorder:
        recorder.append(np.zeros(1), np.ones((1, 1)))
        raise KeyboardInterrupt


def mismatched(path: Path) -> None:
    with recording(path, ("a",), ()) as recorder:
        recorder.append(np.zeros(1), np.ones((1, 2)))


def test_an_error_while_recording_leaves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with pytest.raises(KeyboardInterrupt):
        interrupted(path)
    with pytest.raises(OutputError, match="samples need position of 1 joints"):
        mismatched(path)
    assert not list(tmp_path.iterdir())
