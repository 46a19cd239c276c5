"""A few hundred of the damaged inputs of scripts/check_fuzz: each is read or refused in one line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_damaged_inputs_are_read_or_refused(tmp_path: Path) -> None:
    program = [sys.executable, str(ROOT / "scripts" / "check_fuzz"), "--no-hostile", "--keep", str(tmp_path)]
    amount = ["--count", "300", "--seed", "11", "--commands", "2"]
    told = subprocess.run([*program, *amount], capture_output=True, text=True, timeout=120)
    assert told.returncode == 0, told.stdout + told.stderr
    assert "0 failed" in told.stdout
    assert not list(tmp_path.iterdir())
    rows = {line.split()[0]: [int(word) for word in line.split()[1:4]] for line in told.stdout.splitlines()[1:8]}
    assert set(rows) == {"bag", "csv", "map", "mcap", "npz", "toml", "urdf"}
    assert sum(sum(row) for row in rows.values()) == 300
    # Damage is neither always fatal nor always without effect.
    assert min(rows["mcap"][:2]) > 20
    assert min(rows["csv"][:2]) > 3
