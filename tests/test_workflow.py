"""The whole way from logs to a result folder: what may be looked at, what is refused, what is written."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exact_logs import arm, exact_log, fitted, fitted_with_dropped_column, motion, unknown

from identify import workflow
from identify.cli.options import ESTIMATORS
from identify.errors import InputError, LogError, OutputError, UnsupportedLogError
from identify.estimation.identification import Identification
from identify.logs.log import Log
from identify.logs.reading import read_log
from identify.logs.slicing import select, window
from identify.robot.robot import Limits, Robot, Transmission
from identify.symbolic.base_parameters import base_parameters

ARM = arm(1)
NOISE = 0.02
FRICTION = ("viscous", "coulomb", "offset")


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two simulated logs of the arm in MuJoCo, with their truths."""
    folder = tmp_path_factory.mktemp("simulated")
    for seed in (1, 2):
        workflow.run_experiment(ARM, folder / f"run{seed}.mcap", motion(ARM, seed), seed=seed)
    return folder


@pytest.fixture(scope="module")
def result(simulated: Path) -> Identification:
    """The first of them fitted, the second held out."""
    return workflow.fit(read(simulated, 1), ARM, [read(simulated, 2)])


def read(folder: Path, seed: int) -> Log:
    return read_log(folder / f"run{seed}.mcap")


def cut(log: Log, samples: int) -> Log:
    return replace(log, time=log.time[:samples], position=log.position[:samples], effort=log.effort[:samples])


def estimates(result: Identification) -> list[Any]:
    """Everything that was estimated, by both models, bit by bit, and how."""
    arrays = [x.tobytes() for x in (result.parameters, result.std, result.covariance)]
    models = [result.record["models"][model]["parameters"] for model in ("torque", "energy")]
    return [*arrays, *models, result.record["settings"]]


# What may be looked at


def test_the_truth_is_for_comparison_alone(simulated: Path, result: Identification) -> None:
    """Estimates are bit by bit the same with LOG.truth.json, without it, and with a truth that lies."""
    beside = simulated / "run1.truth.json"
    text = beside.read_text()
    truth = [b["truth"] for b in result.record["base_parameters"]]
    error = result.parameters[: len(truth)] - truth
    assert (np.abs(error) < 6 * result.std[: len(truth)]).all()
    assert result.record["simulated"] is True
    beside.write_text(json.dumps(json.loads(text) | {"standard": [1.0] * 33}))
    lied_to = workflow.fit(read(simulated, 1), ARM)
    beside.unlink()
    blind = workflow.fit(read(simulated, 1), ARM)
    beside.write_text(text)
    assert estimates(result) == estimates(lied_to) == estimates(blind)
    assert [b["truth"] for b in lied_to.record["base_parameters"]] != truth
    assert all(b["truth"] is None for b in blind.record["base_parameters"])
    assert all(row[key]["truth"] is None for row in blind.record["friction"] for key in FRICTION)
    assert "LOG.truth.json" in blind.record["truth_reason"]
    assert "truth_reason" not in result.record
    # Nor does a held-out log change anything but its own figures.
    assert blind.record["test"] == []
    assert blind.record["test_reason"] == "no held-out log was given"
    assert blind.record["fit"] == result.record["fit"]


def test_what_the_robot_says_of_inertia_and_friction_is_never_looked_at(
    simulated: Path, result: Identification
) -> None:
    """Neither is the velocity that a drive reports, but for the figures."""
    log, test = (replace(read(simulated, seed), velocity=None) for seed in (1, 2))
    untold = workflow.fit(log, unknown(ARM), [test])
    assert estimates(untold) == estimates(result)
    np.testing.assert_array_equal(untold.predict(test), result.predict(test))
    assert untold.record["robot"]["sha256"] != result.record["robot"]["sha256"]
    assert untold.record["fit"]["per_joint"][0]["rmse"] == result.record["fit"]["per_joint"][0]["rmse"]
    assert untold.record["fit"]["per_joint"][0]["moving_rmse"] != result.record["fit"]["per_joint"][0]["moving_rmse"]


# What comes out


def test_a_simulated_arm_is_identified(result: Identification) -> None:
    assert result.record["verdict"]["status"] == "accept"
    (test,) = result.record["test"]
    assert test["moving_relative_residual_percent"] < 1.0
    for row, joint in zip(result.record["friction"], ARM.joints, strict=True):
        for key in FRICTION:
            true = getattr(joint.drive, key)
            assert row[key]["truth"] == pytest.approx(true)
            assert abs(row[key]["estimate"] - true) < 6 * row[key]["std"]
    assert result.record["models"]["agreement"]["largest_z"] < 8


