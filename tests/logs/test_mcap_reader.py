"""Files of any writer, in any order, whole or cut: every joint state that is there is read."""

from __future__ import annotations

import re
import struct

import numpy as np
import pytest
from log_files import NAMES, START_NS, make_log, message, payload_by_others, same, write_by_others, write_payloads
from mcap.reader import make_reader
from mcap.writer import CompressionType

from identify.errors import LogError
from identify.logs import joint_state
from identify.logs.mcap_reader import read_mcap
from identify.logs.mcap_writer import write_mcap
from identify.logs.slicing import select

STEP = 1_000_000


def stamps(count: int) -> list[int]:
    return [START_NS + STEP * k for k in range(count)]


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("channels", [(True, True), (False, True), (False, False)])
def test_files_of_another_writer(tmp_path, compression, channels) -> None:
    log = make_log(400, velocity=channels[0], effort=channels[1])
    messages = [("/joint_states", when, message(log, k, when)) for k, when in enumerate(stamps(400))]
    write_by_others(tmp_path / "a.mcap", messages, compression, chunk_size=20_000)
    back = read_mcap(tmp_path / "a.mcap").log
    assert back.joints == NAMES
    assert back.findings == ()
    for name in ("time", "position", "velocity", "effort"):
        assert same(getattr(back, name), getattr(log, name))


def test_a_file_without_chunks(tmp_path) -> None:
    log = make_log(300)
    payloads = [("/joint_states", when, payload_by_others(message(log, k, when))) for k, when in enumerate(stamps(300))]
    write_payloads(tmp_path / "a.mcap", payloads, use_chunking=False)
    back = read_mcap(tmp_path / "a.mcap").log
    assert same(back.position, log.position)
    assert same(back.effort, log.effort)
    assert back.findings == ()


def test_the_order_of_joints_may_change_and_is_put_right(tmp_path) -> None:
    """The broadcaster restarted and names its joints otherwise; both orders alternate too."""
    log = make_log(90)
    orders = [[0, 1, 2, 3]] * 30 + [[2, 0, 3, 1]] * 30 + [[0, 1, 2, 3], [3, 2, 1, 0]] * 15
    messages = [("/joint_states", when, message(log, k, when, orders[k])) for k, when in enumerate(stamps(90))]
    write_by_others(tmp_path / "a.mcap", messages)
    back = read_mcap(tmp_path / "a.mcap").log
    assert back.joints == NAMES
    for name in ("time", "position", "velocity", "effort"):
        assert same(getattr(back, name), getattr(log, name))
    wanted = ("w4", "shoulder")
    part = select(back, wanted)
    assert part.joints == wanted
    assert same(part.effort, log.effort[:, [3, 0]])
    with pytest.raises(LogError, match=r"no joint 'wrist'; it has shoulder, β, elbow_3, w4"):
        select(back, ("shoulder", "wrist"))


def test_two_publishers_and_other_topics_in_between(tmp_path) -> None:
    arm, gripper = make_log(200), make_log(200, ("finger",))
    messages = []
    for k, when in enumerate(stamps(200)):
        messages.append(("/joint_states", when, message(arm, k, when)))
        messages.append(("/joint_states", when + 10, message(gripper, k, when)))
        messages.append(("/commands", when + 20, message(gripper, k, when)))
    write_by_others(tmp_path / "a.mcap", messages)
    recording = read_mcap(tmp_path / "a.mcap")
    assert recording.topics == dict.fromkeys(("/joint_states", "/commands"), "sensor_msgs/msg/JointState")
    assert same(recording.log.position, arm.position)
    assert recording.log.findings == (
        "joint states come on several topics: /joint_states was read, /commands left out",
        "200 messages with other joints (finger) were left out",
    )
    assert same(read_mcap(tmp_path / "a.mcap", joints=["finger"]).log.effort, gripper.effort)
    assert same(read_mcap(tmp_path / "a.mcap", topic="/commands").log.effort, gripper.effort)
    with pytest.raises(
        LogError, match=r"topic /x; its topics: /commands \(sensor_msgs/msg/JointState\), /joint_states"
    ):
        read_mcap(tmp_path / "a.mcap", topic="/x")


