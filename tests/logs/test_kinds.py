"""Joint states of every kind and from every publisher: the right ones are read, and what was left out is said."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from log_files import NAMES, START_NS, make_log, message, same, write_by_others, write_payloads
from mcap.writer import Writer as McapWriter
from mcap_ros2.writer import Writer

from identify.errors import LogError
from identify.logs import joint_messages, joint_state
from identify.logs.log import Log
from identify.logs.mcap_reader import read_mcap
from identify.logs.mcap_writer import write_mcap
from identify.logs.reading import read_log

STEP = 1_000_000
CONTROLLER = "control_msgs/msg/JointTrajectoryControllerState"
POINT = "trajectory_msgs/JointTrajectoryPoint"


def controller_definition(names: list[str], tail: str = "") -> str:
    """The definition with its points called so; tail: fields that follow them."""
    header, clock = joint_state.DEFINITION.split("=" * 80)[1:]
    parts = [
        f"std_msgs/Header header\nstring[] joint_names\n{''.join(f'{POINT} {name}' + chr(10) for name in names)}{tail}",
        header,
        clock,
        f"\nMSG: {POINT}\nfloat64[] positions\nfloat64[] velocities\nfloat64[] accelerations\nfloat64[] effort\n"
        "builtin_interfaces/Duration time_from_start\n",
        "\nMSG: builtin_interfaces/Duration\nint32 sec\nuint32 nanosec\n",
    ]
    return ("=" * 80).join(parts)


def point(position: np.ndarray, velocity: np.ndarray | None, effort: np.ndarray | None) -> dict:
    columns = {"positions": position, "velocities": velocity, "effort": effort}
    lists = {name: [] if values is None else values.tolist() for name, values in columns.items()}
    return {**lists, "accelerations": [], "time_from_start": {"sec": 3, "nanosec": 7}}


def write_controller(path: Path, log: Log, names: list[str], tail: str = "", extra: dict | None = None) -> None:
    """The log as the measured point of a controller's state; the point asked for is another."""
    with open(path, "wb") as stream, Writer(stream) as writer:
        schema = writer.register_msgdef(CONTROLLER, controller_definition(names, tail))
        for k in range(log.samples):
            when = START_NS + STEP * k
            measured = point(
                log.position[k],
                None if log.velocity is None else log.velocity[k],
                None if log.effort is None else log.effort[k],
            )
            others = {name: point(log.position[k] + 1, np.full(len(log.joints), 7.0), None) for name in names}
            content = {**others, names[1]: measured, "joint_names": list(log.joints), **(extra or {})}
            content["header"] = message(log, k, when)["header"]
            writer.write_message("/controller/state", schema, content, log_time=when + 9)


@pytest.mark.parametrize("names", [["desired", "actual", "error"], ["reference", "feedback", "error", "output"]])
@pytest.mark.parametrize("channels", [(True, True), (True, False), (False, False)])
def test_the_measured_point_of_a_controllers_state(tmp_path: Path, names, channels) -> None:
    log = make_log(300, velocity=channels[0], effort=channels[1])
    write_controller(tmp_path / "a.mcap", log, names)
    back = read_mcap(tmp_path / "a.mcap").log
    assert back.joints == log.joints
    for name in ("time", "position", "velocity", "effort"):
        assert same(getattr(back, name), getattr(log, name))
    assert back.findings == ()


def test_a_controllers_state_in_bulk_is_what_it_is_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = make_log(200)
    tail = "string[] multi_dof_joint_names\n"
    write_controller(tmp_path / "a.mcap", log, ["reference", "feedback"], tail, {"multi_dof_joint_names": ["x"]})
    asked = []
    one_by_one = joint_messages._of_point
    monkeypatch.setattr(joint_messages, "_of_point", lambda *given: asked.append(1) or one_by_one(*given))
    bulk = read_mcap(tmp_path / "a.mcap").log
    assert not asked
    monkeypatch.setattr(joint_state, "parse_controller_state", lambda data: None)
    single = read_mcap(tmp_path / "a.mcap").log
    assert len(asked) == 200
    for name in ("time", "position", "velocity", "effort"):
        assert same(getattr(bulk, name), getattr(single, name))
        assert same(getattr(bulk, name), getattr(log, name))


