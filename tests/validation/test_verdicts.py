"""The verdict follows from the record alone: what is missing warns, what fails says where."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import pytest
from exact_logs import fitted

from identify.validation.verdict import refusals_of_fit, rejected, verdict


@pytest.fixture
def record() -> dict[str, Any]:
    return deepcopy(fitted().record)


def use(found: dict[str, Any], name: str) -> dict[str, Any]:
    (row,) = [u for u in found["uses"] if u["use"] == name]
    return row


def test_a_good_result_on_a_held_out_log_is_accepted(record: dict[str, Any]) -> None:
    found = verdict(record)
    assert (found["status"], found["reasons"]) == ("accept", [])
    assert use(found, "prediction of joint torque")["status"] == "MET"
    assert record["verdict"] == found
    assert {u["use"] for u in found["uses"]} == {"prediction of joint torque", "simulation", "payload identification"}
    for row in found["uses"]:
        assert row["status"] in ("MET", "NOT MET", "NOT TESTED")
        assert all(row[key] for key in ("result", "limit", "limit_source", "action"))


def test_without_a_held_out_log_it_warns(record: dict[str, Any]) -> None:
    record["test"] = []
    found = verdict(record)
    assert found["status"] == "warn"
    assert found["reasons"] == ["no held-out log was given, so prediction is not tested"]
    assert use(found, "prediction of joint torque")["status"] == "NOT TESTED"


def test_a_joint_predicted_worse_than_by_its_mean_is_named(record: dict[str, Any]) -> None:
    """At 99 % of its standard deviation a joint still passes, at 100 % it does not."""
    joint = record["test"][0]["per_joint"][1]
    joint["moving_rmse"] = 0.99 * joint["std_of_signal"]
    assert verdict(record)["status"] == "accept"
    joint["moving_rmse"] = joint["std_of_signal"]
    found = verdict(record)
    assert found["status"] == "warn"
    assert found["reasons"] == ["test.mcap: joint_2 predicted worse than by the mean of its torque"]
    assert use(found, "prediction of joint torque")["status"] == "NOT MET"
    assert "worst joint 1e+02 %" in use(found, "prediction of joint torque")["result"]


@pytest.mark.parametrize("engine", ["pinocchio", "mujoco"])
def test_an_engine_that_differs_is_named(record: dict[str, Any], engine: str) -> None:
    record["cross_check"][engine]["max_abs_error"] = 3e-7
    found = verdict(record)
    assert found["status"] == "warn"
    assert f"differs from {engine} by 3.0e-07" in found["reasons"][0]


def test_an_identified_model_that_an_engine_contradicts_warns(record: dict[str, Any]) -> None:
    record["cross_check"]["identified"]["pinocchio"] = {"max_abs_error": 4e-6, "samples": 10}
    assert "pinocchio on the identified model by 4.0e-06" in verdict(record)["reasons"][0]


def test_what_was_found_in_a_log_warns(record: dict[str, Any]) -> None:
    record["logs"][1]["findings"] = ["the recording has 1 gap"]
    assert verdict(record)["reasons"] == ["test.mcap: the recording has 1 gap"]


def test_a_repeat_of_the_training_motion_tests_nothing(record: dict[str, Any]) -> None:
    repeat = record["test"][0]["motion"]["repeat"]
    repeat |= {"share_percent": 30.0, "repeats": False}
    found = verdict(record)
    assert use(found, "prediction of joint torque")["status"] == "MET"
    assert "repeats the training motion for 30 % of its moving time" in found["reasons"][0]
    repeat |= {"share_percent": 80.0, "repeats": True}
    found = verdict(record)
    assert found["status"] == "warn"
    assert use(found, "prediction of joint torque")["status"] == "NOT TESTED"
    assert use(found, "simulation")["status"] == "NOT TESTED"


def test_a_training_log_tests_nothing(record: dict[str, Any]) -> None:
    record["test"][0]["is_a_training_log"] = True
    found = verdict(record)
    assert found["status"] == "warn"
    assert "test.mcap: is a training log too, so that it tests nothing" in found["reasons"]
    assert use(found, "prediction of joint torque")["status"] == "NOT TESTED"


def test_possible_links_that_predict_may_be_simulated(record: dict[str, Any]) -> None:
    found = use(verdict(record), "simulation")
    assert found["status"] == "MET"
    assert "on unseen motion" in found["result"]
    assert "identify export" in found["action"]
    record["physical"]["moved"] = [{"name": "XX3", "shift_sigma": -2.5}]
    assert "moving 1 of 28 parameters, XX3 most, by 2.5 σ" in use(verdict(record), "simulation")["result"]
    joint = record["physical"]["test"][0]["per_joint"][2]
    joint["moving_rmse"] = joint["std_of_signal"]
    assert use(verdict(record), "simulation")["status"] == "NOT MET"
    assert use(verdict(record), "prediction of joint torque")["status"] == "MET"


def test_simulation_is_not_tested_without_links_or_held_out_motion(record: dict[str, Any]) -> None:
    record["test"][0]["is_a_training_log"] = True
    assert use(verdict(record), "simulation")["status"] == "NOT TESTED"
    record["test"] = []
    assert "no held-out motion" in use(verdict(record), "simulation")["result"]
    record["physical"]["consistent"] = False
    assert use(verdict(record), "simulation")["status"] == "NOT MET"
    record["physical"], record["physical_reason"] = None, "the solver ended"
    found = use(verdict(record), "simulation")
    assert (found["status"], found["result"]) == ("NOT TESTED", "no links that physics allows: the solver ended")


def test_a_held_out_log_at_rest_tests_nothing(record: dict[str, Any]) -> None:
    for joint in record["test"][0]["per_joint"]:
        joint["moving_rmse"] = None
    found = verdict(record)
    assert found["status"] == "warn"
    assert use(found, "prediction of joint torque")["status"] == "NOT TESTED"


def test_leaving_the_trained_range_and_parameters_within_their_noise_lead_to_actions(record: dict[str, Any]) -> None:
    record["test"][0]["outside_training_percent"] = [0.0, 12.0, 3.0]
    for k, row in enumerate(record["base_parameters"]):
        row |= {"estimate": 1.0, "std": 1.01 if k == 3 else 0.99}
    outside, smaller = verdict(record)["actions"]
    assert outside.startswith("joint_2 is outside the positions of the training logs for 12 % of test.mcap")
    assert smaller.startswith("1 of 19 base parameters are smaller than their standard deviation (XXR2)")


def test_a_refused_log_has_reasons_and_one_action() -> None:
    found = rejected(("the log is static", "its effort is dead"))
    assert found["status"] == "reject"
    assert found["reasons"] == ["the log is static", "its effort is dead"]
    assert len(found["actions"]) == 1


def test_a_fit_no_better_than_no_effort_at_all_is_refused() -> None:
    """On its training logs, in motion: at 99.9 % it still explains something, at 100 % nothing."""

    def figures(**percent: float | None) -> dict[str, dict[str, Any]]:
        return {model: {"moving_relative_residual_percent": x} for model, x in percent.items()}

    assert refusals_of_fit("energy", figures(torque=3.0, energy=99.9)) == []
    assert refusals_of_fit("torque", figures(torque=3.0, energy=371.0)) == []
    (reason,) = refusals_of_fit("energy", figures(torque=3.0, energy=100.0))
    assert "energy model leaves 100 % of the effort" in reason
    assert reason.endswith("the torque model leaves 3 %")
    (alone,) = refusals_of_fit("energy", figures(energy=3571.2))
    assert "leaves 3,571 %" in alone
    assert "torque" not in alone
