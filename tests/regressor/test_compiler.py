"""Compiled code: the same bits as NumPy's, kept safely, and never in the way."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from beside import c_compiler
from chains import random_chain
from symbolic_models import states, tilted

from identify.regressor import compiler as module
from identify.regressor import kernel
from identify.regressor.compiler import Compiler, CompilerError, cache_folder, find_compiler, library
from identify.regressor.regressor import Regressor
from identify.robot.library import load_robot

SOURCE = "int answer(void) { return 42; }\n"


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of each test's own, and no choice of a compiler from outside."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv(module.VARIABLE, raising=False)
    return tmp_path / "identify"


@pytest.fixture
def compiler(cache: Path) -> Compiler:
    """What the package finds on a machine that has a compiler."""
    c_compiler()
    return find_compiler(None)


needs_compiler = pytest.mark.usefixtures("compiler")


def libraries(cache: Path) -> list[Path]:
    return sorted(cache.glob("*.so"))


@needs_compiler
@pytest.mark.parametrize("robot", ["tx40", 1, 2, 3])
def test_c_and_numpy_give_the_same_bits(robot: str | int) -> None:
    """Every function, whole blocks and what is left over, one sample alone, arrays in any order of memory."""
    rng = np.random.default_rng(7)
    arm = load_robot(robot) if isinstance(robot, str) else tilted(random_chain(rng, 2 + robot, tree=robot == 2))
    c, numpy = Regressor(arm, compiler=True), Regressor(arm, compiler=False)
    assert c.backend.startswith("C (")
    assert numpy.backend == "NumPy (as asked for)"
    theta = rng.normal(size=c.p)
    for count in (1, 8, kernel.BLOCK + 13):
        q, dq, ddq = states(rng, arm, count)
        dq[0, 0] = 0.0
        np.testing.assert_array_equal(c.torque(q, dq, ddq), numpy.torque(q, dq, ddq))
        np.testing.assert_array_equal(c.torque(q[0], dq[0], ddq[0]), numpy.torque(q, dq, ddq)[0])
        np.testing.assert_array_equal(numpy.torque(q[0], dq[0], ddq[0]), numpy.torque(q, dq, ddq)[0])
        np.testing.assert_array_equal(c.energy(q, dq), numpy.energy(q, dq))
        np.testing.assert_array_equal(c.slotine_li(q, dq, ddq, q), numpy.slotine_li(q, dq, ddq, q))
        np.testing.assert_array_equal(c.inverse_dynamics(q, dq, ddq, theta), numpy.inverse_dynamics(q, dq, ddq, theta))
        np.testing.assert_array_equal(
            c.inverse_dynamics(q[0], dq[0], ddq[0], theta), numpy.inverse_dynamics(q, dq, ddq, theta)[0]
        )
        outs = [np.full((c.p, arm.n, count), np.nan).T for _ in range(2)]
        strided = [np.asfortranarray(np.repeat(x, 2, axis=0))[::2] for x in (q, dq, ddq)]
        c.torque(*strided, out=outs[0])
        numpy.torque(q, dq, ddq, out=outs[1])
        np.testing.assert_array_equal(*outs)
    whole = np.arange(arm.n)
    np.testing.assert_array_equal(c.torque(whole, whole, whole), numpy.torque(*[whole.astype(float)] * 3))
    many = np.tile(whole, (9, 1))
    np.testing.assert_array_equal(c.torque(many, many, many), numpy.torque(*[many.astype(float)] * 3))
    # Had compiling failed on the way, NumPy would have been held against itself.
    assert c.backend.startswith("C (")


@needs_compiler
def test_compiling_waits_until_it_pays(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel, "WORTH", 300)
    robot = random_chain(np.random.default_rng(1), 3)
    q, dq, ddq = states(np.random.default_rng(0), robot, 100)
    regressor = Regressor(robot)
    assert "once it pays" in regressor.backend
    first = [regressor.torque(q, dq, ddq) for _ in range(2)]
    assert "once it pays" in regressor.backend
    assert libraries(cache) == []
    then = [regressor.torque(q, dq, ddq) for _ in range(2)]
    assert regressor.backend.startswith("C (")
    assert len(libraries(cache)) == 1
    np.testing.assert_array_equal(first, then)
    # What is in the cache already is used at once.
    another = Regressor(robot)
    another.torque(q[0], dq[0], ddq[0])
    assert another.backend == regressor.backend


def test_a_library_is_private_and_compiled_once(
    cache: Path, monkeypatch: pytest.MonkeyPatch, compiler: Compiler
) -> None:
    first = library(SOURCE, compiler)
    assert first is not None
    assert first.answer() == 42
    (file,) = libraries(cache)
    assert [path.name for path in cache.iterdir()] == [file.name]
    assert stat.S_IMODE(cache.stat().st_mode) == 0o700
    assert not stat.S_IMODE(file.stat().st_mode) & 0o077
    assert library("int other(void) { return 1; }\n", compiler, may_compile=False) is None

    def compiled(*_: object) -> Path:
        raise AssertionError("compiled again")

    monkeypatch.setattr(module, "_compiled", compiled)
    again = library(SOURCE, compiler)
    assert again is not None
    assert again.answer() == 42
    with pytest.raises(AssertionError, match="again"):
        library(SOURCE, Compiler(compiler.path, "another version"))
    monkeypatch.setattr(module, "_machine", lambda: "another machine")
    with pytest.raises(AssertionError, match="again"):
        library(SOURCE, compiler)


@pytest.mark.parametrize("damage", [b"", b"\x7fELF", None])
def test_a_damaged_library_is_made_again(cache: Path, damage: bytes | None, compiler: Compiler) -> None:
    """Cut short, empty, or whole with one byte changed: loading such a file could end the process."""
    library(SOURCE, compiler)
    (file,) = libraries(cache)
    whole = file.read_bytes()
    # A new file: the old one is mapped into this process.
    file.unlink()
    file.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]) if damage is None else damage)
    file.chmod(0o600)
    again = library(SOURCE, compiler)
    assert again is not None
    assert again.answer() == 42
    assert libraries(cache)[0].read_bytes() == whole


def test_a_library_that_others_may_write_is_not_loaded(cache: Path, compiler: Compiler) -> None:
    library(SOURCE, compiler)
    (file,) = libraries(cache)
    file.chmod(0o666)
    assert library(SOURCE, compiler, may_compile=False) is None
    assert libraries(cache) == []


def backend_that_numpy_replaces() -> str:
    """What a regressor that was to compile says of its backend once NumPy has done the work, and done it right."""
    robot = random_chain(np.random.default_rng(1), 2)
    regressor = Regressor(robot, compiler=True)
    q, dq, ddq = states(np.random.default_rng(0), robot, 20)
    expected = Regressor(robot, compiler=False).torque(q, dq, ddq)
    np.testing.assert_array_equal(regressor.torque(q, dq, ddq), expected)
    assert regressor.backend.startswith("NumPy (")
    return regressor.backend


def refuse(cache: Path, monkeypatch: pytest.MonkeyPatch, how: str) -> None:
    if how == "a file":
        cache.write_text("here")
    elif how == "a link":
        (cache.parent / "elsewhere").mkdir()
        cache.symlink_to(cache.parent / "elsewhere")
    elif how == "foreign":
        cache.mkdir(mode=0o700)
        monkeypatch.setattr(os, "geteuid", lambda: 1 + cache.stat().st_uid)
    elif how == "writable":
        cache.mkdir()
        cache.chmod(0o777)
    elif how == "read-only":
        cache.mkdir(mode=0o700)

        def no(*_: object, **__: object) -> None:
            raise PermissionError(13, "Permission denied", str(cache))

        monkeypatch.setattr(module.tempfile, "mkdtemp", no)  # a mode would not stop the superuser


@needs_compiler
@pytest.mark.parametrize("how", ["a file", "a link", "foreign", "writable", "read-only"])
def test_without_a_safe_folder_numpy_does_the_work(cache: Path, monkeypatch: pytest.MonkeyPatch, how: str) -> None:
    refuse(cache, monkeypatch, how)
    assert str(cache) in backend_that_numpy_replaces()
    assert libraries(cache) == []


@pytest.mark.parametrize(
    ("script", "reason"),
    [
        ("echo broken 1.0", "No such file|kernel"),  # compiles nothing and says it did
        ('[ "$1" = --version ] && echo broken 1.0 || { echo out of memory >&2; exit 1; }', "out of memory"),
        ("exit 3", "failed"),
        ('[ "$1" = --version ] && echo bad 1 || echo no library > "${@: -2:1}"', "invalid|header|kernel|too short"),
    ],
)
def test_a_compiler_that_fails_leaves_numpy(
    script: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tool = tmp_path / "cc-broken"
    tool.write_text(f"#!/bin/bash\n{script}\n")
    tool.chmod(0o755)
    monkeypatch.setenv(module.VARIABLE, str(tool))
    backend_that_numpy_replaces()


def test_none_and_nothing_installed_say_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    robot = random_chain(np.random.default_rng(1), 2)
    monkeypatch.setenv(module.VARIABLE, "none")
    assert Regressor(robot).backend == "NumPy (IDENTIFY_COMPILER is none)"
    monkeypatch.delenv(module.VARIABLE)
    monkeypatch.setenv("PATH", str(tmp_path))
    find_compiler.cache_clear()
    try:
        assert Regressor(robot).backend == "NumPy (no C compiler: cc or gcc or clang)"
    finally:
        find_compiler.cache_clear()


@needs_compiler
def test_two_processes_may_compile_at_once(cache: Path) -> None:
    code = (
        "from identify.regressor.compiler import find_compiler, library\n"
        f"print(library({SOURCE!r}, find_compiler(None)).answer())"
    )
    running = [
        subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[2])
        for _ in range(3)
    ]
    assert [process.communicate(timeout=60)[0] for process in running] == ["42\n"] * 3
    assert 1 <= len(libraries(cache)) <= 3
    assert libraries(cache) == sorted(cache.iterdir())


def test_the_cache_stays_small(cache: Path, monkeypatch: pytest.MonkeyPatch, compiler: Compiler) -> None:
    monkeypatch.setattr(module, "KEPT", 3)
    cache.mkdir(mode=0o700)
    for name, age in (("part-killed", 1e5), ("part-at-work", 0.0)):
        (cache / name).mkdir()
        (cache / name / "kernel.c").touch()
        os.utime(cache / name, (time.time() - age,) * 2)
    for k in range(5):
        library(f"int answer(void) {{ return {k}; }}\n", compiler)
        for file in libraries(cache):
            os.utime(file, (file.stat().st_mtime - 10,) * 2)
    assert len(libraries(cache)) == 3
    assert [path.name for path in cache.glob("part-*")] == ["part-at-work"]
    last = library("int answer(void) { return 4; }\n", compiler, may_compile=False)
    assert last is not None
    assert last.answer() == 4


def test_a_relative_cache_folder_does_not_count(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "somewhere")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(module.sys, "platform", "linux")
    assert cache_folder() == tmp_path / ".cache" / "identify"
    monkeypatch.setattr(module.sys, "platform", "darwin")
    assert cache_folder() == tmp_path / "Library" / "Caches" / "identify"


def test_what_fails_is_a_compiler_error(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CompilerError, match="no C compiler: no-such-thing"):
        find_compiler("no-such-thing")
