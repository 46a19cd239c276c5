"""The two studies that reports/ is made by, and the bars they hold a fit to."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from beside import shared, tx40_recording
from script_modules import module

from identify.cli.main import main as command

ROOT = Path(__file__).parents[2]


def test_quick_study_of_a_simulated_arm_meets_its_bars(tmp_path: Path) -> None:
    target = tmp_path / "simulated.md"
    words = [sys.executable, str(ROOT / "scripts" / "study_simulated"), "--quick", "-o", str(target)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    text = target.read_text(encoding="utf-8")
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("| torque")
    ]
    none, standard, seeds = rows
    assert none[1] == "none"
    assert float(none[3]) == float(none[4]) <= 0.05
    assert standard[1] == "standard"
    assert float(standard[3]) < float(standard[4]) <= 0.1
    assert float(standard[3]) <= 0.04
    largest = re.match(r"\d\.\d+", seeds[2])
    assert seeds[1] == "3"
    assert largest is not None
    assert 1.0 < float(largest[0]) <= 4.5
    assert "MISSED" not in text


def test_measured_tx40_by_commands_and_the_rule(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Trained on the last 60 %, tested on the first 40 %: files of `import` and `predict`, scored by the script."""
    rule, recording = module(shared("score.py")), tx40_recording()

    def run(*words: str | Path) -> None:
        assert command([str(word) for word in words]) == 0, capsys.readouterr().err

    source, result = (recording, "--map", ROOT / "datasets" / "tx40.toml"), tmp_path / "result"
    parts = {"train": ("--start", "3.6"), "test": ("--stop", "3.6")}
    for part, limits in parts.items():
        for suffix in ("mcap", "csv"):
            run("import", *source, "-o", tmp_path / f"{part}.{suffix}", *limits)
    run("fit", tmp_path / "train.mcap", "--robot", "tx40", "-o", result, "--test", tmp_path / "test.mcap")
    percent = {}
    for part in parts:
        prediction = tmp_path / f"{part}-predicted.csv"
        run("predict", result, tmp_path / f"{part}.mcap", "-o", prediction)
        score = rule.score(rule.load(tmp_path / f"{part}.csv"), rule.load(prediction))
        assert score["coverage_pct"] == 100.0
        percent[part] = {key: score[key]["rel_pct"] for key in ("filtered", "moving")}
    assert percent["train"]["filtered"] <= 7.7
    assert percent["test"]["filtered"] <= 8.9
    record = json.loads((result / "parameters.json").read_text())
    for part, own in (("train", record["fit"]), ("test", record["test"][0])):
        assert own["relative_residual_percent"] == pytest.approx(percent[part]["filtered"], abs=1e-3)
        assert own["moving_relative_residual_percent"] == pytest.approx(percent[part]["moving"], abs=1e-3)


def test_the_tx40_study_says_what_it_needs(tmp_path: Path) -> None:
    words = [sys.executable, str(ROOT / "scripts" / "study_tx40"), str(tmp_path / "none"), "-o", str(tmp_path / "x.md")]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "no such folder" in done.stderr.splitlines()[-1]
    assert not (tmp_path / "x.md").exists()