def test_joint_states_come_before_a_controllers_unless_they_lack_the_joints(tmp_path: Path) -> None:
    arm, gripper = make_log(100), make_log(100, ("finger",))
    path = tmp_path / "a.mcap"
    with open(path, "wb") as stream, Writer(stream) as writer:
        states = writer.register_msgdef("sensor_msgs/msg/JointState", joint_state.DEFINITION)
        control = writer.register_msgdef(CONTROLLER, controller_definition(["desired", "actual"]))
        for k in range(100):
            when = START_NS + STEP * k
            writer.write_message("/gripper", states, message(gripper, k, when), log_time=when)
            measured = point(arm.position[k], arm.velocity[k], arm.effort[k])
            content = {"header": message(arm, k, when)["header"], "joint_names": list(NAMES)}
            writer.write_message("/arm", control, content | {"desired": measured, "actual": measured}, log_time=when)
    found = read_log(path)
    assert (found.joints, found.findings) == (
        ("finger",),
        ("joint states come on several topics: /gripper was read, /arm left out",),
    )
    found = read_log(path, joints=["w4", "β"])
    assert found.joints == ("w4", "β")
    assert same(found.effort, arm.effort[:, [3, 1]])
    assert found.findings == ("joint states come on several topics: /arm was read, /gripper left out",)
    with pytest.raises(LogError, match=r"has no joint 'wrist'; it has finger"):
        read_log(path, joints=["wrist"])
    assert read_log(path, topic="/arm").joints == NAMES


def test_the_publisher_that_has_the_joints_is_chosen_among_many(tmp_path: Path) -> None:
    """On one topic: the arm alone, the arm with a gripper twice as often, and a gripper ten times as often."""
    arm, both, gripper = make_log(50), make_log(100, ("finger", *NAMES)), make_log(500, ("finger",))
    messages = []
    for k in range(50):
        messages.append(("/joint_states", START_NS + 10 * k * STEP, message(arm, k, START_NS + 10 * k * STEP)))
    for k in range(100):
        when = START_NS + 5 * k * STEP + 1
        messages.append(("/joint_states", when, message(both, k, when, [4, 0, 2, 1, 3])))
    for k in range(500):
        when = START_NS + k * STEP + 2
        messages.append(("/joint_states", when, message(gripper, k, when)))
    write_by_others(tmp_path / "a.mcap", sorted(messages, key=lambda entry: entry[1]), chunk_size=9000)
    assert read_mcap(tmp_path / "a.mcap", joints=["finger", "w4"]).log.joints == ("finger", "w4")
    found = read_mcap(tmp_path / "a.mcap", joints=NAMES).log
    assert same(found.position, both.position[:, 1:])
    assert found.findings == (
        "500 messages with other joints (finger) were left out",
        "50 messages with other joints (elbow_3, shoulder, w4, β) were left out",
    )


def test_effort_and_velocity_are_never_filled_with_zeros(tmp_path: Path) -> None:
    """Two publishers of the same joints, one without effort: what is not known is NaN, and rows keep their order."""
    log = make_log(90)
    messages = []
    for k in range(90):
        content = message(log, k, START_NS + k * STEP)
        if k % 3 == 0:
            content["effort"] = []
        if k % 5 == 0:
            content["velocity"] = [float("nan")] * 4
        messages.append(("/joint_states", START_NS + k * STEP, content))
    write_by_others(tmp_path / "a.mcap", messages)
    back = read_mcap(tmp_path / "a.mcap").log
    k = np.arange(90)
    assert same(back.position, log.position)
    assert np.isnan(back.effort[k % 3 == 0]).all()
    assert same(back.effort[k % 3 > 0], log.effort[k % 3 > 0])
    assert np.isnan(back.velocity[k % 5 == 0]).all()
    assert same(back.velocity[k % 5 > 0], log.velocity[k % 5 > 0])


