"""Reading the record: units, joints, logs, and the reasons that stand beside what is missing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from identify.estimation.identification import FRICTION
from identify.numbers import finite

Record = Mapping[str, Any]
UNKNOWN = "no reason recorded"


def part(record: Any, *path: str) -> Any:
    """The value at a path of keys, None where the path ends early."""
    for key in path:
        record = record.get(key) if isinstance(record, Mapping) else None
    return record


def items(record: Any, *path: str) -> list[Any]:
    """The list at a path of keys, empty where there is none."""
    value = part(record, *path)
    return list(value) if isinstance(value, Sequence) and not isinstance(value, str) else []


def reason(record: Any, *path: str) -> str:
    """Why the value at the path is missing: the `<name>_reason` beside it, or beside the nearest missing parent.

    Of a refused log it is, at last, the reason why nothing was fitted.
    """
    for depth in range(1, len(path) + 1):
        parent = part(record, *path[: depth - 1]) if depth > 1 else record
        text = part(parent, f"{path[depth - 1]}_reason")
        if text and not part(parent, path[depth - 1]):
            return str(text)
    if rejected(record) and not part(record, "fit"):
        return str(part(record, "fit_reason") or UNKNOWN)
    return UNKNOWN


def missing(record: Any) -> list[tuple[str, str]]:
    """(path of keys, reason) of every value of the record that is missing; in a list, alike ones once."""
    return list(dict.fromkeys(_missing(record, "")))


def _missing(value: Any, path: str) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping):
        for key, inner in value.items():
            name = str(key)
            if name.endswith("_reason") and inner and value.get(name.removesuffix("_reason")) in (None, [], {}):
                yield path + name.removesuffix("_reason"), str(inner)
            else:
                yield from _missing(inner, f"{path}{name}.")
    elif isinstance(value, (list, tuple)):
        for inner in value:
            yield from _missing(inner, path)


def joints(record: Record) -> list[Mapping[str, Any]]:
    """The robot's joints, each with at least a name and units."""
    return [
        {
            **joint,
            "name": str(joint.get("name", f"joint {k}")),
            "effort_unit": str(joint.get("effort_unit") or "N·m"),
            "position_unit": str(joint.get("position_unit") or "rad"),
        }
        for k, joint in enumerate(items(record, "robot", "joints"), 1)
    ]


def effort_name(joint: Mapping[str, Any]) -> str:
    """What the joint's effort is called: torque or force."""
    return "force" if joint["effort_unit"] == "N" else "torque"


def logs(record: Record, role: str) -> list[Mapping[str, Any]]:
    """The logs of one role, "train" or "test"."""
    return [log for log in items(record, "logs") if part(log, "role") == role]


def tests(record: Record) -> list[Mapping[str, Any]]:
    """The results on held-out logs; empty where there were none."""
    return [test for test in items(record, "test") if isinstance(test, Mapping)]


def joint_row(results: Any, name: str) -> Mapping[str, Any]:
    """The row of one joint in `per_joint`, empty where there is none."""
    return next((row for row in items(results, "per_joint") if part(row, "joint") == name), {})


def short(path: Any) -> str:
    """The last part of a path, which is what a reader knows a log by."""
    return str(path or "log").replace("\\", "/").rstrip("/").rsplit("/", 1)[-1]


def rejected(record: Record) -> bool:
    """Whether the logs could not support a result."""
    return part(record, "verdict", "status") == "reject"


def units(record: Record) -> dict[str, str]:
    """Unit of every parameter by its name: base parameters, friction, transmission."""
    found = {str(p.get("name")): str(p.get("unit") or "") for p in items(record, "base_parameters")}
    for k, joint in enumerate(items(record, "friction"), 1):
        for key, letters in FRICTION:
            found[f"{letters}{k}"] = str(part(joint, key, "unit") or "")
    return found | {str(p.get("name")): str(p.get("unit") or "") for p in items(record, "transmission")}


def ratio(part_of: Any, whole: Any) -> float | None:
    """100 · a / b in percent, None where either is missing or b is zero."""
    a, b = finite(part_of), finite(whole)
    return 100 * a / b if a is not None and b else None
