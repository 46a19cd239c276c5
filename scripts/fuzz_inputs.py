"""Sound inputs of every kind that `identify` reads, for `scripts/check_fuzz` to damage."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from identify.logs import joint_state
from identify.logs.log import Log
from identify.logs.mcap_writer import write_mcap

ROOT = Path(__file__).resolve().parents[1]

URDF = """<robot name="arm">
  <link name="base"/>
  <link name="one"><inertial><origin xyz="0.1 0 0.2"/><mass value="3"/>
    <inertia ixx="0.1" ixy="0.01" ixz="0" iyy="0.2" iyz="0" izz="0.15"/></inertial></link>
  <link name="two"><inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>
    </inertial></link>
  <link name="tip"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="one"/><origin xyz="0 0 0.3" rpy="0 0.4 0"/>
    <axis xyz="0 0.6 0.8"/><limit lower="-2" upper="2" velocity="3" effort="100"/><dynamics damping="0.4"/></joint>
  <joint name="b" type="prismatic"><parent link="one"/><child link="two"/><origin xyz="0.4 0 0"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.5" velocity="1" effort="50"/></joint>
  <joint name="c" type="fixed"><parent link="two"/><child link="tip"/></joint>
</robot>
"""
MAP = """time = { column = "t", unit = "s" }
side = "motor"
joints = ["one", "two"]
position = { columns = ["q1", "q2"], unit = "rad" }
velocity = { columns = ["dq1", "dq2"], unit = "rad/s" }
effort = { columns = ["tau1", "tau2"], gain = [0.2, 0.3], unit = "A" }
offset = [0.0, 1.5]
[transmission]
matrix = [[3.0, 0.0], [3.0, 2.0]]
"""


def a_log(samples: int) -> Log:
    """A log of two joints at 250 Hz."""
    rng = np.random.default_rng(1)
    time = np.arange(samples) / 250
    position = np.column_stack([np.sin(3 * time), np.cos(2 * time)]) + rng.normal(size=(samples, 2)) * 1e-4
    return Log(time, position, 2 * position, 9 * position, ("one", "two"), metadata={"robot": "arm"})


POINT = "trajectory_msgs/JointTrajectoryPoint"
CONTROLLER = "control_msgs/msg/JointTrajectoryControllerState"
CONTROLLER_DEFINITION = f"""std_msgs/Header header
string[] joint_names
{POINT} reference
{POINT} feedback
{"=" * 80}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{"=" * 80}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
{"=" * 80}
MSG: {POINT}
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start
{"=" * 80}
MSG: builtin_interfaces/Duration
int32 sec
uint32 nanosec
"""


def messages(log: Log) -> Iterator[tuple[int, dict[str, Any]]]:
    """Stamp and content of every sample, as JointState."""
    for k, seconds in enumerate(log.time.tolist()):
        when = 10**18 + round(seconds * 1e9)
        channels = {name: getattr(log, name)[k].tolist() for name in ("position", "velocity", "effort")}
        stamp = {"sec": when // 10**9, "nanosec": when % 10**9}
        yield when, {"header": {"stamp": stamp, "frame_id": "base"}, "name": list(log.joints), **channels}


def ros2_mcap(path: Path, controller: bool = False, **options: Any) -> None:
    """An MCAP of mcap-ros2-support: two publishers on one topic, or a controller's state."""
    from mcap_ros2.writer import Writer

    with open(path, "wb") as stream, Writer(stream, **options) as writer:
        kind = (CONTROLLER, CONTROLLER_DEFINITION) if controller else (joint_state.NAMES[0], joint_state.DEFINITION)
        schema = writer.register_msgdef(*kind)
        for k, (when, content) in enumerate(messages(a_log(330))):
            if controller:
                duration = {"sec": 0, "nanosec": 0}
                point = {"positions": content["position"], "velocities": content["velocity"], "accelerations": []}
                point |= {"effort": content["effort"], "time_from_start": duration}
                content = {"header": content["header"], "joint_names": content["name"]}
                content |= {"reference": point, "feedback": point}
            writer.write_message("/joint_states", schema, content, log_time=when)
            if k % 20 == 0 and not controller:
                grip = content | {"name": ["gripper"], "position": [0.5], "velocity": [], "effort": []}
                writer.write_message("/joint_states", schema, grip, log_time=when)


def plain_mcap(path: Path, encoding: str, **options: Any) -> None:
    """An MCAP of the mcap package's own writer: the payloads of another file, or JSON."""
    import json

    from mcap.reader import make_reader
    from mcap.writer import Writer

    with open(path, "rb") as stream:
        payloads = [(m.log_time, m.data) for _, _, m in make_reader(stream).iter_messages()]
    with open(path, "wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="ros2")
        form = "ros2msg" if encoding == "cdr" else "jsonschema"
        schema = writer.register_schema(joint_state.NAMES[0], form, joint_state.DEFINITION.encode())
        channel = writer.register_channel("/joint_states", encoding, schema)
        if encoding == "json":
            payloads = [(when, json.dumps(content).encode()) for when, content in messages(a_log(330))]
        for when, data in payloads:
            writer.add_message(channel, when, data, when)
        writer.finish()


def sound_inputs(folder: Path) -> dict[str, list[bytes]]:
    """Kind → sound inputs, as bytes by the name of the file they are put into."""
    from mcap.writer import CompressionType

    plain = {"compression": CompressionType.NONE, "enable_crcs": False, "chunk_size": 8192}
    found: dict[str, list[bytes]] = {"mcap": [], "csv": [], "npz": [], "map": [], "toml": [], "urdf": [], "bag": []}
    path = folder / "seed"
    write_mcap(a_log(1500), path, {"robot.toml": b"x = 1"})
    found["mcap"].append(path.read_bytes())
    for compression in CompressionType:
        ros2_mcap(path, chunk_size=8192, compression=compression)
        found["mcap"].append(path.read_bytes())
    for encoding, options in (("cdr", {"use_chunking": False}), ("cdr", plain), ("json", plain)):
        plain_mcap(path, encoding, **options)
        found["mcap"].append(path.read_bytes())
        ros2_mcap(path)
    ros2_mcap(path, controller=True, chunk_size=8192, compression=CompressionType.NONE)
    found["mcap"].append(path.read_bytes())
    log = a_log(300)
    log.save(folder / "a.csv")
    own = (folder / "a.csv").read_bytes()
    found["csv"] = [own, own.replace(b",", b"\t"), own.replace(b",", b";").replace(b".", b","), b"# t\n" + own]
    stream = io.BytesIO()
    table: dict[str, Any] = {
        f"{name}{j + 1}": v[:, j]
        for name, v in (("q", log.position), ("dq", log.velocity), ("tau", log.effort))
        for j in (0, 1)
    }
    np.savez(stream, t=log.time, **table)
    found["npz"] = [stream.getvalue()]
    stream = io.BytesIO()
    np.savez_compressed(stream, t=log.time, **table)
    found["npz"].append(stream.getvalue())
    found["map"] = [MAP.encode()]
    found["toml"] = [(ROOT / "robots" / name).read_bytes() for name in ("rx90.toml", "tx40.toml")]
    found["urdf"] = [URDF.encode()]
    bag = "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  relative_file_paths:\n"
    found["bag"] = [(bag + '    - a_0.mcap\n    - a_1.mcap\n  compression_mode: ""\n').encode()]
    return found
