"""Broken recordings on the command line: what is saved, what is said, and what is left alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identify.logs.mcap_writer import write_mcap
from identify.logs.reading import read_log


def test_a_cut_log_is_saved_and_can_be_fitted(run, arm) -> None:
    whole = arm.train.read_bytes()
    Path("cut.mcap.partial").write_bytes(whole[: int(0.7 * len(whole))])
    outcome = run("recover", "cut.mcap.partial", "-o", "saved.mcap")
    assert outcome.status == 0
    assert outcome.err == ""
    saved = read_log("saved.mcap")
    assert saved.findings == ()
    assert f"saved.mcap: {saved.samples:,} messages over {saved.duration:.3f} s" in outcome.out
    assert "- the file is cut: it ends inside a" in outcome.out
    assert "bytes lost" in outcome.out
    np.testing.assert_array_equal(saved.position, arm.log.position[: saved.samples])
    assert saved.simulated
    found = run("recover", "saved.mcap", "-o", "new/again.mcap", "--json").json
    assert (found["messages"], found["lost"]) == (saved.samples, [])
    assert found["topics"] == {"/joint_states": saved.samples}
    assert "nothing was lost" in run("recover", "saved.mcap", "-o", "third.mcap").out
    assert run("fit", "saved.mcap", "--robot", arm.robot, "-o", "result").status == 0


def test_recover_never_writes_over_anything_unasked(run, arm) -> None:
    Path("a.mcap").write_bytes(arm.train.read_bytes())
    Path("b.mcap").write_text("mine", encoding="utf-8")
    for options, words in (
        (("a.mcap", "-o", "b.mcap"), "exists already; pass --force"),
        (("a.mcap", "-o", "a.mcap", "--force"), "is read by this very command"),
        (("b.mcap", "-o", "c.mcap"), "is not an MCAP file"),
        (("none.mcap", "-o", "c.mcap"), "there is no such file"),
        (("a.mcap", "-o", "c.csv"), "must end in .mcap"),
    ):
        outcome = run("recover", *options)
        assert outcome.status == 2
        assert words in outcome.err
        assert outcome.err.count("\n") == 1
    assert Path("b.mcap").read_text(encoding="utf-8") == "mine"
    assert Path("a.mcap").read_bytes() == arm.train.read_bytes()
    assert sorted(entry.name for entry in Path.cwd().iterdir()) == ["a.mcap", "b.mcap"]


def test_a_bag_folder_is_a_log_and_a_topic_can_be_named(run, arm) -> None:
    Path("bag").mkdir()
    write_mcap(arm.log, "bag/bag_0.mcap")
    Path("bag/metadata.yaml").write_text("relative_file_paths:\n  - bag_0.mcap\n", encoding="utf-8")
    found = run("inspect", "bag", "--robot", arm.robot, "--topic", "/joint_states", "--json").json
    assert found["samples"] == arm.log.samples
    outcome = run("inspect", "bag", "--topic", "/arm")
    assert outcome.status == 2
    assert "no joint states on the topic /arm; its topics: /joint_states (sensor_msgs/msg/JointState)" in outcome.err
    assert run("import", "bag", "--topic", "/joint_states", "-o", "a.csv").status == 0
    assert run("fit", "bag", "--robot", arm.robot, "--topic", "/joint_states", "-o", "result").status == 0
