"""From a fit and a loaded log to the load: what the record says, what is refused, and that the truth plays no part."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from carried import LOAD, carried, currents, loaded_log, one_joint_moving
from chains import random_chain
from exact_logs import arm, exact_log, fitted

import identify
from identify.errors import InputError, LogError, OutputError, UnsupportedLogError
from identify.estimation.payload import LoadEstimate
from identify.estimation.settings import Settings
from identify.payload_record import load_tables
from identify.payload_workflow import payload, payload_to_folder
from identify.robot.payload import carrying
from identify.robot.robot import Link, Transmission
from identify.robot.transforms import from_roll_pitch_yaw, inverse, move_link, to_matrix


def values(link: Link) -> list[float]:
    return [link.mass, *link.com, *link.inertia]


def test_the_load_is_in_every_form_of_the_record() -> None:
    record = carried().record
    assert record["format"] == "identify/payload/1"
    assert record["verdict"] == {"status": "accept", "reasons": [], "actions": []}
    for rows, truth, names in (
        (record["load"]["body"], values(LOAD), "mass com_x com_y com_z Ixx Ixy Ixz Iyy Iyz Izz"),
        (record["load"]["standard"], LOAD.standard, "XX3 XY3 XZ3 YY3 YZ3 ZZ3 MX3 MY3 MZ3 M3"),
    ):
        assert [row["name"] for row in rows] == names.split()
        for row, true in zip(rows, truth, strict=True):
            assert row["estimate"] == pytest.approx(true, abs=max(5 * row["std"], 1e-3))
            assert row["std"] > 0
            assert row["truth"] is None
    assert record["load"]["link"] == "joint_3"
    assert record["load"]["frame"] == "R_3"
    assert record["load"]["flange"] is None
    assert "no tool or flange" in record["load"]["flange_reason"]
    json.dumps(record, allow_nan=False)


def test_residuals_say_what_the_load_explains() -> None:
    fit = carried().record["fit"]
    bare, loaded = (fit[key]["moving_relative_residual_percent"] for key in ("without", "with"))
    assert loaded < 1.0 < 10.0 < bare
    assert carried().record["test"][0]["moving_relative_residual_percent"] < 1.0
    assert [log["role"] for log in carried().record["logs"]] == ["loaded", "test"]
    assert carried().record["unloaded"]["logs"][0]["path"] == "made.mcap"
    curves = carried().curves
    assert set(curves) >= {"loaded0/time", "loaded0/measured", "loaded0/predicted", "loaded0/without"}


def test_the_result_in_python() -> None:
    found = carried()
    np.testing.assert_allclose(found.parameters, LOAD.standard, rtol=0, atol=5e-3)
    assert found.covariance.shape == (10, 10)
    assert found.gains is None
    possible = found.possible
    assert possible is not None
    np.testing.assert_allclose(values(possible), values(LOAD), rtol=0, atol=5e-3)
    assert "The load has a mass of " in found.summary()
    assert identify.payload is payload


def test_the_tool_frame_sees_the_same_body() -> None:
    tool = from_roll_pitch_yaw((0.02, 0.1, 0.2), (0.5, -0.3, 1.2))
    robot = replace(arm(1), tool=to_matrix(tool))
    found = estimate(LOAD.standard)
    rows = load_tables(robot, found, "", None)["flange"]
    np.testing.assert_allclose(
        [row["estimate"] for row in rows], values(move_link(LOAD, inverse(tool))), rtol=0, atol=1e-12
    )
    # A length's σ doesn't depend on where it is looked at from, as long as all axes are equally well known.
    body = load_tables(arm(1), found, "", None)["body"]
    for k in (0, 1, 2, 3):
        assert rows[k]["std"] == pytest.approx(body[k]["std"], rel=0.3)


def estimate(parameters: np.ndarray, untold: np.ndarray | None = None) -> LoadEstimate:
    """An estimate of these parameters with small, uncorrelated errors."""
    silent = np.zeros((10, 0)) if untold is None else untold
    covariance = np.diag(np.where(np.abs(silent).any(axis=1), 0.0, 1e-6))
    none, ones = np.zeros(0), np.ones(3)
    return LoadEstimate(
        parameters, covariance, silent, np.ones(10), none, {}, {}, none, 1.0, ones, ones, 9, 9.0, None, None, Settings()
    )


def test_what_is_not_told_is_null_with_its_reason() -> None:
    """Without the first moment along z, neither that coordinate of the centre of mass nor what it enters is known."""
    tables = load_tables(arm(1), estimate(LOAD.standard, np.eye(10)[:, 8:9]), "joint_2 stands still", None)
    null = [row["name"] for row in tables["standard"] if row["estimate"] is None]
    assert null == ["MZ3"]
    body = [row["name"] for row in tables["body"] if row["estimate"] is None]
    assert body == ["com_z", "Ixx", "Ixz", "Iyy", "Iyz"]
    for row in tables["standard"] + tables["body"]:
        assert (row["estimate"] is None) == ("estimate_reason" in row) == (row["std"] is None)
    assert tables["covariance"][8] == [None] * 10
    assert tables["covariance"][0][0] == pytest.approx(1e-6)
    assert tables["untold_reason"] == "joint_2 stands still"


def test_gains_are_found_through_a_fit_of_currents() -> None:
    gains = np.array([12.0, 7.5, 0.4])
    without = currents(exact_log(arm(1), noise=0.02), gains)
    result = identify.fit(without, arm(1), friction="plain")
    found = payload(result, currents(loaded_log(), gains), mass=1.5, unloaded=[without])
    assert found.gains is not None
    np.testing.assert_allclose(found.gains, gains, rtol=0.01)
    for row, gain in zip(found.record["gains"], gains, strict=True):
        assert row["estimate"] == pytest.approx(gain, abs=max(5 * row["std"], 2e-3 * gain))
    np.testing.assert_allclose(found.parameters, LOAD.standard, rtol=0, atol=0.01)
    assert found.record["load"]["body"][0] | {"known": True} == found.record["load"]["body"][0]
    assert found.record["fit"]["with"]["moving_relative_residual_percent"] < 1.0
    assert found.record["fit"]["chi_squared"] is None
    assert "stated mass" in found.summary()
    json.dumps(found.record, allow_nan=False)


def test_friction_can_be_held() -> None:
    found = payload(fitted(), loaded_log(), friction=False)
    assert found.record["settings"]["friction_may_change"] is False
    assert all(set(row) == {"joint", "beyond"} for row in found.record["friction"])
    assert found.parameters[9] == pytest.approx(1.5, rel=0.01)


@pytest.mark.parametrize(
    ("changes", "options", "told"),
    [
        ({"sha256": f"{1:064x}"}, {}, "is a log that the fit was made of"),
        ({"effort": None}, {}, "holds no effort"),
        ({"joints": ("a", "b", "c")}, {}, "has no joint 'joint_1'"),
        ({}, {"mass": -1.0}, "it must be above 0"),
        ({}, {"mass": 3.0}, "need the logs without the load"),
    ],
)
def test_what_can_not_be_used_is_refused(changes: dict[str, Any], options: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        payload(fitted(), replace(loaded_log(), **changes), **options)


def test_gains_of_coupled_axes_are_refused() -> None:
    coupled = replace(arm(1), transmission=Transmission(((40.0, 0, 0), (0, 30.0, 0), (0, 32.0, 32.0))))
    result = replace(fitted(), robot=coupled)
    with pytest.raises(InputError, match="coupled axes share"):
        payload(result, loaded_log(), mass=1.5, unloaded=[loaded_log()])


def test_another_arms_log_is_not_explained_by_any_load() -> None:
    other = replace(random_chain(np.random.default_rng(4), 3), gravity=arm(1).gravity)
    with pytest.raises(UnsupportedLogError, match="unexplained"):
        payload(fitted(), exact_log(other, 2, noise=0.02))


def test_an_arm_without_a_load_carries_none() -> None:
    record = payload(fitted(), replace(exact_log(arm(1), 2, noise=0.02), source="bare.mcap")).record
    assert record["verdict"]["status"] == "warn"
    assert "no load is to be seen" in record["verdict"]["reasons"][0] or "negative" in record["verdict"]["reasons"][0]


def test_a_folder_holds_the_result_and_is_replaced_by_force_alone(tmp_path: Path) -> None:
    fit = fitted().save(tmp_path / "fit")
    target = tmp_path / "load"
    record = payload_to_folder(fit, [loaded_log()], target, command="identify payload fit loaded.mcap -o load")
    assert {path.name for path in target.iterdir()} == {"payload.json", "curves.npz", "report.html"}
    assert json.loads((target / "payload.json").read_text(encoding="utf-8")) == record
    assert len(record["unloaded"]["sha256"]) == 64
    with pytest.raises(OutputError, match="--force"):
        payload_to_folder(fit, [loaded_log()], target)
    payload_to_folder(fit, [loaded_log()], target, force=True)
    with pytest.raises(OutputError, match="something else"):
        payload_to_folder(fit, [loaded_log()], fit, force=True)
    with pytest.raises(InputError, match="is no result folder"):
        payload_to_folder(target, [loaded_log()], tmp_path / "other")


def test_logs_that_can_not_tell_a_load_leave_a_folder_that_says_why(tmp_path: Path) -> None:
    """The last joint alone moves: about its axis nothing is felt of a mass."""
    fit = fitted().save(tmp_path / "fit")
    log = loaded_log()
    record = payload_to_folder(fit, [one_joint_moving(2)], tmp_path / "load")
    assert record["verdict"]["status"] == "reject"
    assert "can't tell the load's mass" in record["verdict"]["reasons"][0]
    assert "joint_1, joint_2 stand still" in record["verdict"]["reasons"][0]
    assert record["load"] is None
    assert record["load_reason"]
    assert (tmp_path / "load" / "report.html").is_file()
    static = replace(log, position=np.tile(log.position[:1], (log.samples, 1)))
    record = payload_to_folder(fit, [static], tmp_path / "static")
    assert any("static" in reason for reason in record["verdict"]["reasons"])


def test_the_truth_is_compared_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "loaded.mcap"
    loaded_log().save(path)
    log = identify.read_log(path)
    before = payload(fitted(), log).record
    truth = {"payload": [float(x) for x in LOAD.standard], "log_sha256": log.sha256}
    path.with_suffix(".truth.json").write_text(json.dumps(truth), encoding="utf-8")
    after = payload(fitted(), log).record
    rows = after["load"]["body"]
    np.testing.assert_allclose([row["truth"] for row in rows], values(LOAD), rtol=0, atol=1e-12)
    for table in ("body", "standard"):
        for row in after["load"][table]:
            row["truth"] = None
    after["load"]["truth_reason"] = before["load"]["truth_reason"]
    assert after == before
    path.with_suffix(".truth.json").write_text(json.dumps(truth | {"log_sha256": "other"}), encoding="utf-8")
    assert payload(fitted(), log).record == before


def test_a_log_error_names_the_log() -> None:
    with pytest.raises(LogError, match=r"somewhere\.mcap"):
        payload(fitted(), replace(loaded_log(), effort=None, source="somewhere.mcap"))


def test_a_heavier_load_than_the_arm_is_still_a_load() -> None:
    heavy = replace(LOAD, mass=60.0)
    log = replace(exact_log(carrying(arm(1), heavy), 2, noise=0.02), source="heavy.mcap", sha256="f" * 64)
    found = payload(fitted(), log)
    assert found.parameters[9] == pytest.approx(60.0, rel=0.01)
