"""Logs and other series to files: whole or not at all, and never over an older one unasked."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from identify.errors import OutputError
from identify.logs.files import refuse_existing, replacing
from identify.logs.log import Log

_TIME_DECIMALS = 9
_BLOCK = 1 << 13


def save(
    log: Log,
    path: str | os.PathLike[str],
    force: bool = False,
    attachments: Mapping[str, bytes] | None = None,
) -> None:
    """Write a log as .mcap, or as .csv with the header t,q1,…,[dq1,…],[tau1,…].

    attachments: name → content, for MCAP. Both forms read back bit by bit; MCAP keeps time to the nanosecond.
    Raises OutputError where the file exists and `force` is not set, or where it can't be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".mcap", ".csv"):
        raise OutputError(f"{path}: a log is written as .mcap or .csv; give the file one of these suffixes")
    refuse_existing(path, force)
    if suffix == ".mcap":
        from identify.logs.mcap_writer import write_mcap

        write_mcap(log, path, attachments)
        return
    from identify.logs.tables import own_header

    if attachments:
        raise OutputError(f"{path}: a CSV file takes no attachments; write .mcap")
    channels = [values for values in (log.position, log.velocity, log.effort) if values is not None]
    write_table(path, own_header(log.joints, log.velocity is not None, log.effort is not None), log.time, *channels)


def write_table(path: str | os.PathLike[str], header: list[str], time: np.ndarray, *columns: np.ndarray) -> None:
    """Write a comma-separated table: time (N,) [s] with at least 9 decimals, then columns (N, k), both exactly."""
    with replacing(path) as stream:
        stream.write((",".join(header) + "\n").encode())
        # In blocks, as a number takes four times the room once Python holds it.
        for start in range(0, len(time), _BLOCK):
            part = slice(start, start + _BLOCK)
            values = np.column_stack([column[part] for column in columns]).astype(float).tolist()
            seconds = (np.format_float_positional(t, unique=True, min_digits=_TIME_DECIMALS) for t in time[part])
            lines = (f"{t},{','.join(map(repr, row))}\n" for t, row in zip(seconds, values, strict=True))
            stream.write("".join(lines).encode())
