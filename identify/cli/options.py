"""Options that several commands share, and the values that options take: each refused in words where it is none."""

from __future__ import annotations

import argparse
import math

ESTIMATORS = ("ols", "wls", "huber", "tukey", "idim-iv", "didim", "ml", "both", "energy", "power")
"""Names of `estimation.estimators.registry`, here as well so that help need not load it."""

LOG = "MCAP file or ROS 2 bag folder with joint states, or with --map a table"


def robot(command: argparse.ArgumentParser, option: bool = False, required: bool = False) -> None:
    """ROBOT, as an argument or as an option --robot, and which part of it is meant."""
    text = "built-in name (rx90, tx40), or a .toml, .urdf or MJCF .xml file"
    if option:
        command.add_argument("--robot", metavar="ROBOT", required=required, help=text)
    else:
        command.add_argument("robot", metavar="ROBOT", help=text)
    part_of_robot(command)


def part_of_robot(command: argparse.ArgumentParser) -> None:
    """Which joints of a robot are meant, and how it stands."""
    command.add_argument(
        "--joints",
        metavar="NAMES",
        default="",
        help="joints to keep, with commas between; the others are held at 0, or where NAME=POSITION says "
        "(rad, m). With positions alone, all others are kept",
    )
    command.add_argument(
        "--gravity",
        metavar="X,Y,Z",
        type=three_numbers,
        help="gravity in the frame the file is given in, m/s², for an arm on a wall: --gravity=-9.81,0,0",
    )


def result(command: argparse.ArgumentParser) -> None:
    """DIR of an earlier fit."""
    command.add_argument("result", metavar="DIR", help="result folder of `identify fit`")


def output(command: argparse.ArgumentParser, metavar: str, text: str, default: str | None = None) -> None:
    """Where the command writes to, required unless there is a default, and --force."""
    shown = f"{text} (default: {default})" if default else text
    command.add_argument(
        "-o", "--output", metavar=metavar, required=default is None, default=default, type=path, help=shown
    )
    command.add_argument("--force", action="store_true", help="replace what is there already, whole or not at all")


def reading(command: argparse.ArgumentParser, more: str = "") -> None:
    """How logs are read; `more` is said of the map."""
    text = f"TOML file that says what the columns of a table mean{more}"
    command.add_argument("--map", metavar="MAP.toml", help=text)
    command.add_argument("--topic", metavar="TOPIC", help="joint states of an MCAP file (default: found by itself)")


def fitting(command: argparse.ArgumentParser, tested: str, more: str) -> None:
    """What a fit is made of and tested on; `more` is said of the map."""
    command.add_argument(
        "--test", metavar="LOG", nargs="+", action="extend", default=[], help=f"logs to test {tested} on"
    )
    reading(command, more)
    command.add_argument("--model", choices=("torque", "energy"), help="equations to fit (default: torque)")


def estimator(command: argparse.ArgumentParser, beside: bool = False) -> None:
    """--estimator; `beside`: whether all of them can be asked for."""
    names = ", ".join(ESTIMATORS)
    command.add_argument(
        "--estimator",
        choices=(*ESTIMATORS, "all") if beside else ESTIMATORS,
        metavar="NAME",
        help=f"how parameters are estimated, each from the equations it knows: {names}"
        f"{', or all for a table of them beside the default one' if beside else ''} (default: that of the model)",
    )


def physics(command: argparse.ArgumentParser) -> None:
    """What is assumed of friction and links."""
    command.add_argument(
        "--friction",
        metavar="NAMES",
        default="auto",
        help="forms of friction beside viscous, Coulomb and offset, with commas between: cube_root, presliding, "
        "stribeck, asymmetric, load; or plain for none (default: %(default)s, those that cross-validation finds worth "
        "it)",
    )
    command.add_argument(
        "--prior",
        metavar="SHARE",
        type=share,
        help="pull the links that physics allows to those of the robot file, with this standard deviation in shares "
        "of them, such as 0.3 (default: they settle only what the motion leaves open)",
    )


def excitation(command: argparse.ArgumentParser) -> None:
    """What a motion is designed for and of."""
    command.add_argument(
        "--criterion",
        choices=("torque", "energy", "both"),
        default="torque",
        help="model whose parameters the motion is designed for (default: %(default)s)",
    )
    command.add_argument(
        "--duration", type=duration, default=10.0, metavar="S", help="length of one period (default: %(default)g s)"
    )
    command.add_argument(
        "--periods", type=count, default=3, metavar="N", help="how often the period is run (default: %(default)s)"
    )
    command.add_argument(
        "--harmonics",
        type=count,
        metavar="N",
        help="harmonics of the series, at least 2 (default: 5 for the torque model; as many as its columns need for "
        "the energy model, 7 for six joints)",
    )
    command.add_argument(
        "--starts", type=count, default=3, metavar="N", help="random starts, the best of which counts (default: 3)"
    )
    command.add_argument(
        "--from",
        metavar="DIR",
        dest="earlier",
        action="append",
        default=[],
        help="result of an earlier fit of this robot, once for each: the new motion adds most to what they tell, and "
        "the last one's parameters tell the effort",
    )
    command.add_argument(
        "--no-collision",
        dest="collision",
        action="store_false",
        help="leave out the distances between links and to the floor",
    )


def as_json(command: argparse.ArgumentParser) -> None:
    """--json."""
    command.add_argument("--json", action="store_true", help="print one JSON object instead of text")


def seed(command: argparse.ArgumentParser, what: str) -> None:
    """--seed, and what it is the seed of."""
    command.add_argument(
        "--seed", type=whole_number, default=0, metavar="N", help=f"seed {what} (default: %(default)s)"
    )


def path(text: str) -> str:
    if not text:
        raise argparse.ArgumentTypeError("the name is empty")
    return text


def whole_number(text: str) -> int:
    if not (text.isascii() and text.isdigit()):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of at least 0")
    return int(text)


def frame(text: str) -> int | str:
    if text == "tool":
        return text
    if not (text.isascii() and text.isdigit() and len(text) < 5):
        raise argparse.ArgumentTypeError(f"{text!r} is no frame: give a number, 0 for the base, or tool")
    return int(text)


def count(text: str) -> int:
    found = whole_number(text)
    if not found:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of at least 1")
    return found


def number(text: str) -> float:
    """What the text says, NaN where that is no number."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def seconds(text: str) -> float:
    value = number(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds")
    return value


def share(text: str) -> float:
    value = number(text)
    if not 0 < value <= 1e3:
        raise argparse.ArgumentTypeError(f"{text!r} is no share: give a number above 0, such as 0.3")
    return value


def three_numbers(text: str) -> tuple[float, ...]:
    try:
        values = tuple(float(word) for word in text.split(","))
    except ValueError:
        values = ()
    if len(values) != 3 or not all(abs(value) <= 1e3 for value in values):
        raise argparse.ArgumentTypeError(f"{text!r} is not three numbers with commas between")
    return values


def duration(text: str) -> float:
    value = seconds(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a time above 0 s")
    return value