def json_file(path: Path, contents: list, name: str, encoding: str = "jsonschema") -> None:
    with open(path, "wb") as stream:
        writer = McapWriter(stream)
        writer.start()
        schema = writer.register_schema(name, encoding, b"{}") if name else 0
        channel = writer.register_channel("/arm", "json", schema)
        for k, content in enumerate(contents):
            data = content if isinstance(content, bytes) else json.dumps(content).encode()
            writer.add_message(channel, START_NS + k * STEP, data, START_NS + k * STEP)
        writer.finish()


@pytest.mark.parametrize("name", ["sensor_msgs/msg/JointState", "", "anything"])
def test_joint_states_in_json(tmp_path: Path, name) -> None:
    log = make_log(60, effort=False)
    contents = [message(log, k, START_NS + 3 * k * STEP) for k in range(60)]
    for k in (4, 9):
        contents[k]["velocity"][2] = None
    contents[20] = b"{}{"
    contents[21] = {"name": ["a"], "position": ["far"]}
    json_file(tmp_path / "a.mcap", contents, name)
    back = read_mcap(tmp_path / "a.mcap").log
    rest = np.delete(np.arange(60), [20, 21])
    velocity = log.velocity.copy()
    velocity[[4, 9], 2] = np.nan
    assert same(back.position, log.position[rest])
    assert same(back.velocity, velocity[rest])
    np.testing.assert_allclose(back.time, 3 * rest / 1000, atol=1e-12)
    assert back.effort is None
    assert back.findings == ("2 joint state messages could not be decoded and not used",)


@pytest.mark.parametrize("time", ["2023-11-14T22:13:20.123456Z", 1_700_000_000.123456, None])
def test_joint_states_in_json_as_a_list_of_joints(tmp_path: Path, time) -> None:
    contents = [
        {"timestamp": time, "joints": [{"name": "a", "position": k, "effort": 2}, {"name": "b", "position": -k}]}
        for k in range(5)
    ]
    json_file(tmp_path / "a.mcap", contents, "foxglove.JointStates")
    back = read_mcap(tmp_path / "a.mcap").log
    assert back.joints == ("a", "b")
    assert back.position.tolist() == [[k, -k] for k in range(5)]
    assert same(back.effort[:, 0], np.full(5, 2.0))
    assert np.isnan(back.effort[:, 1]).all()
    assert back.velocity is None
    # One time for all, or none: the time of recording stands in.
    np.testing.assert_allclose(back.time, np.arange(5) / 1000, atol=1e-12)


def test_json_that_is_something_else_is_no_joint_state(tmp_path: Path) -> None:
    json_file(tmp_path / "a.mcap", [{"battery": 0.4}], "status")
    with pytest.raises(LogError, match=r"holds no sensor_msgs/msg/JointState .*its topics: /arm \(status\)"):
        read_mcap(tmp_path / "a.mcap")


def bag(folder: Path, parts: list[Log], listed: list[str] | None = None, text: str = "") -> None:
    """A split bag as ros2 writes it."""
    folder.mkdir()
    names = [f"run_{k}.mcap" for k in range(len(parts))]
    for name, part in zip(names, parts, strict=True):
        write_mcap(part, folder / name)
    lines = "".join(f"    - {name}\n" for name in (names if listed is None else listed))
    (folder / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information:\n  version: 5\n{text}  relative_file_paths:\n{lines}  duration:\n    - 3\n",
        encoding="utf-8",
    )


