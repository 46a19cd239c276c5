"""The shell of every command: help, usage errors, exit statuses, defects, and what reaches which stream."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from identify import __version__
from identify.cli import commands
from identify.cli.main import DEBUG, main
from identify.cli.parser import build_parser
from identify.errors import RobotError, UnsupportedLogError

HEAVY = ("numpy", "scipy", "sympy", "mujoco", "pinocchio", "matplotlib", "mcap", "mcap_ros2")


def fails(run, *arguments: str) -> str:
    """The one line with which the command line is refused."""
    outcome = run(*arguments)
    assert outcome.status == 2
    assert outcome.out == ""
    assert outcome.err.startswith("identify: error: ")
    assert outcome.err.count("\n") == 1
    return outcome.err


@pytest.mark.parametrize(
    "code",
    [
        "import identify",
        "import identify.cli.main as cli; assert cli.main(['--help']) == 0; assert cli.main(['fit', '--help']) == 0",
    ],
)
def test_nothing_heavy_is_imported_before_a_command_runs(code: str) -> None:
    check = f"{code}; import sys; print([name for name in {HEAVY!r} if name in sys.modules])"
    output = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True).stdout
    assert output.splitlines()[-1] == "[]"


def test_help_names_every_command_and_each_has_an_example(run) -> None:
    overview = run("--help")
    assert overview.status == 0
    assert overview.err == ""
    for name in commands.COMMANDS:
        assert f"\n    {name} " in overview.out
        own = run(name, "--help")
        assert own.status == 0
        assert f"example:\n  identify {name} " in own.out


@pytest.mark.parametrize("name", commands.COMMANDS)
def test_the_example_of_a_command_is_one_that_parses(run, name: str) -> None:
    example = run(name, "--help").out.split("example:\n  identify ")[1].split()
    assert build_parser().parse_args(example).command == name


def test_the_version_is_that_of_the_package(run) -> None:
    assert run("--version").out == f"identify {__version__}\n"


def test_a_command_line_that_makes_no_sense_is_one_line(run) -> None:
    assert "COMMAND" in fails(run)
    assert "'fitt'" in fails(run, "fitt")
    assert "--robot" in fails(run, "fit", "a.mcap", "-o", "x")
    assert "identify fit --help" in fails(run, "fit", "a.mcap", "-o", "x")
    assert "'best'" in fails(run, "fit", "a.mcap", "--robot", "rx90", "-o", "x", "--estimator", "best")
    assert "--jsn" in fails(run, "check", "rx90", "--jsn")
    assert "--rob" in fails(run, "inspect", "a.mcap", "--rob", "rx90")
    assert "'-3' is not a whole number" in fails(run, "excite", "rx90", "-o", "x.toml", "--seed=-3")
    assert "'0' is not a time above 0 s" in fails(run, "excite", "rx90", "-o", "x.toml", "--duration", "0")
    assert "'nan' is not a number of seconds" in fails(run, "import", "a.csv", "-o", "b.csv", "--start", "nan")
    assert "the name is empty" in fails(run, "predict", "x", "a.mcap", "-o", "")
    assert not list(Path.cwd().iterdir())


@pytest.mark.parametrize(
    ("error", "status", "words"),
    [
        (RobotError("a.toml: line\nbreak\x1b[2J"), 2, "identify: error: a.toml: line break\ufffd[2J"),
        (UnsupportedLogError("static", "too short"), 1, "identify: error: static; too short"),
        (PermissionError(13, "Permission denied", "a.mcap"), 2, "identify: error: a.mcap: Permission denied; check"),
        (KeyboardInterrupt(), 130, "identify: error: interrupted"),
        (ZeroDivisionError("division by zero"), 3, "identify: error: ZeroDivisionError: division by zero; this is a"),
        (AssertionError(), 3, "identify: error: AssertionError; this is a defect of identify"),
    ],
)
def test_what_goes_wrong_is_one_line_and_a_status(run, monkeypatch, error, status, words) -> None:
    def broken(options, arguments):
        raise error

    monkeypatch.delenv(DEBUG, raising=False)
    monkeypatch.setitem(commands.COMMANDS, "check", broken)
    outcome = run("check", "rx90")
    assert outcome.status == status
    assert outcome.out == ""
    assert outcome.err.startswith(words)
    assert outcome.err.count("\n") == 1


def test_a_defect_shows_where_it_happened_when_asked(monkeypatch) -> None:
    def broken(options, arguments):
        raise ZeroDivisionError

    monkeypatch.setenv(DEBUG, "1")
    monkeypatch.setitem(commands.COMMANDS, "check", broken)
    with pytest.raises(ZeroDivisionError):
        main(["check", "rx90"])


def test_a_reader_that_leaves_ends_the_command_quietly(arm) -> None:
    command = [sys.executable, "-m", "identify.cli.main", "inspect", str(arm.train)]
    read, write = os.pipe()
    os.close(read)
    try:
        ended = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, check=False)
    finally:
        os.close(write)
    assert ended.stderr == b""
    assert ended.returncode == 141


def test_a_terminal_without_block_characters_does_not_stop_the_work(arm) -> None:
    command = [sys.executable, "-m", "identify.cli.main", "inspect", str(arm.train)]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    ended = subprocess.run(command, capture_output=True, env=environment, check=False)
    assert ended.returncode == 0
    assert ended.stderr == b""
    assert b"shoulder" in ended.stdout
