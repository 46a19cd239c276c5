"""C compiled once and kept: in the user's own cache folder, under a name made of its content.

Nothing here may stop the work: whatever fails raises CompilerError with the reason, and NumPy does the work instead.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

FLAGS = ("-O3", "-std=c99", "-fPIC", "-shared", "-fno-math-errno", "-ffp-contract=off")
"""Sums and products stay as written, none fused, so that every compiler gives the same bits."""

NATIVE = "-march=native"
VARIABLE = "IDENTIFY_COMPILER"
"""Environment variable: the compiler to use, or "none"."""

KEPT = 64
"""Libraries kept in the cache; those not used for longest go first."""

PATIENCE_S = 120.0


class CompilerError(Exception):
    """Why there is no compiled code."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler: where it is and the first line of what it says of its version."""

    path: str
    version: str


@lru_cache(maxsize=8)
def find_compiler(command: str | None) -> Compiler:
    """The compiler of this name, or where it is None the first of cc, gcc and clang."""
    if command == "none":
        raise CompilerError(f"{VARIABLE} is none")
    names = (command,) if command else ("cc", "gcc", "clang")
    path = next((found for name in names if (found := shutil.which(name))), None)
    if path is None:
        raise CompilerError(f"no C compiler: {' or '.join(names)}")
    path = os.path.abspath(path)
    lines = _run([path, "--version"]).splitlines()
    return Compiler(path, lines[0] if lines else Path(path).name)


def library(source: str, compiler: Compiler, may_compile: bool = True) -> ctypes.CDLL | None:
    """The source as a loaded library, from the cache or compiled into it; None where it is not there and `may_compile`
    is not set. CompilerError where neither works."""
    try:
        folder = cache_folder()
        key = _digest("1", source, *FLAGS, compiler.path, compiler.version, _machine())
        for file in folder.glob(f"{key}-*.so"):
            if _sound(file):
                os.utime(file)
                return ctypes.CDLL(str(file))
            file.unlink(missing_ok=True)
        if not may_compile:
            return None
        file = _compiled(source, compiler, folder, key)
        _tidy(folder, file)
        return ctypes.CDLL(str(file))
    except OSError as error:
        raise CompilerError(str(error)) from error


def cache_folder() -> Path:
    """The user's cache folder of this package, made if need be. CompilerError where others could put files there."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(base):
        try:
            base = str(Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache"))
        except RuntimeError as error:
            raise CompilerError(f"no cache folder: {error}") from error
    folder = Path(base) / "identify"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or not _private(found):
        raise CompilerError(f"{folder}: belongs to, or can be written by, somebody else")
    folder.chmod(0o700)
    return folder


def _private(found: os.stat_result) -> bool:
    """Owned by this user, and nobody else may write."""
    return found.st_uid == os.geteuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _sound(file: Path) -> bool:
    """A private file whose content is what its name says: loading a damaged one could end the process."""
    found = file.lstat()
    if not stat.S_ISREG(found.st_mode) or not _private(found):
        return False
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16] == file.stem.split("-")[1]


def _compiled(source: str, compiler: Compiler, folder: Path, key: str) -> Path:
    """Compile beside the place and rename: other processes see a whole file or none."""
    with tempfile.TemporaryDirectory(prefix="part-", dir=folder) as part:
        text, made = Path(part) / "kernel.c", Path(part) / "kernel.so"
        text.write_text(source, encoding="ascii")
        command = [compiler.path, *FLAGS, str(text), "-o", str(made)]
        try:
            _run([*command, NATIVE], TMPDIR=part)
        except CompilerError:
            _run(command, TMPDIR=part)
        made.chmod(0o600)
        content = hashlib.sha256(made.read_bytes()).hexdigest()[:16]
        file = folder / f"{key}-{content}.so"
        os.replace(made, file)
    return file


def _tidy(folder: Path, newest: Path) -> None:
    """Remove the libraries not used for longest, and what compilations that were killed left behind."""
    ages: list[tuple[float, Path]] = []
    for file in (*folder.glob("*.so"), *folder.glob("part-*")):
        try:
            ages.append((file.stat().st_mtime, file))
        except FileNotFoundError:
            continue  # another process tidies too
    libraries = sorted((age, file) for age, file in ages if file.suffix == ".so" and file != newest)
    for _, file in libraries[: max(0, len(libraries) + 1 - KEPT)]:
        file.unlink(missing_ok=True)
    for age, part in ages:
        if part.suffix != ".so" and age < time.time() - 10 * PATIENCE_S:
            shutil.rmtree(part, ignore_errors=True)


@lru_cache(maxsize=1)
def _machine() -> str:
    """What the code is made for: a home folder may be shared by machines with different processors."""
    parts = [sys.platform, platform.machine(), platform.processor()]
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").split("\n\n")[0].splitlines()
        parts += [line for line in lines if line.startswith(("model name", "flags", "Features", "CPU part"))]
    except OSError:
        if sys.platform == "darwin":
            parts.append(_run(["/usr/sbin/sysctl", "-n", "machdep.cpu.brand_string"]))
    return "\n".join(parts)


def _digest(*texts: str) -> str:
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:32]


def _run(command: list[str], **environment: str) -> str:
    """What the command says. CompilerError where it fails."""
    try:
        done = subprocess.run(
            command,
            env=os.environ | environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=PATIENCE_S,
            check=True,
        )
    except subprocess.CalledProcessError as error:
        said = error.stderr.decode(errors="replace").strip().splitlines()
        raise CompilerError(f"{command[0]} failed: {said[0] if said else error.returncode}") from error
    except (OSError, subprocess.SubprocessError) as error:
        raise CompilerError(f"{command[0]} failed: {error}") from error
    return done.stdout.decode(errors="replace")