def test_joints_are_found_by_name_and_others_left_alone() -> None:
    log = exact_log(ARM, noise=NOISE)
    names = ARM.joint_names
    extra = replace(
        log,
        joints=(*names, "gripper"),
        position=np.column_stack([log.position, np.zeros(log.samples)]),
        effort=np.column_stack([log.effort, np.zeros(log.samples)]),
    )
    shuffled = select(extra, (names[1], "gripper", names[2], names[0]))
    assert estimates(workflow.fit(shuffled, ARM)) == estimates(workflow.fit(log, ARM))


def test_several_logs_tell_more_than_one() -> None:
    logs = [exact_log(ARM, seed, noise=NOISE, source=f"{seed}.mcap") for seed in (1, 2, 3)]
    both, one = workflow.fit(logs[:2], ARM, logs[2:]), workflow.fit(logs[0], ARM)
    assert np.median(both.std / one.std) < 0.8
    assert [(entry["path"], entry["role"]) for entry in both.record["logs"]] == [
        ("1.mcap", "train"),
        ("2.mcap", "train"),
        ("3.mcap", "test"),
    ]
    assert {name.split("/")[0] for name in both.curves} == {"train0", "train1", "test0", "residual"}
    assert both.record["fit"]["samples_used"] > 1.8 * one.record["fit"]["samples_used"]


def test_logs_of_other_rates_lengths_and_orders_of_joints_are_welcome() -> None:
    """A fast log, a slow one, and one of 5 s with its joints in another order: together they tell more than one."""
    fast, slow = exact_log(ARM, 1, noise=NOISE), exact_log(ARM, 2, rate=125.0, noise=NOISE)
    names = ARM.joint_names
    short = select(window(exact_log(ARM, 3, rate=800.0, noise=NOISE), 1.0, 6.0), (names[2], names[0], names[1]))
    result = workflow.fit([fast, slow, short], ARM)
    assert result.record["fit"]["moving_relative_residual_percent"] < 0.3
    assert [row["rate_hz"] for row in result.record["logs"]] == pytest.approx([250.0, 125.0, 800.0])
    assert all(row["findings"] == [] for row in result.record["logs"])
    alone = workflow.fit(fast, ARM)
    assert np.median(result.std / alone.std) < 0.8
    truth = base_parameters(ARM).matrix @ ARM.standard
    assert (np.abs(result.parameters[: len(truth)] - truth) < 6 * result.std[: len(truth)]).all()


@pytest.mark.parametrize("estimator", ["ols", "all"])
def test_estimators(estimator: str) -> None:
    found = workflow.fit(exact_log(ARM, 1, noise=NOISE), ARM, [exact_log(ARM, 2, noise=NOISE)], estimator=estimator)
    default = fitted().record["test"][0]["moving_relative_residual_percent"]
    if estimator == "ols":
        assert "ordinary" in found.record["estimator"]
        assert found.record["estimator"] != fitted().record["estimator"]
        assert "estimators" not in found.record
        assert found.parameters.tolist() != fitted().parameters.tolist()
        assert found.record["test"][0]["moving_relative_residual_percent"] < 3 * default
    else:
        assert estimates(found) == estimates(fitted())
        rows = {row["estimator"]: row for row in found.record["estimators"]}
        assert tuple(rows) == tuple(ESTIMATORS)
        assert rows["wls"]["test"]["moving_relative_residual_percent"] == pytest.approx(default)
        refused = {name for name, row in rows.items() if "reason" in row}
        assert refused == {"idim-iv", "didim", "ml"}
        assert all("controller" in rows[name]["reason"] for name in ("idim-iv", "didim"))
        assert "repeat itself" in rows["ml"]["reason"]
        assert {name for name, row in rows.items() if row.get("why")} == {"wls", "energy"}
        for row in (rows[name] for name in set(rows) - refused):
            assert row["condition_number"] > 1
            assert row["test"]["moving_relative_residual_percent"] < 5 * default


def test_estimators_are_not_tested_on_the_training_motion_once_more() -> None:
    """The same motion under other noise counts for none of them; without another log there is no test, and why."""
    train, repeat = exact_log(ARM, 1, noise=NOISE), exact_log(ARM, 1, noise=2 * NOISE, source="again.mcap")
    unseen = exact_log(ARM, 2, noise=NOISE, source="other.mcap")
    fair, mixed, none = (
        workflow.fit(train, ARM, test, estimator="all").record["estimators"]
        for test in ([unseen], [unseen, repeat], [repeat])
    )
    assert [row["test"] for row in mixed] == [row["test"] for row in fair]
    for row in none:
        assert row["test"] is None
        assert row.get("reason") or "another motion" in row["test_reason"]


