"""A result in its folder: read back bit by bit, replaced whole or not at all, refused in one line when damaged."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exact_logs import effort, exact_log, fitted, fitted_with_dropped_column, motion

from identify.errors import InputError, OutputError
from identify.estimation import identification as module
from identify.estimation.identification import CURVES, RECORD, ROBOT, Identification, load_folder, save_folder
from identify.logs.slicing import select


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return fitted().save(tmp_path / "result")


@pytest.mark.parametrize("result", [fitted, fitted_with_dropped_column])
def test_a_result_read_back_is_the_same_bit_by_bit(result, tmp_path: Path) -> None:
    first = result()
    folder = first.save(tmp_path / "deep" / "result")
    second = Identification.load(folder)
    assert second.names == first.names == tuple(second.record["names"])
    for name in ("parameters", "covariance"):
        np.testing.assert_array_equal(getattr(second, name), getattr(first, name))
    np.testing.assert_allclose(second.std, first.std, rtol=1e-15)
    log = exact_log(first.robot, 5)
    np.testing.assert_array_equal(second.predict(log), first.predict(log))
    assert second.robot.joints == first.robot.joints
    assert second.settings == first.settings
    assert second.summary() == first.summary()
    assert second.curves.keys() == first.curves.keys()
    for name, values in first.curves.items():
        np.testing.assert_array_equal(second.curves[name], values)
    assert contents(second.save(tmp_path / "again")) == contents(folder)


def test_prediction_is_the_true_effort_of_an_unseen_motion() -> None:
    """The parameters come from effort with 0.02 of noise; away from rest the prediction is that near to the truth."""
    result = fitted()
    log = exact_log(result.robot, 7)
    q, dq, ddq = motion(result.robot, 7).sample(log.time)
    error = result.predict(log) - effort(result.robot, q, dq, ddq)
    moves = (np.abs(dq) > 0.05).all(axis=1)
    assert np.sqrt(np.mean(error[moves] ** 2)) < 0.02
    assert np.isfinite(error).all()


def test_prediction_never_reads_effort_or_velocity() -> None:
    result = fitted()
    log = exact_log(result.robot, 5)
    expected = result.predict(log)
    nan = np.full_like(log.position, np.nan)
    for other in (replace(log, effort=None), replace(log, effort=nan), replace(log, effort=None, velocity=nan)):
        np.testing.assert_array_equal(result.predict(other), expected)


def test_prediction_has_a_row_a_sample_on_any_clock() -> None:
    result = fitted()
    log = exact_log(result.robot, 5)
    time = log.time + np.random.default_rng(0).uniform(-0.3, 0.3, log.samples) / 250
    q, dq, ddq = motion(result.robot, 5).sample(time)
    uneven = replace(log, time=time, position=q)
    moves = (np.abs(dq) > 0.05).all(axis=1)
    errors = [
        np.abs(result.predict(each) - effort(result.robot, q, dq, ddq))[moves].mean()
        for each in (uneven, replace(uneven, time=log.time), log)
    ]
    assert result.predict(uneven).shape == (log.samples, 3)
    assert errors[0] < 0.05 * errors[1]  # the stamps are used, not taken for even
    assert errors[0] < 0.02 * np.abs(log.effort).mean()


def test_joints_are_found_by_name() -> None:
    result = fitted()
    log = exact_log(result.robot, 5)
    names = result.robot.joint_names
    shuffled = select(log, (names[2], names[0], names[1]))
    np.testing.assert_array_equal(result.predict(shuffled), result.predict(log))
    with pytest.raises(InputError, match=r"has no joint 'joint_3'; it has joint_1, joint_2"):
        result.predict(select(log, names[:2]))


def test_an_existing_folder_is_kept_unless_forced(folder: Path) -> None:
    before = contents(folder)
    with pytest.raises(OutputError, match=r"result: exists.*--force"):
        fitted_with_dropped_column().save(folder)
    assert contents(folder) == before
    fitted_with_dropped_column().save(folder, force=True)
    assert Identification.load(folder).names == fitted_with_dropped_column().names


def test_force_replaces_results_alone(tmp_path: Path) -> None:
    mine = tmp_path / "photographs"
    mine.mkdir()
    (mine / "cat.jpg").write_bytes(b"cat")
    with pytest.raises(OutputError, match="holds something else than results"):
        fitted().save(mine, force=True)
    with pytest.raises(OutputError, match="is a file"):
        fitted().save(mine / "cat.jpg", force=True)
    assert contents(mine) == {"cat.jpg": b"cat"}


def test_an_older_folder_does_not_leave_its_files_behind(folder: Path) -> None:
    (folder / "older.txt").write_text("from an older version")
    fitted().save(folder, force=True)
    assert set(contents(folder)) == {RECORD, CURVES, ROBOT}


@pytest.mark.parametrize("forced", [False, True])
@pytest.mark.parametrize("step", ["record", "curves", "robot", "first rename", "last rename", "extra"])
def test_a_folder_is_written_whole_or_not_at_all(
    step: str, forced: bool, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever step fails: a new folder is not there, an old one is as it was, and nothing else is left."""
    target = folder if forced else tmp_path / "new"
    before = contents(folder)
    result = fitted()
    record, extra = result.record, {"report.html": "page"}

    def broken(*arguments: object, **named: object) -> None:
        raise OSError(28, "No space left on device")

    renames: list[object] = []

    def rename(old: os.PathLike[str], new: os.PathLike[str]) -> None:
        renames.append(new)
        if len(renames) == (2 if step == "last rename" and forced else 1):
            raise OSError(5, "Input/output error")
        real(old, new)

    real = os.replace
    if step == "record":
        monkeypatch.setattr(module.json, "dumps", broken)
    elif step == "curves":
        monkeypatch.setattr(module.np, "savez_compressed", broken)
    elif step == "robot":
        monkeypatch.setattr("identify.robot.toml.write_toml", broken)
    elif step == "extra":
        extra = {"no/such/folder.html": "page"}
    else:
        monkeypatch.setattr(module.os, "replace", rename)
    with pytest.raises(OutputError, match="can't be written"):
        save_folder(record, result.curves, result.robot, target, forced, extra)
    monkeypatch.undo()
    assert contents(folder) == before
    assert [path.name for path in tmp_path.iterdir()] == ["result"]


