"""One door for every kind of file: what comes through is clean, what does not says why in a line."""

from __future__ import annotations

import sqlite3
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_files import NAMES, make_log, same

import identify
from identify.errors import LogError, OutputError
from identify.logs.cleaning import clean
from identify.logs.reading import read_log, window
from identify.logs.table_map import parse_map


def refusal(path, **options) -> str:
    """The one line with which a log is refused."""
    with pytest.raises(LogError) as caught:
        read_log(path, **options)
    text = str(caught.value)
    assert caught.value.exit_status == 2
    assert str(path) in text
    assert "\n" not in text
    return text


def test_every_kind_of_bad_file_has_its_message(tmp_path) -> None:
    assert "there is no such file" in refusal(tmp_path / "none.mcap")
    assert "is a folder; for a folder of tables, pass --map" in refusal(tmp_path)
    for name in ("a.mcap", "a.csv", "a.npz"):
        (tmp_path / name).write_bytes(b"")
        assert "is empty" in refusal(tmp_path / name)
    (tmp_path / "b.mcap").write_bytes(b"t,q1,tau1\n1,2,3\n")
    assert "is not an MCAP file" in refusal(tmp_path / "b.mcap")
    for name in ("b.parquet", "b.XLSX"):
        (tmp_path / name).write_bytes(b"PAR1")
        assert "convert it to CSV or NPZ" in refusal(tmp_path / name)
        assert "convert it to CSV or NPZ" in refusal(tmp_path / name, map=tmp_path / "map.toml")
    (tmp_path / "c.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(range(256)))
    assert "logs may be MCAP, CSV, TSV or NPZ" in refusal(tmp_path / "c.bag")
    (tmp_path / "d.csv").write_bytes(bytes(range(256)) * 20)
    assert "is not a text table" in refusal(tmp_path / "d.csv")
    (tmp_path / "e.csv").write_text("# nothing\n\n")
    assert "holds no rows" in refusal(tmp_path / "e.csv")
    (tmp_path / "f.csv").write_text("t,q1,tau1\n")
    assert "has a header and no rows" in refusal(tmp_path / "f.csv")
    (tmp_path / "g.npz").write_bytes(b"PK\x03\x04" + bytes(50))
    assert refusal(tmp_path / "g.npz")
    with sqlite3.connect(tmp_path / "h.db3") as base:
        base.execute("create table messages (data)")
    base.close()
    assert "logs may be MCAP, CSV, TSV or NPZ" in refusal(tmp_path / "h.db3")
    make_log().save(tmp_path / "i.mcap")
    mapping = parse_map({"rate_hz": 1, "side": "joint", "joints": ["a"], "position": {"columns": ["q"]}})
    assert "a map is for tables" in refusal(tmp_path / "i.mcap", map=mapping)
    assert "has no joint 'wrist'; it has shoulder, β, elbow_3, w4" in refusal(tmp_path / "i.mcap", joints=["wrist"])
    folder = tmp_path / "bag"
    folder.mkdir()
    make_log().save(folder / "bag_0.mcap")
    assert "is a folder; name the file in it: bag_0.mcap" in refusal(folder)


def test_reading_is_the_public_name_and_knows_its_file(tmp_path) -> None:
    make_log().save(tmp_path / "a.mcap", attachments={"robot.toml": b"x"})
    log = identify.read_log(tmp_path / "a.mcap", joints=["w4", "β"])
    assert (log.joints, log.source, len(log.sha256)) == (("w4", "β"), str(tmp_path / "a.mcap"), 64)
    assert log.simulated
    assert same(log.effort, make_log().effort[:, [3, 1]])


def test_an_mcap_is_known_by_its_content(tmp_path) -> None:
    make_log().save(tmp_path / "a.mcap")
    (tmp_path / "a.mcap").rename(tmp_path / "recording")
    assert read_log(tmp_path / "recording").samples == make_log().samples


def test_nothing_is_overwritten_unasked(tmp_path) -> None:
    for name in ("a.mcap", "a.csv"):
        make_log().save(tmp_path / name)
        before = (tmp_path / name).read_bytes()
        with pytest.raises(OutputError, match="exists already; pass --force"):
            make_log(20).save(tmp_path / name)
        assert (tmp_path / name).read_bytes() == before
        make_log(20).save(tmp_path / name, force=True)
        assert read_log(tmp_path / name).samples == 20
    with pytest.raises(OutputError, match=r"written as \.mcap or \.csv"):
        make_log().save(tmp_path / "a.npz")
    with pytest.raises(OutputError, match="takes no attachments"):
        make_log().save(tmp_path / "b.csv", attachments={"x": b""})
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["a.csv", "a.mcap"]


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_unusable_rows_are_dropped_and_counted(data) -> None:
    log = make_log(200)
    rows = data.draw(st.sets(st.integers(0, 199), max_size=10))
    time, position, effort = log.time.copy(), log.position.copy(), log.effort.copy()
    still_moving = np.ones(200, dtype=bool)
    for row in rows:
        values = data.draw(st.sampled_from([position, effort, time]))
        still_moving[row] = values is effort
        bad = np.nan if values is time else data.draw(st.sampled_from([np.nan, np.inf, -np.inf, 1e10]))
        values[row if values is time else (row, data.draw(st.integers(0, 3)))] = bad
    cleaned = clean(replace(log, time=time, position=position, effort=effort))
    kept = sorted(set(range(200)) - rows)
    assert same(cleaned.position, log.position[kept])
    assert same(cleaned.velocity, log.velocity[kept])
    assert same(cleaned.time, log.time[kept] - log.time[still_moving.argmax()])
    assert cleaned.dropped == len(rows)
    expected = [f"{len(rows)} of 200 rows dropped: position, effort or time is not finite, or absurd"]
    assert list(cleaned.findings) == expected * bool(rows)


def test_a_log_has_one_clock_whether_or_not_its_effort_is_read(tmp_path) -> None:
    log = make_log(200)
    effort = log.effort.copy()
    effort[:4, 1] = np.nan
    for name in ("a.mcap", "a.csv"):
        replace(log, effort=effort).save(tmp_path / name)
        with_effort = read_log(tmp_path / name)
        without = read_log(tmp_path / name, effort=False)
        assert without.effort is None
        assert without.samples == 200
        assert without.findings == ()
        assert (with_effort.samples, with_effort.time[0]) == (196, pytest.approx(0.004, abs=1e-12))
        np.testing.assert_allclose(with_effort.time, without.time[4:], atol=1e-12)
        assert same(with_effort.position, without.position[4:])


def test_effort_that_is_not_read_may_be_missing_or_anything(tmp_path) -> None:
    log = make_log(300, ("a", "b"))
    table = np.column_stack([log.time, log.position]).tolist()
    entries = {
        "time": "t",
        "side": "motor",
        "joints": ["a", "b"],
        "position": {"columns": ["x", "y"]},
        "effort": {"columns": ["i", "k"]},
        "transmission": {"matrix": [[30.0, 0.0], [20.0, 20.0]]},
    }
    mapping = parse_map(entries)
    (tmp_path / "none.csv").write_text("t,x,y\n" + "".join(f"{t},{x},{y}\n" for t, x, y in table))
    (tmp_path / "odd.csv").write_text("t,x,y,i,k\n" + "".join(f"{t},{x},{y},off,nan\n" for t, x, y in table))
    with pytest.raises(LogError, match="has no column 'i'"):
        read_log(tmp_path / "none.csv", mapping)
    with pytest.raises(LogError, match="too many NaN"):
        read_log(tmp_path / "odd.csv", mapping)
    none, odd = (read_log(tmp_path / name, mapping, effort=False) for name in ("none.csv", "odd.csv"))
    assert none.samples == odd.samples == 300
    assert same(none.position, odd.position)
    assert none.effort is None
    assert odd.effort is None


def test_too_many_nan_are_refused_with_their_share_and_column() -> None:
    log = make_log(200)
    effort = log.effort.copy()
    effort[20:31, 2] = np.nan
    with pytest.raises(LogError, match=r"too many NaN: 5\.5 % of the rows .* in the effort of elbow_3 \(5\.5 %\)"):
        clean(replace(log, effort=effort))
    with pytest.raises(LogError, match="too many NaN: no position"):
        clean(replace(log, position=np.full_like(log.position, np.nan)))


def test_a_channel_of_nan_counts_as_absent() -> None:
    log = make_log(200)
    nothing = np.full_like(log.effort, np.nan)
    cleaned = clean(replace(log, effort=nothing, velocity=nothing))
    assert cleaned.effort is None
    assert cleaned.velocity is None
    assert cleaned.samples == 200
    assert len(cleaned.findings) == 2
    one = log.effort.copy()
    one[:, 1] = np.nan
    cleaned = clean(replace(log, effort=one))
    assert cleaned.findings == ("the effort of β is NaN throughout",)
    assert cleaned.samples == 200


def test_a_wanted_joint_without_a_position_is_refused_and_one_that_is_not_wanted_is_no_matter(tmp_path) -> None:
    log = make_log(300)
    position = log.position.copy()
    position[:, 2] = np.nan
    replace(log, position=position).save(tmp_path / "a.mcap")
    text = refusal(tmp_path / "a.mcap", joints=["w4", "elbow_3"])
    assert "too many NaN: no position of elbow_3 is a number" in text
    assert read_log(tmp_path / "a.mcap", joints=["w4", "β"]).samples == 300


def test_gaps_in_velocity_are_filled_from_position() -> None:
    log = make_log(200, ("a", "b"))
    time = log.time
    smooth = replace(log, position=np.column_stack([np.sin(3 * time), time**2]), velocity=None)
    truth = np.column_stack([3 * np.cos(3 * time), 2 * time])
    velocity = truth.copy()
    velocity[[5, 90, 91]] = np.nan
    velocity[7, 1] = np.inf
    cleaned = clean(replace(smooth, velocity=velocity))
    np.testing.assert_allclose(cleaned.velocity, truth, atol=1e-5)
    assert cleaned.findings == ("7 velocity samples not finite and derived from position",)
    velocity[:11] = np.nan
    cleaned = clean(replace(smooth, velocity=velocity))
    assert cleaned.velocity is None
    assert "all of it is derived from position" in cleaned.findings[0]


def test_time_runs_forward_afterwards() -> None:
    log = make_log(400)
    time = log.time.copy()
    time[50] = time[49]
    time[51] = time[49]
    time[120] = time[100]
    time[200] = 9e4
    cleaned = clean(replace(log, time=time))
    kept = np.delete(np.arange(400), [50, 51, 120, 200])
    assert same(cleaned.position, log.position[kept])
    assert (np.diff(cleaned.time) > 0).all()
    assert cleaned.dropped == 4
    assert cleaned.findings == (
        "2 of 400 rows dropped: their time repeats the one before",
        "2 of 400 rows dropped: their time runs backward",
    )


def test_a_clock_that_starts_anew_is_refused() -> None:
    log = make_log(400)
    time = np.concatenate([log.time[:200], log.time[:200]])
    with pytest.raises(LogError, match=r"time runs backward in \d+\.\d % of the rows, first by 0\.199 s after row 199"):
        clean(replace(log, time=time))


@settings(max_examples=50, deadline=None)
@given(steps=st.lists(st.sampled_from([1, 1, 1, 1, 1, 1, 1, 1, 0, -1, -30, 50]), min_size=40, max_size=40))
def test_whatever_the_clock_does_time_increases_or_the_log_is_refused(steps) -> None:
    log = make_log(41)
    time = np.concatenate([[0], np.cumsum(steps)]) / 1000
    try:
        cleaned = clean(replace(log, time=time))
    except LogError:
        assert min(steps) < 0
        return
    assert (np.diff(cleaned.time) > 0).all()
    assert cleaned.time[0] == 0
    assert cleaned.dropped == 41 - cleaned.samples


def test_a_window_counts_anew_and_the_absolute_time_moves_along(tmp_path) -> None:
    make_log(1000).save(tmp_path / "a.mcap")
    log = read_log(tmp_path / "a.mcap")
    part = window(log, 0.25, 0.75)
    assert same(part.position, log.position[250:750])
    assert part.time[0] == 0
    np.testing.assert_allclose(part.time, np.arange(500) / 1000, atol=1e-15)
    moved = int(part.metadata["start_time_ns"]) - int(log.metadata["start_time_ns"])
    assert moved == 250_000_000
    assert window(log) is log
    head, tail = window(log, stop=0.4), window(log, start=0.4)
    assert head.samples + tail.samples == log.samples
    part.save(tmp_path / "b.mcap")
    again = read_log(tmp_path / "b.mcap")
    assert again.metadata == part.metadata
    assert again.joints == NAMES
    with pytest.raises(LogError, match=r"has no sample from 2 to 3 s; it lasts 0\.999 s"):
        window(log, 2, 3)
