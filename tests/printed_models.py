"""Printed models as functions, for tests: the Python form, run; and stored values of the RX-90 to hold them against."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from beside import stored_values

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


def stored_rx90() -> tuple[dict[str, Any], dict[str, float]]:
    """Dynamics of the RX-90 computed elsewhere, and its constants by name."""
    __tracebackhide__ = True
    known = stored_values("rx90-dynamics.json")
    constants = {name.replace("IA", "Ia"): x for name, x in known["base_params"].items()}
    for j, link in enumerate(known["std_params"], start=1):
        constants |= {f"Fs{j}": link["FS"], f"Fv{j}": link["FV"]}
    return known, constants
