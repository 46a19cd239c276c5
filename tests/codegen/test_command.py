"""`identify codegen` says what it leaves out."""

from __future__ import annotations

from pathlib import Path

import pytest

from identify.cli.main import main

TREE = """
name = "fork"
[[joint]]
name = "trunk"
[[joint]]
name = "left"
d = 0.3
alpha = 1.5707963267948966
[[joint]]
name = "right"
parent = "trunk"
d = -0.2
link = { mass = 2.0, com = [0.1, 0.2, 0.3], inertia = [0.1, 0.0, 0.0, 0.2, 0.0, 0.3] }
"""


@pytest.mark.parametrize("language", ["c", "python"])
def test_the_reason_stands_on_the_command_line_and_in_the_file(
    language: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot, folder = tmp_path / "fork.toml", tmp_path / "code"
    robot.write_text(TREE, encoding="utf-8")
    assert main(["codegen", str(robot), "-o", str(folder), "--language", language]) == 0
    told = capsys.readouterr()
    why = "inverse geometry is left out: the robot's joints branch"
    assert told.err.startswith(f"fork: {why}")
    assert told.err.count("\n") == 1
    written = "".join(Path(line).read_text(encoding="utf-8") for line in told.out.splitlines())
    assert why in written.replace("Inverse", "inverse")
    assert "_inverse_geometry(" not in written
    assert "def inverse_geometry(" not in written