def test_a_record_that_is_no_json_leaves_the_old_folder(folder: Path, tmp_path: Path) -> None:
    before, result = contents(folder), fitted()
    with pytest.raises(ValueError, match="JSON"):
        save_folder(result.record | {"fit": float("nan")}, {}, result.robot, folder, force=True)
    assert contents(folder) == before
    assert [path.name for path in tmp_path.iterdir()] == ["result"]


def rewritten(folder: Path, **changes: object) -> None:
    record = json.loads((folder / RECORD).read_text())
    (folder / RECORD).write_text(json.dumps(record | changes))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda f: (f / RECORD).unlink(), "is no result folder"),
        (lambda f: (f / RECORD).write_text((f / RECORD).read_text()[:500]), "can't be read"),
        (lambda f: (f / RECORD).write_bytes(b"\xff\xfe\x00"), "can't be read"),
        (lambda f: (f / RECORD).write_text("[]"), "is not of format"),
        (lambda f: rewritten(f, format="other/1"), "is not of format"),
        (lambda f: rewritten(f, verdict=None), "damaged"),
        (lambda f: rewritten(f, verdict={}), "damaged"),
        (lambda f: rewritten(f, robot=None), "damaged"),
        (lambda f: rewritten(f, base_parameters=None), "damaged"),
        (lambda f: rewritten(f, base_parameters=[]), "damaged"),
        (lambda f: rewritten(f, friction=[{"joint": "joint_1"}]), "damaged"),
        (lambda f: rewritten(f, covariance=[[1.0]]), "damaged"),
        (lambda f: rewritten(f, covariance=[["x"]]), "damaged"),
        (lambda f: rewritten(f, settings=None), "damaged"),
        (lambda f: rewritten(f, settings={"position_cutoff_hz": "fast"}), "damaged"),
        (lambda f: rewritten(f, settings={"position_cutoff_hz": -1.0}), "damaged"),
        (lambda f: (f / CURVES).write_bytes(b"not an archive"), "can't be read"),
        (lambda f: (f / CURVES).write_bytes((f / CURVES).read_bytes()[:-300]), "can't be read"),
        (lambda f: (f / CURVES).write_bytes(b""), "can't be read"),
        (lambda f: (f / ROBOT).unlink(), ROBOT),
        (lambda f: (f / ROBOT).write_text("joint = 3"), ROBOT),
        (lambda f: shutil.rmtree(f), "is no result folder"),
    ],
)
def test_a_damaged_folder_is_one_line(damage, message: str, folder: Path) -> None:
    damage(folder)
    with pytest.raises(InputError, match=message) as caught:
        Identification.load(folder).predict(exact_log(fitted().robot, 5))
    assert "\n" not in str(caught.value)
    assert str(folder) in str(caught.value)


def test_a_folder_of_another_robot_is_refused(folder: Path, tmp_path: Path) -> None:
    other = fitted_with_dropped_column().save(tmp_path / "other")
    shutil.copy(other / ROBOT, folder / ROBOT)
    with pytest.raises(InputError, match=r"robot\.toml"):
        Identification.load(folder)


def test_a_refused_log_has_a_record_and_no_parameters(folder: Path) -> None:
    rewritten(folder, verdict={"status": "reject", "reasons": ["static"]}, names=[])
    assert load_folder(folder)[0]["verdict"]["reasons"] == ["static"]
    with pytest.raises(InputError, match=r"refused, so there are no parameters.*parameters\.json"):
        Identification.load(folder)