def parts_of(log: Log, count: int) -> list[Log]:
    from dataclasses import replace

    cuts = np.array_split(np.arange(log.samples), count)
    return [
        replace(
            log,
            time=log.time[cut] - log.time[cut[0]],
            position=log.position[cut],
            velocity=log.velocity[cut],
            effort=log.effort[cut],
            metadata={**log.metadata, "start_time_ns": str(START_NS + int(cut[0]) * STEP)},
        )
        for cut in cuts
    ]


def test_a_split_bag_is_one_log(tmp_path: Path) -> None:
    log = make_log(3300)
    bag(tmp_path / "bag", parts_of(log, 11), text="  storage_identifier: mcap\n")
    back = read_log(tmp_path / "bag")
    for name in ("position", "velocity", "effort"):
        assert same(getattr(back, name), getattr(log, name))
    np.testing.assert_allclose(back.time, log.time, atol=1e-12)
    assert (back.source, len(back.sha256), back.findings) == (str(tmp_path / "bag"), 64, ())
    part = tmp_path / "bag" / "run_4.mcap"
    part.write_bytes(part.read_bytes()[:-5000])
    (finding, gap) = (*read_log(tmp_path / "bag").findings, "")[:2]
    assert finding.startswith("run_4.mcap: the file is cut")
    part.unlink()
    back = read_log(tmp_path / "bag")
    assert back.samples == 3000
    assert back.findings[0] == "the bag names files that are not there: run_4.mcap"
    assert gap == ""


@pytest.mark.parametrize("listed", [[], ["../secret.mcap", "gone.mcap"]])
def test_a_bag_that_names_none_of_its_files_is_read_by_their_numbers(tmp_path: Path, listed) -> None:
    log = make_log(1200)
    write_mcap(log, tmp_path / "secret.mcap")
    bag(tmp_path / "bag", parts_of(log, 12), listed)
    back = read_log(tmp_path / "bag")
    assert same(back.position, log.position)
    assert len(back.findings) == bool(listed)


def test_bags_that_can_not_be_read_say_what_would_help(tmp_path: Path) -> None:
    for name, text, words in (
        ("sqlite", "  storage_identifier: sqlite3\n", "`ros2 bag convert`"),
        ("packed", "  compression_mode: FILE\n", "unpack them"),
        ("empty", "", "is a bag without MCAP files"),
    ):
        bag(tmp_path / name, [], text=text)
        with pytest.raises(LogError, match=words):
            read_log(tmp_path / name)


def test_what_is_not_wanted_is_not_read(tmp_path: Path) -> None:
    log = make_log(400)
    write_mcap(log, tmp_path / "a.mcap")
    back = read_log(tmp_path / "a.mcap", velocity=False)
    assert back.velocity is None
    assert same(back.effort, log.effort)
    back = read_log(tmp_path / "a.mcap", effort=False, joints=["w4"])
    assert back.effort is None
    assert same(back.velocity, log.velocity[:, 3:])


def test_messages_between_those_of_other_topics_are_found_by_the_index_and_without_it(tmp_path: Path) -> None:
    """Every message stands alone, and an index that lies is not believed."""
    log = make_log(300)
    payloads = []
    from log_files import payload_by_others

    for k in range(300):
        when = START_NS + STEP * k
        payloads.append(("/joint_states", when, payload_by_others(message(log, k, when))))
        payloads.append(("/text", when, b"\0\1\0\0" + bytes(8 + k % 7)))
    path = tmp_path / "a.mcap"
    write_payloads(path, payloads)
    assert same(read_mcap(path, topic="/joint_states").log.position, log.position)
    data = bytearray(path.read_bytes())
    start = data.index(b"\x07" + (6 + 16 * 300).to_bytes(8, "little"))
    for k in range(300):
        # Every second message is left out of it.
        at = start + 9 + 6 + 16 * k + 8
        data[at : at + 8] = data[at - 16 * (k % 2) : at + 8 - 16 * (k % 2)]
    path.write_bytes(data)
    assert same(read_mcap(path, topic="/joint_states").log.position, log.position)
