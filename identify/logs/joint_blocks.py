"""Messages of one length into blocks of joint states: in bulk by their layout, or else one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from identify.logs import joint_state
from identify.logs.joint_messages import Kind, State
from identify.logs.joint_series import Block

_LAYOUTS_PER_RUN = 8
_LAYOUTS_KEPT = 64
_ONES_AT_ONCE = 4096


def blocks_of(
    payloads: np.ndarray,
    places: np.ndarray,
    log_times: np.ndarray,
    kind: Kind,
    layouts: list[joint_state.Layout],
) -> list[tuple[np.ndarray, Block | None]]:
    """Decode messages of one length, a layout at a time, with their places; None where they can't be decoded."""
    found: list[tuple[np.ndarray, Block | None]] = []
    for _ in range(_LAYOUTS_PER_RUN):
        if not len(payloads):
            return found
        known = _layout_of(payloads[0].tobytes(), layouts, kind.parse)
        if known is None:
            break
        same = joint_state.matches(known, payloads)
        whole = bool(same.all())
        pick = slice(None) if whole else same
        found.append((places[pick], _in_bulk(known, payloads[pick], log_times[pick])))
        if whole:
            return found
        payloads, places, log_times = payloads[~same], places[~same], log_times[~same]
    found.extend(_one_by_one(payloads, places, log_times, kind))
    return found


def _one_by_one(
    payloads: np.ndarray, places: np.ndarray, log_times: np.ndarray, kind: Kind
) -> Iterator[tuple[np.ndarray, Block | None]]:
    """The same for messages without a layout."""
    for start in range(0, len(payloads), _ONES_AT_ONCE):
        groups: dict[Any, list[tuple[int, State]]] = {}
        lost = []
        for k, payload in enumerate(payloads[start : start + _ONES_AT_ONCE], start):
            state = kind.decode(payload.tobytes())
            if state is None:
                lost.append(k)
            else:
                groups.setdefault((state.joints, state.velocity is None, state.effort is None), []).append((k, state))
        for (joints, *_), members in groups.items():
            which = np.array([k for k, _ in members])
            states = [state for _, state in members]
            velocity, effort = (
                None if getattr(states[0], name) is None else np.array([getattr(state, name) for state in states])
                for name in ("velocity", "effort")
            )
            stamp = np.array([state.stamp for state in states], dtype=np.int64)
            position = np.array([state.position for state in states])
            yield places[which], Block(joints, stamp, log_times[which], position, velocity, effort)
        if not groups:
            # So many in a row are of another kind altogether.
            yield places[start:], None
            return
        if lost:
            yield places[np.array(lost)], None


def _in_bulk(known: joint_state.Layout, payloads: np.ndarray, log_times: np.ndarray) -> Block:
    rows = joint_state.rows(known, payloads)
    names = known.fields.names or ()
    velocity, effort = (rows[name] if name in names else None for name in ("velocity", "effort"))
    return Block(known.joints, joint_state.stamps(rows), log_times, rows["position"], velocity, effort)


def _layout_of(
    message: bytes, layouts: list[joint_state.Layout], parse: Callable[[bytes], joint_state.Layout | None]
) -> joint_state.Layout | None:
    """The message's layout, found among those already seen or added to them."""
    row = np.frombuffer(message, dtype=np.uint8)[None]
    for known in layouts:
        if known.template.size == len(message) and joint_state.matches(known, row)[0]:
            return known
    parsed = parse(message)
    if parsed is not None:
        layouts.insert(0, parsed)
        del layouts[_LAYOUTS_KEPT:]
    return parsed