def test_the_energy_model_is_the_result_that_was_asked_for() -> None:
    """The one that a fit of the torque model shows beside it."""
    found = workflow.fit(exact_log(ARM, 1, noise=NOISE), ARM, [exact_log(ARM, 2, noise=NOISE)], model="energy")
    beside = fitted().record["models"]["energy"]
    assert found.record["model"] == "energy"
    assert found.parameters.tolist() == [row["estimate"] for row in beside["parameters"]]
    assert found.record["fit"]["energy_residual_percent"] == beside["energy_residual_percent"] < 0.1
    assert found.record["settings"]["window_s"] == beside["window_s"]
    assert fitted().record["fit"]["energy_residual_percent"] is None
    assert found.record["test"][0]["moving_relative_residual_percent"] < 0.2
    assert found.record["models"]["torque"] == fitted().record["models"]["torque"]


def test_a_coupled_wrist_brings_its_own_columns() -> None:
    """Motor 3 turns with joint 2 as well: its inertia and friction, as other motors' are, come out of the log."""
    coupled = replace(ARM, transmission=Transmission(((10.0, 0, 0), (0, 12.0, 0), (0, 15.0, 15.0))))
    log = exact_log(ARM, 1)
    _, dq, ddq = motion(ARM, 1).sample(log.time)
    motor = dq[:, 1] + dq[:, 2]
    cross = np.zeros_like(dq)
    cross[:, 1] = 0.3 * ddq[:, 2] + 0.8 * dq[:, 2] + 1.5 * np.sign(motor)
    cross[:, 2] = 0.3 * ddq[:, 1] + 0.8 * dq[:, 1] + 1.5 * np.sign(motor)
    result = workflow.fit(replace(log, effort=log.effort + cross), coupled)
    found = {row["name"]: row["estimate"] for row in result.record["transmission"]}
    assert list(found) == ["Iam3", "Fvm3", "Fsm3"]
    assert list(found.values()) == pytest.approx([0.3, 0.8, 1.5], rel=0.05)


# What is refused


def static(robot: Robot) -> Log:
    log = exact_log(robot)
    return replace(log, position=np.tile(log.position[:1], (log.samples, 1)))


def one_joint_still(robot: Robot) -> Log:
    """Joint 1 never moves: its friction says nothing."""
    log = exact_log(robot)
    position = log.position.copy()
    position[:, 0] = 0.2
    return replace(log, position=position)


def dead_effort(robot: Robot) -> Log:
    log = exact_log(robot)
    effort = log.effort.copy()
    effort[:, 1] = 3.0
    return replace(log, effort=effort)


@pytest.mark.parametrize(
    ("log", "reason"),
    [
        (static(ARM), "static: no joint moves"),
        (cut(exact_log(ARM), 150), "too short: 150 samples"),
        (cut(exact_log(ARM), 330), "equations are left for 28 parameters|can't tell|says nothing about|too short"),
        (dead_effort(ARM), "effort of joint_2 never changes"),
        (replace(exact_log(ARM), effort=None), "no effort"),
        (one_joint_still(ARM), "says nothing about|can't tell"),
    ],
)
@pytest.mark.parametrize("model", ["torque", "energy"])
def test_a_log_that_can_not_support_a_result_leaves_a_folder_that_says_why(
    log: Log, reason: str, model: str, tmp_path: Path
) -> None:
    with pytest.raises(UnsupportedLogError, match=reason):
        workflow.fit(log, ARM, model=model)
    record = workflow.fit_to_folder([log], ARM, tmp_path / "refused", model=model)
    assert record["verdict"]["status"] == "reject"
    assert record["verdict"]["reasons"]
    assert record["base_parameters"] == record["names"] == record["friction"] == []
    assert record["fit"] is None
    assert {path.name for path in (tmp_path / "refused").iterdir()} >= {"parameters.json", "report.html"}
    written = json.loads((tmp_path / "refused" / "parameters.json").read_text())
    assert written == record
    assert list(unexplained(written)) == []
    with pytest.raises(InputError, match="refused"):
        Identification.load(tmp_path / "refused")


