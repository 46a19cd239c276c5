"""Two results of one robot side by side: what differs between them, and whether by more than chance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

import numpy as np

from identify.errors import InputError
from identify.estimation.identification import FRICTION, Identification
from identify.numbers import finite
from identify.robot.robot import GEOMETRY
from identify.validation.comparison_friction import friction_rows, friction_tests
from identify.validation.comparison_residuals import shared_logs, training_rows
from identify.validation.significance import LEVEL, common_factor, holm, joint_test, single_p

FORMAT = "identify/comparison/1"
_SOFTWARE = "versions"
_COUNTS = ("rows", "effective_samples")


def compare(first: Identification, second: Identification, folders: tuple[str, str]) -> dict[str, Any]:
    """What differs between two results, as a table that JSON can hold; folders: what they are called, A and B.

    Estimates are held against each other by their own covariances, taken as independent, where no log was fitted by
    both; with one that was, no chance is stated, as their errors are alike. Three families are tested, each at LEVEL:
    the friction of each joint (all its constants at once), link and motor parameters one by one, and those all
    together. σ is widened by `factor` where even the parameters that differ least differ by more than chance explains.
    InputError, in one line, where the two are of different robots or have no parameter in common.
    """
    pair = (first, second)
    records = (first.record, second.record)
    _same_robot(pair, folders)
    shared, only = _names(pair, folders)
    both_fitted = sorted(_digests(records[0], "train") & _digests(records[1], "train"))
    independent = not both_fitted
    x, covariances = _estimates(pair, shared)
    difference, covariance = x[1] - x[0], covariances[0] + covariances[1]
    rows = _parameters(pair, shared, x, covariances)
    frictions = friction_rows(pair)
    comparable = _comparable(rows, frictions)
    z = difference / np.maximum(np.sqrt(np.diag(covariance)), 1e-300)
    freedom = _freedom(records)
    every = joint_test(difference[comparable], covariance[np.ix_(comparable, comparable)], freedom)
    factor = common_factor(z[comparable]) if every is not None and every.p < LEVEL else 1.0
    tests: dict[str, Any] = {"level": LEVEL, "freedom": None if freedom == inf else freedom, "factor": factor}
    if independent:
        covariance = factor**2 * covariance
        chosen = comparable & np.array([row["kind"] != "friction" for row in rows])
        single = holm(single_p(z[chosen] / factor, freedom))
        for at, p in zip(np.flatnonzero(chosen), single, strict=True):
            rows[at] |= {"p": float(p), "changed": bool(p < LEVEL)}
        friction_tests(frictions, shared, difference, covariance, freedom)
        together = joint_test(difference[chosen], covariance[np.ix_(chosen, chosen)], freedom)
        tests["links"] = None if together is None else {"parameters": int(chosen.sum()), **vars(together)}
    else:
        tests["links"], tests["reason"] = None, "both results were fitted to the same log"
    for k, row in enumerate(rows):
        row["z"] = float(z[k]) if comparable[k] else None
        row.setdefault("p", None)
        row.setdefault("changed", None)
    return {
        "format": FORMAT,
        "results": [_about(result, folder) for result, folder in zip(pair, folders, strict=True)],
        "robot": _robots(pair),
        "same_parameters": bool(shared and not any(only) and np.array_equal(x[0], x[1])),
        "fitted_by_both": _paths(records[0], both_fitted),
        "settings": _settings(records),
        "tests": tests,
        "parameters": rows,
        "only": [list(names) for names in only],
        "friction": frictions,
        "training": training_rows(records),
        "logs": shared_logs(pair),
        "links": _links(records),
    }


def _same_robot(pair: Sequence[Identification], folders: Sequence[str]) -> None:
    kinds = [[(joint.name, joint.type) for joint in result.robot.joints] for result in pair]
    names = [result.robot.name for result in pair]
    if kinds[0] == kinds[1] and (names[0] == names[1] or not _frames(pair)):
        return
    joints = [", ".join(name for name, _ in found) for found in kinds]
    told = [f"{name} with the joints {text}" for name, text in zip(names, joints, strict=True)]
    if kinds[0] == kinds[1]:
        told = names
    raise InputError(f"{folders[1]}: is of {told[1]}, and {folders[0]} of {told[0]}; compare two results of one robot")


def _names(pair: Sequence[Identification], folders: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    """Parameters that both results have, grouped alike, and those of each that the other has not."""
    groups = [{b["name"]: b["grouping"] for b in result.record["base_parameters"]} for result in pair]
    alike = {name for name in set(pair[0].names) & set(pair[1].names) if groups[0].get(name) == groups[1].get(name)}
    if not alike:
        raise InputError(f"{folders[1]}: has no parameter that {folders[0]} has; compare two results of one robot")
    return (
        [name for name in pair[0].names if name in alike],
        [[name for name in result.names if name not in alike] for result in pair],
    )


def _estimates(pair: Sequence[Identification], names: Sequence[str]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Estimates (2, m) of the named parameters and their covariances, (m, m) each."""
    places = [[result.names.index(name) for name in names] for result in pair]
    x = np.array([result.parameters[at] for result, at in zip(pair, places, strict=True)])
    return x, [result.covariance[np.ix_(at, at)] for result, at in zip(pair, places, strict=True)]


