"""Two results of an arm whose changes are known: those are found, and nothing else."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from compared_results import WEAR, WORN, heavier, result
from exact_logs import arm

from identify.errors import InputError
from identify.estimation.identification import Identification
from identify.regressor.regressor import Regressor
from identify.validation.comparison import compare
from identify.validation.comparison_findings import cautions, findings

FOLDERS = ("march", "april")


def states(comparison: dict) -> list[str]:
    return [row["state"] for row in findings(comparison)]


def told(comparison: dict, about: str) -> str:
    return next(row["text"] for row in findings(comparison) if row["about"] == about)


def test_the_same_arm_recorded_twice_shows_no_change() -> None:
    found = compare(result("before", 1), result("again", 3), FOLDERS)
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    assert states(found)[:2] == ["NO CHANGE SEEN", "NO CHANGE SEEN"]
    assert [row["changed"] for row in found["friction"]] == [False] * 3
    assert cautions(found) == []
    assert found["robot"]["same"]
    assert found["only"] == [[], []]
    (log,) = found["logs"]
    assert (log["path"], log["roles"], log["fair"]) == ("unseen.mcap", ["test", "test"], True)


def test_wear_is_found_on_its_joint_with_its_size() -> None:
    found = compare(result("before", 1), result("worn", 4), FOLDERS)
    assert states(found) == ["CHANGED", "NO CHANGE SEEN", "A BETTER"]
    assert [row["changed"] for row in found["friction"]] == [k + 1 == WORN for k in range(3)]
    more = (WEAR - 1) * arm(1).joints[WORN - 1].drive.coulomb
    for level in found["friction"][WORN - 1]["levels"]:
        assert abs(level["difference"] - more) < 4 * level["std"]
        assert abs(level["difference"]) > 10 * level["std"]
    assert f"it changed on {arm(1).joint_names[WORN - 1]} at" in told(found, "friction")
    assert "other 2 of 3 joints" in told(found, "friction")
    back = compare(result("worn", 4), result("before", 1), FOLDERS)
    assert states(back)[2] == "B BETTER"
    assert [row["difference"] for row in back["parameters"]] == [-row["difference"] for row in found["parameters"]]
    assert [row["p"] for row in back["friction"]] == pytest.approx([row["p"] for row in found["friction"]])


def test_what_is_called_changed_of_a_heavier_link_did_change() -> None:
    found = compare(result("before", 1), result("heavier", 4), FOLDERS)
    assert states(found)[:2] == ["NO CHANGE SEEN", "CHANGED"]
    base = Regressor(arm(1)).base
    truth = dict(zip(base.names, base.matrix @ (heavier().standard - arm(1).standard), strict=True))
    changed = [row for row in found["parameters"] if row["changed"]]
    assert changed
    for row in changed:
        assert abs(truth[row["name"]]) > row["std"]
        assert abs(row["difference"] - truth[row["name"]]) < 4 * row["std"]
    factor = found["tests"]["factor"]
    missed = [row for row in found["parameters"] if row["kind"] == "link" and not row["changed"]]
    assert all(abs(truth[row["name"]]) < 7 * factor * row["std"] for row in missed)
    assert ("much as chance allows" in " ".join(cautions(found))) == (factor > 1)


def test_other_forms_of_friction_are_shown_and_not_tested() -> None:
    found = compare(result("before", 1), result("worn", 4, "cube_root"), FOLDERS)
    assert states(found)[:2] == ["NOT TESTED", "NO CHANGE SEEN"]
    assert found["only"] == [[], ["Fc1", "Fc2", "Fc3"]]
    assert not any(row["same_forms"] for row in found["friction"])
    assert all(row["z"] is None for row in found["parameters"] if row["kind"] == "friction")
    more = (WEAR - 1) * arm(1).joints[WORN - 1].drive.coulomb
    fast = found["friction"][WORN - 1]["levels"][1]
    assert abs(fast["difference"] - more) < 5 * fast["std"]
    assert "same `--friction`" in told(found, "friction")


@pytest.mark.parametrize(("plant", "forms"), [("before", "plain"), ("worn", "cube_root")])
def test_levels_and_curves_are_the_regressors_friction(plant: str, forms: str) -> None:
    mine = result(plant, 1 if plant == "before" else 4, forms)
    found = compare(mine, mine, FOLDERS)
    still, regressor = np.zeros((1, 3)), mine.regressor

    def friction(j: int, velocity: float) -> tuple[float, float]:
        speed = still.copy()
        speed[0, j] = velocity
        row = regressor.torque(still, speed, still, sign=mine.settings.sign)[0, j]
        row[: len(regressor.base.names)] = 0.0
        return float(row @ mine.parameters), float(np.sqrt(row @ mine.covariance @ row))

    for j, row in enumerate(found["friction"]):
        for level in row["levels"]:
            value = 0.5 * (friction(j, level["speed"])[0] - friction(j, -level["speed"])[0])
            assert level["estimates"][0]["estimate"] == pytest.approx(value, rel=1e-12)
        for k in (0, 20, -1):
            value, std = friction(j, row["curve"]["velocity"][k])
            assert row["curve"]["estimates"][1][k] == pytest.approx(value, rel=1e-12)
            assert row["curve"]["std"][1][k] == pytest.approx(std, rel=1e-9)


def test_results_of_one_log_are_never_tested_and_the_reader_is_told() -> None:
    found = compare(result("before", 1), result("before", 1, estimator="ols"), FOLDERS)
    assert states(found)[:2] == ["NOT TESTED", "NOT TESTED"]
    assert found["fitted_by_both"] == ["before.mcap"]
    assert all(row["p"] is None and row["changed"] is None for row in [*found["parameters"], *found["friction"]])
    assert "their errors are alike" in cautions(found)[0]
    assert [row["name"] for row in found["settings"]].count("estimator") == 1


def test_a_result_against_itself() -> None:
    found = compare(result("before", 1), result("before", 1), FOLDERS)
    assert found["same_parameters"]
    assert set(states(found)) == {"NO CHANGE SEEN"}
    assert found["settings"] == []


def test_a_log_that_one_was_fitted_to_decides_nothing() -> None:
    mine = result("worn", 4)
    logs = [log | {"role": "train"} for log in mine.record["logs"]]
    found = compare(result("before", 1), replace(mine, record=mine.record | {"logs": logs}), FOLDERS)
    (log,) = found["logs"]
    assert (log["fair"], log["better"], log["better_reason"]) == (False, None, "B was fitted to it")
    assert states(found)[2] == "NOT TESTED"


def renamed(found: Identification, **changes: object) -> Identification:
    return replace(found, robot=replace(found.robot, **changes))


def test_other_robots_are_refused_in_one_line() -> None:
    mine = result("before", 1)
    first, *others = mine.robot.joints
    for change, words in (
        ({"joints": (replace(first, name="elsewhere"), *others)}, "elsewhere"),
        ({"name": "another arm", "joints": (replace(first, d=0.77), *others)}, "another arm"),
    ):
        with pytest.raises(InputError, match=f"april: is of .*{words}.*, and march of .*compare two results of one"):
            compare(mine, renamed(mine, **change), FOLDERS)
    same = compare(mine, renamed(mine, name="a new name"), FOLDERS)
    assert same["robot"]["same_frames"]
    moved = compare(mine, renamed(mine, joints=(replace(first, d=0.77), *others)), FOLDERS)
    assert not moved["robot"]["same_frames"]
