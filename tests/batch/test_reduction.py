"""One log's fit as a function of files: plain values, and a reason instead of an exception."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exact_logs import arm, exact_log

from identify.batch.reduction import FAILED, Options, fit_log
from identify.batch.sources import Source
from identify.robot.toml import write_toml
from identify.symbolic.base_parameters import base_parameters

ARM = arm(1)


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("robot") / "arm.toml"
    path.write_text(write_toml(ARM), encoding="utf-8")
    return str(path)


def true_base() -> np.ndarray:
    return base_parameters(ARM).matrix @ ARM.standard


def test_a_fit_is_plain_values_and_writes_nothing_unless_asked(robot: str, tmp_path: Path) -> None:
    replace(exact_log(ARM, noise=0.02), source="").save(tmp_path / "run.mcap")
    before = sorted(tmp_path.rglob("*"))
    source, options = pickle.loads(pickle.dumps((Source(str(tmp_path / "run.mcap"), "run"), Options())))
    steps: list[float] = []
    found = fit_log(source, robot, None, options, lambda share, text: steps.append(share))
    assert sorted(tmp_path.rglob("*")) == before
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    assert (found["status"], found["folder"], found["name"]) == ("warn", None, "run")
    truth = true_base()
    estimates = np.array([p["estimate"] for p in found["parameters"]])[: len(truth)]
    std = np.array([p["std"] for p in found["parameters"]])[: len(truth)]
    assert (np.abs(estimates - truth) < 6 * std).all()
    assert 1 < found["independent_parameters"] < len(found["parameters"])
    assert steps
    assert steps == sorted(steps)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("none.mcap", None, "no such file"),
        ("empty.mcap", b"", "is empty"),
        ("garbage.mcap", b"garbage" * 99, "is not an MCAP file"),
        ("table.csv", b"a,b\n1,2\n", "table.csv"),
    ],
)
def test_what_can_not_be_read_is_a_row_with_its_reason(
    name: str, content: bytes | None, reason: str, robot: str, tmp_path: Path
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    found = fit_log(Source(str(tmp_path / name), "x"), robot, str(tmp_path / "out"))
    assert found["status"] == FAILED
    assert reason in found["reasons"][0]
    assert found["parameters"] == []
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("error", "told"),
    [(ZeroDivisionError("oh"), "a defect of identify: ZeroDivisionError: oh"), (MemoryError(), "memory")],
)
def test_a_defect_is_a_row_too(error: Exception, told: str, robot: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*arguments: object) -> None:
        raise error

    monkeypatch.setattr("identify.logs.reading.read_log", broken)
    assert told in fit_log(Source("x.mcap", "x"), robot)["reasons"][0]