def _parameters(
    pair: Sequence[Identification], names: Sequence[str], x: np.ndarray, covariances: Sequence[np.ndarray]
) -> list[dict[str, Any]]:
    """A row for each shared parameter: both estimates, and the difference B − A with its σ as of independent errors."""
    about: dict[str, dict[str, Any]] = {}
    record = pair[0].record
    about |= {b["name"]: {"kind": "link", "link": b.get("link"), "unit": b["unit"]} for b in record["base_parameters"]}
    about |= {t["name"]: {"kind": "motor", "link": None, "unit": t["unit"]} for t in record["transmission"]}
    for j, row in enumerate(record["friction"], 1):
        for key, letters in FRICTION:
            if isinstance(row.get(key), Mapping):
                about[f"{letters}{j}"] = {"kind": "friction", "link": j, "unit": row[key]["unit"]}
    sigma = np.sqrt([np.diag(covariance) for covariance in covariances])
    return [
        {
            "name": name,
            **about[name],
            "estimates": [{"estimate": float(x[i, k]), "std": float(sigma[i, k])} for i in (0, 1)],
            "difference": float(x[1, k] - x[0, k]),
            "std": float(np.hypot(*sigma[:, k])),
        }
        for k, name in enumerate(names)
    ]


def _comparable(rows: Sequence[Mapping[str, Any]], frictions: Sequence[Mapping[str, Any]]) -> np.ndarray:
    """(m,) whether a parameter means the same in both: constants of friction do where its forms are the same."""
    alike = [joint["same_forms"] for joint in frictions]
    motors = all(alike)
    return np.array(
        [
            alike[row["link"] - 1] if row["kind"] == "friction" else motors if row["kind"] == "motor" else True
            for row in rows
        ],
        dtype=bool,
    )


def _freedom(records: Sequence[Mapping[str, Any]]) -> float:
    """Degrees of freedom behind the standard deviations: the fewer effective samples, less the parameters."""
    found = []
    for record in records:
        effective = finite((record.get("settings") or {}).get("effective_samples"))
        if effective is not None:
            found.append(max(effective - len(record["names"]), 1.0))
    return min(found, default=inf)


def _about(result: Identification, folder: str) -> dict[str, Any]:
    record = result.record
    keys = ("model", "estimator", "simulated", "versions", "command")
    return {
        "folder": folder,
        **{key: record.get(key) for key in keys},
        "robot": {key: record["robot"].get(key) for key in ("name", "source", "sha256")},
        "logs": [
            {key: log.get(key) for key in ("path", "role", "sha256", "samples", "duration_s", "simulated", "noise")}
            for log in record["logs"]
        ],
        "condition_number": record["fit"].get("condition_number"),
        "parameters": len(record["names"]),
        "effective_samples": (record.get("settings") or {}).get("effective_samples"),
        "verdict": {key: record["verdict"].get(key) for key in ("status", "reasons", "uses")},
    }


def _robots(pair: Sequence[Identification]) -> dict[str, Any]:
    """Whether both results are of the same robot file, and where not, what differs in it."""
    frames = _frames(pair)
    differs = frames + [
        f"{key} of {which}" for key in ("link", "drive", "limits") if (which := _joints_that_differ(pair, (key,)))
    ]
    same = pair[0].record["robot"]["sha256"] == pair[1].record["robot"]["sha256"]
    return {"name": pair[0].robot.name, "same": same, "same_frames": not frames, "differs": [] if same else differs}


def _frames(pair: Sequence[Identification]) -> list[str]:
    """What differs between two robots of that which gives base parameters their meaning."""
    a, b = (result.robot for result in pair)
    which = _joints_that_differ(pair, ("type", "parent", *GEOMETRY))
    found = [f"geometry of {which}"] if which else []
    return found + [key for key in ("gravity", "transmission") if getattr(a, key) != getattr(b, key)]


def _joints_that_differ(pair: Sequence[Identification], keys: Sequence[str]) -> str:
    joints = list(zip(*(result.robot.joints for result in pair), strict=True))
    found = [p.name for p, q in joints if any(getattr(p, key) != getattr(q, key) for key in keys)]
    return "all joints" if len(found) == len(joints) else ", ".join(found)


def _digests(record: Mapping[str, Any], role: str) -> set[str]:
    return {log["sha256"] for log in record["logs"] if log["role"] == role and log.get("sha256")}


def _paths(record: Mapping[str, Any], digests: Sequence[str]) -> list[str]:
    found = {log["sha256"]: log["path"] for log in record["logs"]}
    return [found[digest] for digest in digests]


def _settings(records: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Model, estimator, processing and software wherever the two differ."""
    tables = []
    for record in records:
        table: dict[str, Any] = {"model": record["model"], "estimator": record.get("estimator")}
        for key, value in (record.get("settings") or {}).items():
            if key == "friction":
                table[key] = ", ".join(["plain", *value])
            elif key not in _COUNTS and isinstance(value, (str, int, float)) and not key.endswith("_reason"):
                table[key] = value
        table |= {f"{_SOFTWARE}: {name}": text for name, text in (record.get(_SOFTWARE) or {}).items()}
        tables.append(table)
    names = list(dict.fromkeys([*tables[0], *tables[1]]))
    values = [(name, [table.get(name) for table in tables]) for name in names]
    return [{"name": name, "values": pair} for name, pair in values if pair[0] != pair[1]]


def _links(records: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The possible links of both results, side by side; none where one has none."""
    tables = [{row["name"]: row for row in (record.get("physical") or {}).get("links") or []} for record in records]
    return [{"name": name, "links": [table[name] for table in tables]} for name in tables[0] if name in tables[1]]
