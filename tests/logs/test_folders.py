"""Folders are written whole or not at all; tests/cli/test_batch.py kills their writers."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from identify.errors import OutputError
from identify.logs.folders import clear_leftovers, replacing_folder


def test_a_folder_appears_once_it_is_whole_and_replaces_all_of_an_older_one(tmp_path: Path) -> None:
    target = tmp_path / "above" / "[a] new*"
    for name in ("first", "second"):
        with replacing_folder(target) as part:
            (part / name).write_text(name)
            assert not (target / name).exists()
        assert [path.name for path in target.iterdir()] == [name]
        assert [path.name for path in target.parent.iterdir()] == [target.name]


@pytest.mark.parametrize("error", [ValueError("no"), KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_what_goes_wrong_leaves_the_older_one(error: BaseException, tmp_path: Path) -> None:
    target = tmp_path / "result"
    with replacing_folder(target) as part:
        (part / "old").touch()
    kind = OutputError if isinstance(error, OSError) else type(error)

    def fails() -> None:
        with replacing_folder(target) as part:
            (part / "new").touch()
            raise error

    with pytest.raises(kind):
        fails()
    assert [path.name for path in target.iterdir()] == ["old"]
    assert list(tmp_path.iterdir()) == [target]


def test_leftovers_of_other_names_and_work_that_goes_on_are_left_alone(tmp_path: Path) -> None:
    for name in (".result.1.part", ".result.2.part", ".results.1.part", ".result.x", "result.1.part", ".result.1.old"):
        (tmp_path / name).mkdir()
    (tmp_path / ".result.3.part").touch()  # of a file that is called like the folder
    target = tmp_path / "result"
    with replacing_folder(target) as part:
        clear_leftovers(target)
        assert part.is_dir()
        assert part.name == f".result.{os.getpid()}.part"
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == [".result.3.part", ".result.x", ".results.1.part", "result", "result.1.part"]


def test_of_two_runs_at_once_each_leaves_a_whole_folder(tmp_path: Path) -> None:
    """The one that comes second in time does not clear what the first is at work on."""
    target = tmp_path / "result"
    code = (
        "import sys\nfrom identify.logs.folders import replacing_folder\n"
        "with replacing_folder(sys.argv[1]) as part:\n"
        "    (part / 'other').touch()\n    print(flush=True)\n    sys.stdin.readline()\n"
    )
    command = [sys.executable, "-c", code, str(target)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        other.stdout.readline()
        with replacing_folder(target) as part:
            (part / "own").touch()
        assert [path.name for path in target.iterdir()] == ["own"]
        other.communicate("go on\n")
    assert other.returncode == 0
    assert [path.name for path in target.iterdir()] == ["other"]
    assert list(tmp_path.iterdir()) == [target]
