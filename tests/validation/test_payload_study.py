"""The study of loads that reports/payload.md is made by, and the bars that it holds them to."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def cells(text: str, section: str, first: str) -> list[list[str]]:
    """Cells of the rows of one section that begin with a word."""
    part = text.split(f"## {section}")[1].split("\n## ")[0]
    return [[c.strip() for c in line.split("|")[1:-1]] for line in part.splitlines() if line.startswith(f"| {first}")]


def test_quick_study_of_loads_meets_its_bars(tmp_path: Path) -> None:
    target = tmp_path / "payload.md"
    words = [sys.executable, str(ROOT / "scripts" / "study_payload"), "--quick", "-o", str(target)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    text = target.read_text(encoding="utf-8")
    rows = cells(text, "Errors and deviations", "random")
    assert [row[1] for row in rows] == ["2", "9"]
    for row in rows:
        assert 0 < float(row[2]) < 0.5
        assert 0 < float(row[4]) < 1.0
    free, held = cells(text, "Friction that changes with the load", "random")
    assert float(free[3]) < 1.0 < float(held[3])
    assert all(float(row[2]) < 1.0 for row in cells(text, "Drive gains", "random"))
    assert "MISSED" not in text


def test_the_committed_report_is_the_scripts_and_misses_no_bar() -> None:
    text = (ROOT / "reports" / "payload.md").read_text(encoding="utf-8")
    assert "Made by `scripts/study_payload`:" in text
    assert "MISSED" not in text
    assert [row[1] for row in cells(text, "Errors and deviations", "designed")] == ["2", "3", "5", "7", "9"]
    for row in cells(text, "Do the deviations hold?", ""):
        if re.fullmatch(r"\d+", row[2]):
            assert 93.0 < float(row[5]) < 99.0
