"""The command `identify`: parse, run, and turn what goes wrong into one line and an exit status."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from identify.cli.parser import UsageError, build_parser
from identify.errors import IdentifyError
from identify.logs.wording import printable

DONE, UNUSABLE, DEFECT, INTERRUPTED, PIPE_CLOSED = 0, 2, 3, 130, 141
DEBUG = "IDENTIFY_DEBUG"


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status.

    0: done. 1: the input was readable and can't support a result. 2: the input, or the command line, can't be
    used. 3: a defect of identify. 130: interrupted. 141: standard output was closed, as `head` does.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    for stream in (sys.stdout, sys.stderr):
        # A terminal that knows no Greek gets question marks, and the work is not lost.
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    try:
        status = _run(arguments)
        sys.stdout.flush()
        return status
    except SystemExit as finished:
        return finished.code if isinstance(finished.code, int) else DONE
    except UsageError as error:
        return _say(str(error), UNUSABLE)
    except IdentifyError as error:
        return _say(str(error), error.exit_status)
    except KeyboardInterrupt:
        return _say("interrupted", INTERRUPTED)
    except BrokenPipeError:
        # What is still buffered must not be written when Python ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return PIPE_CLOSED
    except OSError as error:
        if os.environ.get(DEBUG):
            raise
        place = f"{error.filename}: " if error.filename else ""
        return _say(f"{place}{error.strerror or error}; check the name, the permissions and the disk", UNUSABLE)
    except Exception as error:
        if os.environ.get(DEBUG):
            raise
        kind = f"{type(error).__name__}: {error}".rstrip(": ")
        return _say(f"{kind}; this is a defect of identify: {DEBUG}=1 shows where it happened", DEFECT)


def _run(arguments: list[str]) -> int:
    options = build_parser().parse_args(arguments)

    from identify.cli import commands

    return commands.COMMANDS[options.command](options, arguments)


def _say(message: str, status: int) -> int:
    """One line on stderr, whatever the message holds."""
    print(f"identify: error: {printable(' '.join(message.split()))}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
