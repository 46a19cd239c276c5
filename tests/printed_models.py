"""Printed models as functions, for tests: the Python form, run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from identify.symbolic.model import SymbolicModel
from identify.symbolic.rendering import arguments, render


def printed(model: SymbolicModel) -> Callable[..., Any]:
    """The function that the Python form defines, called with signals by name; arrays come back as arrays.

    Signals that are not given are zero; `constants` {name: value} are lengths and parameters with other values than
    the robot's, for this call; those that the model does not read are left alone.
    """
    space: dict = {}
    exec(compile(render(model, "python"), model.what, "exec"), space)
    function = space[model.what.replace("-", "_")]
    own = dict(model.constants)

    def called(constants: Mapping[str, float] | None = None, **signals: np.ndarray) -> Any:
        space.update({name: float((constants or {}).get(name, value)) for name, value in own.items()})
        given = [signals.get(name, np.zeros(len(entries))) for name, entries in arguments(model)]
        answer = function(*(np.asarray(x, dtype=float).tolist() for x in given))
        if isinstance(answer, dict):
            return {name: np.array(x) for name, x in answer.items()}
        return np.array(answer)

    return called
