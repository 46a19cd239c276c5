"""The example that maps a batch by Dask; where Dask is not installed, that it says so."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest
from beside import optional_module
from script_modules import script


@pytest.fixture(scope="module")
def example() -> ModuleType:
    return script("example_dask")


def test_without_dask_it_says_what_brings_it(
    example: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.setattr(sys, "argv", ["example_dask", "logs", "--robot", "rx90", "-o", str(tmp_path / "out")])
    assert example.main() == 2
    assert "pip install '.[dask]'" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.filterwarnings("default")
def test_dask_maps_what_processes_map(
    example: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A log that can be fitted and one that can't, on a cluster of this machine: the parameters of `fit_log` itself."""
    optional_module("distributed", "dask", "what Dask makes of a batch")
    from dataclasses import replace

    from exact_logs import arm, exact_log

    from identify.batch.folder import summarise
    from identify.batch.reduction import Options, fit_log
    from identify.batch.sources import find_sources
    from identify.robot.toml import write_toml

    robot, logs = tmp_path / "arm.toml", tmp_path / "logs"
    robot.write_text(write_toml(arm(1)), encoding="utf-8")
    logs.mkdir()
    replace(exact_log(arm(1), noise=0.02), source="").save(logs / "good.mcap")
    (logs / "garbage.mcap").write_bytes(b"garbage")
    monkeypatch.setattr(example, "cores", lambda: 1)
    words = [str(logs), "--robot", str(robot), "-o", str(tmp_path / "out")]
    monkeypatch.setattr(sys, "argv", ["example_dask", *words])
    assert example.main() == 1
    assert "1 warn, 0 reject, 1 failed" in capsys.readouterr().out
    import json

    found = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    sources, _ = find_sources(logs)
    own = summarise([fit_log(source, str(robot)) for source in sources], Options())
    assert found["parameters"] == own["parameters"]
    assert [fit["reasons"] for fit in found["fits"]] == [fit["reasons"] for fit in own["fits"]]