@pytest.mark.parametrize(("stamp", "finding"), [(0, False), (5 * 10**9, True)])
def test_log_time_stands_in_for_stamps_that_do_not_run(tmp_path, stamp, finding) -> None:
    log = make_log(50)
    messages = [("/joint_states", START_NS + 3 * STEP * k, message(log, k, stamp)) for k in range(50)]
    write_by_others(tmp_path / "a.mcap", messages)
    back = read_mcap(tmp_path / "a.mcap").log
    assert same(back.time, 3 * np.arange(50) / 1000)
    assert bool(back.findings) == finding


def test_header_stamps_win_over_log_time(tmp_path) -> None:
    log = make_log(50)
    jitter = np.random.default_rng(1).integers(0, STEP, 50)
    messages = [
        ("/joint_states", when + int(late), message(log, k, when))
        for k, (when, late) in enumerate(zip(stamps(50), jitter, strict=True))
    ]
    write_by_others(tmp_path / "a.mcap", messages)
    assert same(read_mcap(tmp_path / "a.mcap").log.time, log.time)


def big_endian(log, row: int, stamp_ns: int) -> bytes:
    """One JointState in big-endian CDR, written out by hand."""
    out = bytearray(b"\x00\x00\x00\x00" + struct.pack(">iI", stamp_ns // 10**9, stamp_ns % 10**9))

    def count(value: int) -> None:
        out.extend(bytes(-len(out) % 4) + struct.pack(">I", value))

    count(1)
    out.extend(b"\0")
    count(len(log.joints))
    for name in log.joints:
        count(len(name.encode()) + 1)
        out.extend(name.encode() + b"\0")
    for values in (log.position, log.velocity, log.effort):
        count(len(log.joints))
        out.extend(bytes(-(len(out) - 4) % 8) + struct.pack(f">{len(log.joints)}d", *values[row]))
    return bytes(out)


def test_messages_that_are_not_regular_go_one_by_one(tmp_path) -> None:
    """Big-endian ones, some whose effort is too short, some cut short, between regular ones."""
    log = make_log(40)
    payloads = []
    for k, when in enumerate(stamps(40)):
        content = message(log, k, when)
        if k % 4 == 1:
            data = big_endian(log, k, when)
        elif k % 4 == 2:
            content["effort"] = content["effort"][:2]
            data = payload_by_others(content)
        else:
            data = payload_by_others(content)
        payloads.append(("/joint_states", when, data[:50] if k == 7 else data))
    write_payloads(tmp_path / "a.mcap", payloads)
    back = read_mcap(tmp_path / "a.mcap").log
    rest = np.arange(40) != 7
    assert same(back.position, log.position[rest])
    assert same(back.velocity, log.velocity[rest])
    short = (np.arange(40) % 4 == 2)[rest]
    assert np.isnan(back.effort[short]).all()
    assert same(back.effort[~short], log.effort[rest][~short])
    assert back.findings == ("1 joint state message could not be decoded and not used",)


def test_padding_may_hold_anything() -> None:
    """Some serialisers leave in the gaps whatever was there before."""
    log = make_log(3)
    clean = [payload_by_others(message(log, k, START_NS + k)) for k in range(3)]
    known = joint_state.parse(clean[0])
    rows = np.array([list(payload) for payload in clean], dtype=np.uint8)
    data = np.zeros(known.template.size, dtype=bool)
    for name in known.fields.names:
        kind, offset = known.fields.fields[name][:2]
        data[offset : offset + kind.itemsize] = True
    gaps = ~data & (known.constant == 0)
    assert gaps.sum() > 3
    rows[:, gaps] = np.random.default_rng(2).integers(1, 256, (3, gaps.sum()))
    assert joint_state.matches(known, rows).all()
    assert same(joint_state.rows(joint_state.parse(rows[1].tobytes()), rows)["position"], log.position[:3])
    rows[2, known.fields.fields["position"][1] - 12] ^= 1
    assert joint_state.matches(known, rows).tolist() == [True, True, False]


def test_a_cut_file_gives_every_complete_chunk(tmp_path) -> None:
    """Cut at 200 random bytes; what must be there is known from the whole file's index, read by the mcap package."""
    log = make_log(9000)
    write_mcap(log, tmp_path / "whole.mcap", {"robot.toml": b"x = 1"}, start_ns=START_NS)
    data = (tmp_path / "whole.mcap").read_bytes()
    with open(tmp_path / "whole.mcap", "rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    ends = [(c.chunk_start_offset + c.chunk_length, c.message_end_time) for c in chunks]
    assert len(ends) >= 10
    first_chunk, end_of_data = ends[0][0], ends[-1][0]
    cuts = np.random.default_rng(3).integers(len(b"12345678") + 1, len(data), 200)
    cut_path = tmp_path / "cut.mcap"
    endings = set()
    for cut in [*cuts.tolist(), first_chunk - 1, first_chunk, end_of_data, end_of_data - 1, len(data) - 1]:
        cut_path.write_bytes(data[:cut])
        complete = [end for at, end in ends if at <= cut]
        if not complete:
            with pytest.raises(LogError, match="cut or damaged before its first joint state"):
                read_mcap(cut_path)
            continue
        expected = (complete[-1] - START_NS) // STEP + 1
        back = read_mcap(cut_path)
        assert back.log.samples == expected
        assert same(back.log.position, log.position[:expected])
        assert same(back.log.effort, log.effort[:expected])
        assert back.attachments == {"robot.toml": b"x = 1"}
        (finding,) = back.log.findings
        lost = re.search(r"inside a (chunk|record) at byte (\d+); (.*); ([\d,]+) bytes? lost", finding)
        if lost:
            assert complete_at(ends, cut) <= int(lost[2])
            assert int(lost[2]) + int(lost[4].replace(",", "")) == cut
            assert f"{expected:,} sample" in lost[3]
            assert f"up to {(expected - 1) / 1000:.3f} s" in lost[3]
            endings.add(lost[1])
        else:
            assert "what followed is not known" in finding or (expected == log.samples and "no sample lost" in finding)
            endings.add("boundary")
    assert endings == {"chunk", "record", "boundary"}


def complete_at(ends: list[tuple[int, int]], cut: int) -> int:
    """Where the last chunk ends that lies whole before the cut."""
    return max(at for at, _ in ends if at <= cut)


def test_a_damaged_chunk_costs_that_chunk_alone(tmp_path) -> None:
    log = make_log(4000)
    write_mcap(log, tmp_path / "a.mcap", start_ns=START_NS)
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    with open(tmp_path / "a.mcap", "rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    middle = chunks[3]
    data[middle.chunk_start_offset + middle.chunk_length // 2] ^= 0xFF
    (tmp_path / "a.mcap").write_bytes(data)
    back = read_mcap(tmp_path / "a.mcap").log
    when = START_NS + np.arange(4000) * STEP
    kept = (when < middle.message_start_time) | (when > middle.message_end_time)
    assert 0 < (~kept).sum() < 1000
    assert same(back.position, log.position[kept])
    (finding,) = back.findings
    begin, end = ((t - START_NS) / 1e9 for t in (middle.message_start_time, middle.message_end_time))
    assert f"the file is damaged at byte {middle.chunk_start_offset}" in finding
    assert f"spanned {begin:.3f} to {end:.3f} s" in finding


def test_no_change_of_a_byte_brings_a_traceback(tmp_path) -> None:
    """300 mutations: a log, or a LogError of one line."""
    write_mcap(make_log(600), tmp_path / "a.mcap", {"robot.toml": b"x = 1"})
    data = (tmp_path / "a.mcap").read_bytes()
    rng = np.random.default_rng(4)
    read, messages = 0, []
    for _ in range(300):
        broken = bytearray(data)
        for _ in range(rng.integers(1, 6)):
            at = (
                int(rng.integers(8, min(len(broken), 1500)))
                if rng.random() < 0.5
                else int(rng.integers(8, len(broken)))
            )
            broken[at] = int(rng.integers(256))
        (tmp_path / "b.mcap").write_bytes(broken)
        try:
            read += read_mcap(tmp_path / "b.mcap").log.samples > 0
        except LogError as error:
            messages.append(str(error))
    assert read > 100
    assert messages
    assert all(text.isprintable() for text in messages)


def test_a_file_without_joint_states_lists_its_topics(tmp_path) -> None:
    write_payloads(tmp_path / "a.mcap", [("/imu", 5, b"\0\1\0\0")], type_name="sensor_msgs/msg/Imu")
    with pytest.raises(LogError, match=r"no sensor_msgs/msg/JointState .* its topics: /imu \(sensor_msgs/msg/Imu\)"):
        read_mcap(tmp_path / "a.mcap")
    write_payloads(tmp_path / "b.mcap", [("/joint_states", 5, b"\0\1\0\0")])
    with pytest.raises(LogError, match="no usable message on /joint_states"):
        read_mcap(tmp_path / "b.mcap")
    write_payloads(tmp_path / "c.mcap", [])
    with pytest.raises(LogError, match="its topics: none"):
        read_mcap(tmp_path / "c.mcap")
