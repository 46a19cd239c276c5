"""Which code a regressor runs on: NumPy, or C once it pays."""

from __future__ import annotations

import ctypes
import os

from identify.regressor.compiler import VARIABLE, Compiler, CompilerError, find_compiler, library


class Backend:
    """The compiler that all kernels of a regressor share, or the reason why there is none.

    compiler: None to compile what is used often enough, True to compile at first use, False for NumPy alone. The
    environment variable IDENTIFY_COMPILER names another compiler than cc, or is "none". `str` tells what is in use.
    """

    def __init__(self, compiler: bool | None = None) -> None:
        self.eager = bool(compiler)
        self._in_use = False
        self._compiler: Compiler | None = None
        self._reason = ""
        self._looked = False
        if compiler is False:
            self._give_up("as asked for")

    def library(self, source: str, may_compile: bool) -> ctypes.CDLL | None:
        """The source as a library, from the cache or, where `may_compile` is set, compiled; None where that fails."""
        compiler = self.compiler
        if compiler is None:
            return None
        try:
            loaded = library(source, compiler, may_compile)
        except CompilerError as error:
            self._give_up(str(error))
            return None
        self._in_use = self._in_use or loaded is not None
        return loaded

    @property
    def compiler(self) -> Compiler | None:
        """The compiler, looked for when it is first asked for."""
        if not self._looked:
            self._looked = True
            try:
                self._compiler = find_compiler(os.environ.get(VARIABLE) or None)
            except CompilerError as error:
                self._give_up(str(error))
        return self._compiler

    def _give_up(self, reason: str) -> None:
        self._compiler, self._reason, self._looked = None, reason, True

    def __str__(self) -> str:
        if self.compiler is None:
            return f"NumPy ({self._reason})"
        code = f"C ({self.compiler.version})"
        return code if self._in_use or self.eager else f"NumPy; {code} once it pays"
