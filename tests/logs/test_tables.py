"""Tables as people have them: a map says what the columns mean, and no row is trusted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_files import make_log, same

from identify.errors import LogError
from identify.logs.reading import read_log
from identify.logs.table_map import load_map, parse_map
from identify.logs.tables import read_table

TWO = {
    "rate_hz": 250,
    "side": "joint",
    "joints": ["a", "b"],
    "position": {"columns": ["q1", "q2"]},
    "effort": {"columns": ["i1", "i2"]},
}


def table(path, rows, header="q1,q2,i1,i2", join=",", end="\n"):
    lines = [header] if header else []
    path.write_text("\n".join([*lines, *(join.join(str(cell) for cell in row) for row in rows)]) + end)
    return path


def numbers(count, width=4):
    return np.random.default_rng(5).normal(size=(count, width))


@pytest.mark.parametrize("join", [",", "\t", ";", " ", "  ", ", "])
@pytest.mark.parametrize("header", ["q1,q2,i1,i2", None, "# made on a Monday\n# q1,q2,i1,i2", '"q1","q2","i1","i2"'])
def test_delimiters_and_headers(tmp_path, join, header) -> None:
    values = numbers(300)
    columns = {} if header else {"position": {"columns": [0, 1]}, "effort": {"columns": [2, 3]}}
    written = header.replace(",", join) if header else None
    table(tmp_path / "a.csv", values.tolist(), written, join)
    log = read_log(tmp_path / "a.csv", parse_map({**TWO, **columns}))
    assert same(log.position, values[:, :2])
    assert same(log.effort, values[:, 2:])
    assert same(log.time, np.arange(300) / 250)
    assert (log.joints, log.findings, log.velocity) == (("a", "b"), (), None)


def test_decimal_commas(tmp_path) -> None:
    (tmp_path / "a.csv").write_text("q1;q2;i1;i2\n1,5;-2,25;3;4,125\n2,5;-1,25;3;4\n")
    assert read_table(tmp_path / "a.csv", parse_map(TWO)).position.tolist() == [[1.5, -2.25], [2.5, -1.25]]


def test_units_gains_offsets_and_the_transmission(tmp_path) -> None:
    """q = K⁻¹ m + offset, Γ = Kᵀ (gain · i), written out number by number with a K that is not symmetric."""
    raw = numbers(40, 7)
    mapping = {
        "time": {"column": "stamp", "unit": "ms"},
        "side": "motor",
        "joints": ["a", "b"],
        "position": {"columns": ["m2", "m1"], "unit": "deg", "gain": [2.0, -0.5]},
        "velocity": {"columns": ["s1", "s2"], "unit": "rad/s"},
        "effort": {"columns": ["i1", "i2"], "gain": [14.9, 13.3], "unit": "A"},
        "offset": [0.25, -1.5],
        "transmission": {"matrix": [[40, 0], [7, -32]]},
    }
    rows = np.column_stack([1000 + 4 * np.arange(40), raw[:, 1:]])
    table(tmp_path / "a.csv", rows.tolist(), "stamp,m1,m2,s1,s2,i1,i2")
    log = read_log(tmp_path / "a.csv", parse_map(mapping))
    m_a, m_b = np.radians(raw[:, 2]) * 2.0, np.radians(raw[:, 1]) * -0.5
    q_a = m_a / 40
    q_b = (7 * q_a - m_b) / 32
    np.testing.assert_allclose(log.position, np.column_stack([q_a + 0.25, q_b - 1.5]), rtol=1e-14, atol=1e-15)
    speed_a = raw[:, 3] / 40
    speed_b = (7 * speed_a - raw[:, 4]) / 32
    np.testing.assert_allclose(log.velocity, np.column_stack([speed_a, speed_b]), rtol=1e-14, atol=1e-15)
    i_a, i_b = 14.9 * raw[:, 5], 13.3 * raw[:, 6]
    np.testing.assert_allclose(log.effort, np.column_stack([40 * i_a + 7 * i_b, -32 * i_b]), rtol=1e-14)
    np.testing.assert_allclose(log.time, np.arange(40) * 0.004, atol=1e-15)
    power = (np.gradient(np.radians(raw[:, [2, 1]]) * [2.0, -0.5], axis=0) * np.column_stack([i_a, i_b])).sum()
    assert math.isclose((np.gradient(log.position, axis=0) * log.effort).sum(), power, rel_tol=1e-12)


def test_a_unit_for_each_joint(tmp_path) -> None:
    table(tmp_path / "a.csv", [[90, 0.5, 1, 2]] * 3)
    mapping = {**TWO, "position": {"columns": ["q1", "q2"], "unit": ["deg", "m"]}}
    assert read_table(tmp_path / "a.csv", parse_map(mapping)).position[0].tolist() == [math.pi / 2, 0.5]


BAD_ROWS = {
    "1.0,2.0,3.0": "of another length",
    "1,2,3,4,5": "of another length",
    "1.0,spam,3.0,4.0": "something else than numbers",
    "\x1b[31m,2,3,4": "something else than numbers",
    "1e293,2,3,4": None,
    "1,2,-3e9,4": None,
    "1,2,nan,4": None,
    "1,,3,4": None,
    "inf,2,3,4": None,
}


NO_EFFORT = ("1,2,-3e9,4", "1,2,nan,4")
"""Bad rows that still have a position, so that time may count from them."""


@settings(max_examples=40, deadline=None)
@given(bad=st.dictionaries(st.integers(0, 399), st.sampled_from(sorted(BAD_ROWS)), max_size=20))
def test_bad_rows_go_and_leave_the_time_of_the_others(tmp_path_factory, bad) -> None:
    path = tmp_path_factory.getbasetemp() / "bad.csv"
    values = numbers(400)
    lines = [bad.get(k, ",".join(map(repr, row))) for k, row in enumerate(values.tolist())]
    path.write_text("\n".join(["q1,q2,i1,i2", *lines]) + "\n")
    log = read_log(path, parse_map(TWO))
    good = [k for k in range(400) if k not in bad]
    assert same(log.position, values[good][:, :2])
    assert same(log.effort, values[good][:, 2:])
    first = next(k for k in range(400) if bad.get(k, NO_EFFORT[0]) in NO_EFFORT)
    np.testing.assert_allclose(log.time, (np.array(good) - first) / 250, atol=1e-12)
    assert log.dropped == len(bad)
    for reason in ("of another length", "something else than numbers"):
        count = sum(BAD_ROWS[text] == reason for text in bad.values())
        found = [finding for finding in log.findings if reason in finding]
        assert [int(finding.split(": ")[1].split()[0]) for finding in found] == [count] * bool(count)
    assert any(f"{len(bad)} of 400 rows dropped" in finding for finding in log.findings) == bool(bad)


@pytest.mark.parametrize("last", ["1.0,2.0,3.", "1.0,2.0,3.0,4.5e", "1"])
def test_a_last_line_cut_short_is_left_out(tmp_path, last) -> None:
    values = numbers(40)
    table(tmp_path / "a.csv", values.tolist(), end="\n" + last)
    log = read_log(tmp_path / "a.csv", parse_map(TWO))
    assert same(log.position, values[:, :2])
    assert log.findings == ("a.csv: 1 row cut at the end of the file not used",)


def test_columns_that_are_not_asked_for_may_hold_words(tmp_path) -> None:
    values = numbers(20)
    table(tmp_path / "a.csv", [[*row, "auto"] for row in values.tolist()], "q1,q2,i1,i2,mode")
    assert same(read_log(tmp_path / "a.csv", parse_map(TWO)).position, values[:, :2])


@pytest.mark.parametrize(
    ("header", "width", "words"),
    [
        ("q1,q2,i1", 3, "a.csv: has no column 'i2'; its 3 columns are q1, q2, i1"),
        ("q1,q2,i1,i2", 5, "its header names 4 columns and its rows hold 5"),
        ("q1,q2,i1,i1", 4, "more than one column is named 'i1'"),
        (None, 4, "has 4 columns and no header, so 'q1' can't be found; number them from 0"),
        (None, 3, "has 3 columns and no header"),
    ],
)
def test_a_table_of_another_width(tmp_path, header, width, words) -> None:
    table(tmp_path / "a.csv", numbers(30, width).tolist(), header)
    with pytest.raises(LogError, match=words):
        read_log(tmp_path / "a.csv", parse_map(TWO))


def test_a_headerless_table_with_too_few_columns(tmp_path) -> None:
    table(tmp_path / "a.csv", numbers(30, 3).tolist(), None)
    mapping = {**TWO, "position": {"columns": [0, 1]}, "effort": {"columns": [2, 3]}}
    with pytest.raises(LogError, match="has 3 columns, numbered from 0, and the map asks for column 3"):
        read_log(tmp_path / "a.csv", parse_map(mapping))


def test_signals_in_files_of_their_own(tmp_path) -> None:
    values = numbers(100)
    table(tmp_path / "p.csv", values[:, :2].tolist(), "x,y")
    table(tmp_path / "t.tsv", values[:98, 2:].tolist(), "x,y".replace(",", "\t"), "\t")
    position, effort = ({"columns": ["x", "y"], "file": name} for name in ("p.csv", "t.tsv"))
    mapping = parse_map({**TWO, "position": position, "effort": effort})
    log = read_log(tmp_path, mapping)
    assert same(log.effort, values[:98, 2:])
    assert same(log.position, values[:98, :2])
    assert log.findings == ("2 rows at the end not used, as not every file has them",)
    first = log.sha256
    table(tmp_path / "t.tsv", values[:80, 2:].tolist(), "x\ty", "\t")
    with pytest.raises(LogError, match="do not hold the same motion"):
        read_log(tmp_path, mapping)
    table(tmp_path / "t.tsv", values[:, 2:].tolist(), "x\ty", "\t")
    assert len(first) == 64
    assert read_log(tmp_path, mapping).sha256 != first
    (tmp_path / "t.tsv").unlink()
    with pytest.raises(LogError, match=r"t\.tsv: there is no such file; the map names it"):
        read_log(tmp_path, mapping)
    with pytest.raises(LogError, match="the table must be the folder"):
        read_log(tmp_path / "p.csv", mapping)
    with pytest.raises(LogError, match="is a folder and the map names no files"):
        read_log(tmp_path, parse_map(TWO))


@pytest.mark.parametrize("whole", [True, False])
def test_npz(tmp_path, whole) -> None:
    values = numbers(60)
    if whole:
        np.savez_compressed(tmp_path / "a.npz", q=values[:, :2], i=values[:, 2:].astype(np.float32))
        mapping = {**TWO, "position": {"columns": ["q"]}, "effort": {"columns": ["i"]}}
    else:
        np.savez(tmp_path / "a.npz", q1=values[:, 0], q2=values[:, 1], i1=values[:, 2], i2=values[:, 3])
        mapping = TWO
    log = read_log(tmp_path / "a.npz", parse_map(mapping))
    assert same(log.position, values[:, :2])
    np.testing.assert_allclose(log.effort, values[:, 2:], rtol=1e-6)
    with pytest.raises(LogError, match="has no array 'q9'; its arrays are"):
        read_log(tmp_path / "a.npz", parse_map({**TWO, "position": {"columns": ["q9", "q2"]}}))
    with pytest.raises(LogError, match=r"needs a map .* --map MAP.toml"):
        read_log(tmp_path / "a.npz")


def test_npz_with_objects_or_of_other_shapes_is_refused(tmp_path) -> None:
    q = {"columns": ["q"]}
    mapping = parse_map({**TWO, "position": q, "effort": {"columns": ["i"]}})
    np.savez(tmp_path / "a.npz", q=np.array([{}, {}]), i=np.ones((2, 2)), allow_pickle=True)
    with pytest.raises(LogError, match="can't be read as NPZ"):
        read_log(tmp_path / "a.npz", mapping)
    np.savez(tmp_path / "b.npz", q=np.ones((5, 3)), i=np.ones((5, 2)))
    with pytest.raises(LogError, match="position has 3 columns and the map needs 2"):
        read_log(tmp_path / "b.npz", mapping)
    np.savez(tmp_path / "c.npz", q=np.ones((5, 2)), i=np.ones((4, 2)))
    with pytest.raises(LogError, match="its arrays differ in length"):
        read_log(tmp_path / "c.npz", mapping)
    data = (tmp_path / "b.npz").read_bytes()
    (tmp_path / "d.npz").write_bytes(data[:200])
    with pytest.raises(LogError):
        read_log(tmp_path / "d.npz", mapping)


@pytest.mark.parametrize(("velocity", "effort"), [(True, True), (False, True), (False, False)])
def test_our_own_csv_needs_no_map_and_keeps_every_bit(tmp_path, velocity, effort) -> None:
    log = make_log(200, velocity=velocity, effort=effort)
    log.save(tmp_path / "a.csv")
    lines = (tmp_path / "a.csv").read_text().splitlines()
    expected = "t,q1,q2,q3,q4" + ",dq1,dq2,dq3,dq4" * velocity + ",tau1,tau2,tau3,tau4" * effort
    assert lines[0] == expected
    assert all(len(line.split(",")[0].split(".")[1]) >= 9 for line in lines[1:])
    back = read_log(tmp_path / "a.csv")
    assert back.joints == ("joint_1", "joint_2", "joint_3", "joint_4")
    assert read_log(tmp_path / "a.csv", joints=log.joints).joints == log.joints
    swapped = read_log(tmp_path / "a.csv", joints=["joint_2", "joint_1", "joint_4", "joint_3"])
    assert same(swapped.position, log.position[:, [1, 0, 3, 2]])
    assert same(read_log(tmp_path / "a.csv", joints=["joint_3", "joint_1"]).position, log.position[:, [2, 0]])
    for name in ("time", "position", "velocity", "effort"):
        assert same(getattr(back, name), getattr(log, name))


@pytest.mark.parametrize("header", ["q1,q2,tau1,tau2", "t,q1,tau2", "t,q1,q2,tau1", "time,q1,tau1", "t,q2,tau2"])
def test_another_csv_without_a_map_asks_for_one(tmp_path, header) -> None:
    table(tmp_path / "a.csv", numbers(10, len(header.split(","))).tolist(), header)
    with pytest.raises(LogError, match=r"a\.csv: a table needs a map .*; pass --map MAP.toml with, say: rate_hz"):
        read_log(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"position": None}, "has no position; the shortest map: rate_hz"),
        ({"rate_hz": None}, "says nothing of time"),
        ({"rate_hz": -5}, "rate_hz must be a positive number"),
        ({"rate_hz": True}, "rate_hz must be a positive number"),
        ({"time": "t"}, "rate_hz or time, not both"),
        ({"rate_hz": None, "time": {"column": "t", "unit": "h"}}, "time has the unit 'h'"),
        ({"rate_hz": None, "time": 1.5}, "time must be a column"),
        ({"side": "left"}, 'side must be "motor" or "joint", not \'left\''),
        ({"side": None}, "side must be"),
        ({"side": "motor"}, "needs a \\[transmission\\]"),
        ({"side": "motor", "transmission": {"matrix": [[1, 0], [2, 0]]}}, "matrix is singular"),
        ({"side": "motor", "transmission": {"matrix": [[1, 0], [2]]}}, "matrix must be a list of 2 finite numbers"),
        ({"transmission": {"matrix": [[1, 0], [0, 1]]}}, 'of use with side = "motor" alone'),
        ({"joints": ["a", "a"]}, "different names"),
        ({"joints": "ab"}, "joints must be a list of names"),
        ({"joints": ["a", "b", "c"]}, "names 2 columns for 3 joints"),
        ({"velocities": {}}, "unknown key 'velocities' in the map; its keys are rate_hz, time"),
        ({"position": {"columns": ["q1", "q2"], "unit": "grad"}}, "the unit 'grad'; it may be rad, deg, m"),
        ({"position": {"columns": ["q1", "q1"]}}, "each once"),
        ({"position": {"columns": [-1, 2]}}, "needs columns"),
        ({"position": ["q1", "q2"]}, "must look like"),
        ({"position": {"columns": ["q1", "q2"], "scale": 2}}, "must look like"),
        ({"effort": {"columns": ["i1", "i2"], "unit": "A"}}, "give the gain"),
        ({"effort": {"columns": ["i1", "i2"], "gain": [1.0]}}, "gain must be a list of 2 finite numbers"),
        ({"effort": {"columns": ["i1", "i2"], "gain": [1.0, math.nan]}}, "gain must be a list of 2 finite numbers"),
        ({"effort": {"columns": ["i1", "i2"], "file": "x.csv"}}, "either every signal has its `file`"),
        ({"offset": [1.0, "2"]}, "offset must be a list of 2 finite numbers"),
    ],
)
def test_a_map_that_says_nothing_sensible(change, words) -> None:
    entries = {key: value for key, value in {**TWO, **change}.items() if value is not None}
    with pytest.raises(LogError, match=words) as caught:
        parse_map(entries, "map.toml")
    assert str(caught.value).startswith("map.toml: ")
    assert "\n" not in str(caught.value)


def test_a_map_that_is_no_toml_or_not_there(tmp_path) -> None:
    (tmp_path / "bad.toml").write_text("rate_hz = = 5")
    with pytest.raises(LogError, match=r"bad\.toml: the map is not valid TOML"):
        load_map(tmp_path / "bad.toml")
    with pytest.raises(LogError, match=r"none\.toml: there is no such map"):
        load_map(tmp_path / "none.toml")
    with pytest.raises(LogError, match="the map can't be read"):
        load_map(tmp_path)


def test_no_change_of_a_byte_brings_a_traceback(tmp_path) -> None:
    """300 mutations of a table: a log, or a LogError of one printable line."""
    table(tmp_path / "a.csv", numbers(60).tolist())
    data = (tmp_path / "a.csv").read_bytes()
    rng = np.random.default_rng(6)
    read, messages = 0, []
    for _ in range(300):
        broken = bytearray(data)
        for _ in range(rng.integers(1, 4)):
            broken[int(rng.integers(0, 40 if rng.random() < 0.4 else len(broken)))] = int(rng.integers(256))
        (tmp_path / "b.csv").write_bytes(broken)
        try:
            read += read_log(tmp_path / "b.csv", parse_map(TWO)).samples > 0
        except LogError as error:
            messages.append(str(error))
    assert read > 100
    assert messages
    assert all(text.isprintable() for text in messages)
