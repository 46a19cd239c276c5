"""Errors that `identify` raises on purpose: one root, two kinds, one line each."""

from __future__ import annotations


class IdentifyError(Exception):
    """Root of all errors raised on purpose. `exit_status` is what the command line returns."""

    exit_status = 2


class InputError(IdentifyError):
    """The input can't be used: names the file or thing, what is wrong with it, and the mend."""


class RobotError(InputError):
    """A robot description can't be read or describes no possible robot."""


class LogError(InputError):
    """A log can't be read, or lacks what is asked of it."""


class OutputError(InputError):
    """A result can't be written where it was asked for."""


class UnsupportedLogError(IdentifyError):
    """The log is readable and can't support a result (static, too short, unexcited, effort dead …).

    `reasons` is a tuple of sentences, each fit for a reader of the report.
    """

    exit_status = 1

    def __init__(self, *reasons: str) -> None:
        super().__init__("; ".join(reasons))
        self.reasons = tuple(reasons)