def test_a_model_that_explains_none_of_its_training_log_is_refused(tmp_path: Path) -> None:
    """4 s with 10 N·m of noise: the torque model still explains the effort, the energy model is worse than nothing."""
    log = cut(exact_log(ARM, noise=10.0), 1000)
    assert workflow.fit(log, ARM, friction="plain").record["fit"]["moving_relative_residual_percent"] < 50
    record = workflow.fit_to_folder([log], ARM, tmp_path / "refused", model="energy", friction="plain")
    assert record["verdict"]["status"] == "reject"
    assert "energy model leaves" in record["verdict"]["reasons"][0]
    assert record["base_parameters"] == []
    assert (tmp_path / "refused" / "report.html").exists()


def test_a_log_of_another_robot_is_no_log_of_this_one(tmp_path: Path) -> None:
    log = replace(exact_log(ARM), joints=("a", "b", "c"), source="other.mcap")
    with pytest.raises(LogError, match=r"other\.mcap: has no joint 'joint_1'; it has a, b, c"):
        workflow.fit_to_folder([log], ARM, tmp_path / "none")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"model": "power"}, "model is 'power'; choose one of torque, energy"),
        ({"estimator": "best"}, "'best'; choose"),
        ({"model": "energy", "friction": "cube_root"}, "cube_root is of the torque model alone"),
        ({"model": "torque", "estimator": "power"}, "of the energy model; of the torque model are ols"),
    ],
)
def test_what_there_is_not_can_not_be_chosen(choice: dict[str, str], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        workflow.fit_to_folder([exact_log(ARM)], ARM, tmp_path / "none", **choice)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_a_held_out_log_without_effort_is_an_input_error() -> None:
    log = exact_log(ARM)
    with pytest.raises(LogError, match="no effort to test against"):
        workflow.fit(log, ARM, [replace(log, effort=None)])


def test_an_existing_folder_is_found_before_any_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fitted().save(tmp_path / "result")
    monkeypatch.setattr(workflow, "fit", lambda *a, **k: pytest.fail("worked in vain"))
    with pytest.raises(OutputError, match="exists"):
        workflow.fit_to_folder([exact_log(ARM)], ARM, tmp_path / "result")


# What is written


def unexplained(node: Any, path: str = "", above: tuple[dict[str, Any], ...] = ()) -> Iterator[str]:
    """Places of null without a "<key>_reason" beside it, or beside what it stands in."""
    if isinstance(node, dict):
        for key, value in node.items():
            if value is None and not any(part.get(f"{key}_reason") for part in (*above, node)):
                yield f"{path}.{key}"
            yield from unexplained(value, f"{path}.{key}", (*above, node))
    elif isinstance(node, list):
        for k, value in enumerate(node):
            if value is None:
                yield f"{path}[{k}]"
            yield from unexplained(value, f"{path}[{k}]", above)


ESTIMATE = {"estimate": float, "std": float}
FIGURES: dict[str, Any] = {
    "relative_residual_percent": float,
    "moving_relative_residual_percent": float,
    "per_joint": [
        {
            "joint": str,
            "unit": str,
            "rmse": float,
            "relative_residual_percent": float,
            "moving_rmse": float,
            "rest_rmse": float,
        }
    ],
}
INTERFACE: dict[str, Any] = {
    "format": str,
    "robot": {"name": str, "source": str, "sha256": str},
    "model": str,
    "logs": [{"path": str, "role": str, "sha256": str, "samples": int, "rate_hz": float}],
    "base_parameters": [
        {
            "name": str,
            "grouping": str,
            "unit": str,
            **ESTIMATE,
            "relative_std_percent": float,
            "identified": bool,
            "truth": float,
        }
    ],
    "friction": [{"joint": str, **dict.fromkeys(FRICTION, ESTIMATE)}],
    "transmission": [{"name": str, **ESTIMATE}],
    "covariance": [[float]],
    "fit": {**FIGURES, "condition_number": float, "samples_used": int},
    "test": [{"path": str, **FIGURES}],
    "cross_check": {key: {"max_abs_error": float, "samples": int} for key in ("pinocchio", "mujoco")},
    "physical": {
        "consistent": bool,
        "links": [{"name": str, "min_eigenvalue": float, "mass": float, "com": [float], "inertia": [float]}],
        "drives": [{"joint": str, "inertia": float, "viscous": float, "coulomb": float, "offset": float}],
        "parameters": [float],
        "cost": {"chi_squared": float},
        "moved": [{"name": str, "estimate": float, "consistent": float, "shift_sigma": float}],
    },
    "verdict": {"status": str, "reasons": [str]},
    "versions": dict.fromkeys(("identify", "python", "numpy", "pin", "mujoco"), str),
    "seed": int,
    "command": str,
}
"""The keys that the public interface fixes, and what they hold where they are not null."""


def check(value: Any, form: Any, path: str = "parameters.json") -> None:
    """Fail unless every key of the form is there with a value of its kind, or null."""
    if value is None:
        return
    if isinstance(form, dict):
        assert isinstance(value, dict), path
        for key, inner in form.items():
            assert key in value, f"{path}.{key} is missing"
            check(value[key], inner, f"{path}.{key}")
    elif isinstance(form, list):
        assert isinstance(value, list), path
        for k, item in enumerate(value):
            check(item, form[0], f"{path}[{k}]")
    else:
        assert isinstance(value, form), f"{path} is {value!r}"


def not_json(constant: str) -> float:
    raise AssertionError(f"{constant} is no JSON")


def unlimited() -> Identification:
    """A robot of which nothing but the geometry is known, fitted by its energies, every estimator shown."""
    bare = unknown(replace(ARM, joints=tuple(replace(joint, limits=Limits()) for joint in ARM.joints)))
    log = exact_log(ARM, noise=NOISE)
    return workflow.fit(log, bare, model="energy", estimator="all", command="identify fit …")


@pytest.mark.parametrize("kind", ["simulated", "made", "dropped column", "unlimited"])
def test_parameters_json_is_what_the_interface_says(kind: str, result: Identification, tmp_path: Path) -> None:
    made = {"made": fitted, "dropped column": fitted_with_dropped_column, "unlimited": unlimited}
    (made[kind]() if kind in made else result).save(tmp_path / "result")
    text = (tmp_path / "result" / "parameters.json").read_text(encoding="utf-8")
    record = json.loads(text, parse_constant=not_json)
    check(record, INTERFACE)
    assert list(unexplained(record)) == []
    assert record["format"] == "identify/parameters/1"
    assert record["physical"]["consistent"] is True
    assert len(record["physical"]["parameters"]) == len(record["names"])
    expected = ("energy", "identify fit …") if kind == "unlimited" else ("torque", "")
    assert (record["model"], record["command"]) == expected
    p = len(record["names"])
    assert np.array(record["covariance"]).shape == (p, p)
    rows = [*record["base_parameters"]]
    for row in record["friction"]:
        rows += [row[key] for key in FRICTION if row[key] is not None]
    rows += record["transmission"]
    assert [row["std"] for row in rows] == pytest.approx(np.sqrt(np.diag(record["covariance"])).tolist())
    for row in record["base_parameters"]:
        assert row["relative_std_percent"] == pytest.approx(100 * row["std"] / abs(row["estimate"]))
        assert row["identified"] is (row["relative_std_percent"] < 10)


def test_a_rerun_is_byte_identical(simulated: Path, tmp_path: Path) -> None:
    for name in ("first", "second"):
        workflow.fit_to_folder([read(simulated, 1)], ARM, tmp_path / name)
    first, second = ({p.name: p.read_bytes() for p in (tmp_path / name).iterdir()} for name in ("first", "second"))
    assert set(first) == {"parameters.json", "curves.npz", "robot.toml", "report.html"}
    assert first == second
    assert first["report.html"].rstrip().endswith(b"</html>")


def test_a_report_that_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fitted().save(tmp_path / "result")
    before = {p.name: p.read_bytes() for p in (tmp_path / "result").iterdir()}

    def broken(*arguments: object) -> str:
        raise OSError("no page")

    monkeypatch.setattr("identify.report.page.render", broken)
    monkeypatch.setattr(workflow, "fit", lambda *arguments: fitted())
    with pytest.raises(OSError, match="no page"):
        workflow.fit_to_folder([exact_log(ARM)], ARM, tmp_path / "result", force=True)
    assert {p.name: p.read_bytes() for p in (tmp_path / "result").iterdir()} == before
    assert [p.name for p in tmp_path.iterdir()] == ["result"]


def test_progress_goes_from_nothing_to_the_end(tmp_path: Path) -> None:
    told: list[tuple[float, str]] = []
    workflow.fit_to_folder(
        [exact_log(ARM)], ARM, tmp_path / "result", progress=lambda share, text: told.append((share, text))
    )
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert shares[0] == 0
    assert 0.9 < shares[-1] <= 1
    assert all(text for _, text in told)
