"""The commands, their options, and the help that explains them."""

from __future__ import annotations

import argparse
from typing import Any, NoReturn

from identify import __version__
from identify.cli import carrying
from identify.cli.options import (
    LOG,
    as_json,
    count,
    estimator,
    excitation,
    fitting,
    frame,
    output,
    part_of_robot,
    path,
    physics,
    reading,
    result,
    robot,
    seconds,
    seed,
)

NOISES = ("none", "standard", "high")
WHAT = (
    "base-parameters",
    "direct-geometry",
    "inverse-geometry",
    "jacobian",
    "inverse-kinematics",
    "lagrange",
    "newton-euler",
    "direct-dynamics",
    "energy",
    "operations",
)
PARAMETERS = ("standard", "base")
ORIENTATIONS = ("cosines", "euler", "roll-pitch-yaw", "quaternion")
FORMATS = ("text", "latex", "python", "c", "json")
ROBOT_FORMATS = ("toml", "urdf", "mjcf")

_DESCRIPTION = "Inertial and friction parameters of a robot arm from its logs."
_EPILOG = """\
One robot, two commands:
  identify inspect run.mcap --robot my_arm.urdf
  identify fit run.mcap --robot my_arm.urdf --test other.mcap -o result

`identify COMMAND --help` explains a command and gives an example.

Exit status: 0 done; 1 the input was read and can't support a result; 2 the input can't be used;
3 a defect of identify itself (IDENTIFY_DEBUG=1 shows where); 130 interrupted.
"""


class UsageError(Exception):
    """The command line makes no sense; the message is one line."""


class _Parser(argparse.ArgumentParser):
    """A parser that leaves it to `main` how an error is shown."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; see `{self.prog} --help`")


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command line; `command` is the name of the command chosen."""
    parser = _Parser(
        prog="identify",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"identify {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, title="commands")
    for add in (
        _demo,
        _excite,
        _simulate,
        _import,
        _inspect,
        _recover,
        _fit,
        _predict,
        _payload,
        _batch,
        _compare,
        _check,
        _report,
        _model,
        _codegen,
        _export,
    ):
        add(commands)
    return parser


def _command(commands: Any, name: str, summary: str, text: str, example: str) -> argparse.ArgumentParser:
    return commands.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.\n\n{text}",
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )


def _demo(commands: Any) -> None:
    command = _command(
        commands,
        "demo",
        "simulate the RX-90, identify it and write the report",
        "Designs an excitation, runs it and an unseen trajectory in MuJoCo with noise, writes both logs, fits the\n"
        "first and tests on the second. DIR gets trajectory.toml, train.mcap, test.mcap and result/.",
        "identify demo -o demo",
    )
    output(command, "DIR", "folder to write", default="demo")


def _excite(commands: Any) -> None:
    command = _command(
        commands,
        "excite",
        "design a motion from which parameters can be learnt",
        "A periodic Fourier motion, at rest at both ends, inside the robot's limits of position, velocity,\n"
        "acceleration and effort, that keeps a serial arm's links off each other and off the floor; and the standard\n"
        "deviations to expect of a fit to it. With --from, it is the motion that adds most to earlier results.",
        "identify excite rx90 -o next.toml --from result --starts 5",
    )
    robot(command)
    output(command, "TRAJECTORY.toml", "file to write")
    excitation(command)
    carrying.payload_option(command, "what the arm will carry, with which it keeps within its effort limits")
    seed(command, "of the design's random starts")
    as_json(command)


def _simulate(commands: Any) -> None:
    command = _command(
        commands,
        "simulate",
        "run a motion on the simulated robot and log it",
        "A MuJoCo plant with the robot's inertias, drives and friction under closed-loop control, measured at 1 kHz.\n"
        "Writes LOG.mcap and, beside it, LOG.truth.json with the true parameters, which no fit reads.",
        "identify simulate rx90 --trajectory trajectory.toml --noise high -o run.mcap",
    )
    robot(command)
    output(command, "LOG.mcap", "log to write")
    command.add_argument(
        "--trajectory", metavar="TRAJECTORY.toml", help="motion, as `identify excite` writes it (default: design one)"
    )
    command.add_argument("--noise", choices=NOISES, default="standard", help="sensor noise (default: %(default)s)")
    seed(command, "of the noise")
    carrying.payload_option(command, "what the arm carries, of which its controller knows nothing")


def _import(commands: Any) -> None:
    command = _command(
        commands,
        "import",
        "turn a table, or part of a log, into a log in SI on the joint side",
        "TABLE is a CSV, TSV or NPZ file, or a folder of them; an MCAP log serves too. A .csv output has the columns\n"
        "t,q1…,[dq1…],[tau1…]. Seconds count from the first sample, and the output counts anew from zero.",
        "identify import measured.csv --map measured.toml -o run.mcap --start 2 --stop 30",
    )
    command.add_argument("table", metavar="TABLE", help="table, folder of tables, or log")
    reading(command, "; needed for tables that identify did not write")
    output(command, "LOG", "log to write, .mcap or .csv")
    command.add_argument("--start", type=seconds, metavar="S", help="leave out what comes before S seconds")
    command.add_argument("--stop", type=seconds, metavar="S", help="leave out what comes at S seconds or later")


def _inspect(commands: Any) -> None:
    command = _command(
        commands,
        "inspect",
        "look a log over before anything is computed",
        "What the log holds, joint by joint, what is odd about it, and whether it can support a fit. With --robot,\n"
        "its limits and a quick fit of its dynamics are held against the log: signs, swaps, units, delays.\n"
        "In a terminal, every joint's curves are drawn.",
        "identify inspect run.mcap --robot rx90",
    )
    command.add_argument("log", metavar="LOG", help=LOG)
    robot(command, option=True)
    reading(command)
    command.add_argument("--picture", action="store_true", help="draw the curves even where the output is no terminal")
    command.add_argument("--html", metavar="FILE", type=path, help="write a page with findings and curves")
    command.add_argument("--force", action="store_true", help="replace FILE where it exists")
    as_json(command)


def _recover(commands: Any) -> None:
    command = _command(
        commands,
        "recover",
        "save what can be read of a cut or damaged MCAP file",
        "Writes every message of every topic that lies in a sound chunk, bit by bit, with an index, and says what\n"
        "was lost. A recording that was killed is left as LOG.mcap.partial and serves as well.",
        "identify recover run.mcap.partial -o run.mcap",
    )
    command.add_argument("log", metavar="LOG", help="MCAP file, whatever state it is in")
    output(command, "LOG.mcap", "file to write")
    as_json(command)


def _fit(commands: Any) -> None:
    command = _command(
        commands,
        "fit",
        "identify the parameters from one or more logs",
        "DIR gets parameters.json and report.html. Logs given with --test are fitted by no one: they say how wrong\n"
        "the model is on motion it has not seen. A log that can't support a result gives a DIR with the verdict\n"
        "reject, its reasons and no parameters, and exit status 1.",
        "identify fit run1.mcap run2.mcap --robot my_arm.urdf --test other.mcap -o result",
    )
    command.add_argument("logs", metavar="LOG", nargs="+", help=LOG)
    robot(command, option=True, required=True)
    output(command, "DIR", "result folder to write")
    fitting(command, "the result", "; holds for every LOG that is a table")
    estimator(command, beside=True)
    physics(command)
    as_json(command)


def _predict(commands: Any) -> None:
    command = _command(
        commands,
        "predict",
        "the torque that a fitted model expects for the motion of a log",
        "Reads position, and velocity where the log has it; never effort. Writes t,tau1,…, one row for every usable\n"
        "sample, t in seconds from the log's first sample.",
        "identify predict result other.mcap -o torque.csv",
    )
    result(command)
    command.add_argument("log", metavar="LOG", help=LOG)
    output(command, "TORQUE.csv", "table to write")
    reading(command)
    as_json(command)


def _payload(commands: Any) -> None:
    carrying.arguments(_command(commands, *carrying.WORDS))


def _batch(commands: Any) -> None:
    command = _command(
        commands,
        "batch",
        "fit every log of a folder, and compare the results",
        "Each log of FOLDER and its sub-folders is fitted on its own, over all cores: repeats of one robot, or robots\n"
        "of one kind. DIR gets a result folder for each log, summary.html, summary.json and, as tables, summary.csv\n"
        "(a row for each log) and parameters.csv (a row for each parameter, with its spread between the logs).\n"
        "NAME.test.mcap beside NAME.mcap is held out to test its fit. Logs of one sub-folder count as repeats.\n"
        "A log that can't be used stands in the tables with its reason, and the exit status is 1.",
        "identify batch recordings --robot my_arm.urdf -o fleet",
    )
    command.add_argument("folder", metavar="FOLDER", help="folder with logs, in sub-folders or not")
    robot(command, option=True, required=True)
    output(command, "DIR", "folder to write")
    fitting(command, "every result", "; with it, tables count as logs")
    estimator(command)
    command.add_argument("--jobs", type=count, metavar="N", help="logs to fit at once (default: as many as cores)")
    as_json(command)


def _compare(commands: Any) -> None:
    command = _command(
        commands,
        "compare",
        "hold two results of one robot against each other",
        "Which joints' friction and which parameters changed by more than chance, and which result predicts better:\n"
        "the same robot months apart, or one log fitted in two ways. Prints a summary; -o writes a page with curves.",
        "identify compare march april -o compared.html",
    )
    command.add_argument("first", metavar="DIR", help="result folder of `identify fit`, called A")
    command.add_argument("second", metavar="DIR", help="another one of the same robot, called B")
    command.add_argument("-o", "--output", metavar="PAGE.html", type=path, help="page to write")
    command.add_argument("--force", action="store_true", help="replace PAGE.html where it exists")
    as_json(command)


def _check(commands: Any) -> None:
    command = _command(
        commands,
        "check",
        "hold the equations of a robot against Pinocchio and MuJoCo",
        "Derives the base parameters, compares their number with the rank of a numeric regressor, and torques on\n"
        "random states with both libraries. Exit status 1 where they disagree.",
        "identify check my_arm.urdf",
    )
    robot(command)
    as_json(command)


def _report(commands: Any) -> None:
    command = _command(
        commands,
        "report",
        "write report.html of a result folder anew",
        "Reads parameters.json and the curves beside it; computes nothing.",
        "identify report result",
    )
    result(command)


def _model(commands: Any) -> None:
    command = _command(
        commands,
        "model",
        "print a symbolic model of a robot",
        "WHAT is one of\n"
        "  base-parameters     what can be identified, and how standard parameters are regrouped\n"
        "  direct-geometry     pose of the tool in the world\n"
        "  inverse-geometry    joint positions for a pose, by Paul's method; --pose: the solutions of one pose\n"
        "  jacobian            with its determinant and singular configurations\n"
        "  inverse-kinematics  joint velocities for a velocity of the last link\n"
        "  lagrange            energies, A, C, Q, friction and effort, in standard parameters\n"
        "  newton-euler        effort by a customised recurrence, in base parameters\n"
        "  direct-dynamics     joint accelerations for an effort\n"
        "  energy              energy functions of the base parameters\n"
        "  operations          what each model costs\n"
        "Lengths stay letters where the robot file names them.",
        "identify model rx90 --what inverse-geometry --format python",
    )
    robot(command)
    command.add_argument("--what", required=True, choices=WHAT, metavar="WHAT", help=", ".join(WHAT))
    command.add_argument("--format", choices=FORMATS, default="text", help="form of the text (default: %(default)s)")
    command.add_argument("--parameters", choices=PARAMETERS, help="inertial parameters of lagrange (default: standard)")
    command.add_argument("--orientation", choices=ORIENTATIONS, help="form in direct-geometry (default: cosines)")
    command.add_argument(
        "--frame",
        metavar="I",
        type=frame,
        help="axes of jacobian and inverse-kinematics: 0 the base, J the frame of joint J (default: the middle of the "
        "chain); tool: jacobian of the tool in its own axes",
    )
    command.add_argument(
        "--decomposed", action="store_true", help="jacobian as a product of three simple matrices, in R0 or --frame"
    )
    command.add_argument(
        "--pose",
        metavar="POSE",
        help="with inverse-geometry: print all solutions for this pose of the tool in the world, 12 or 16 numbers "
        "row by row, or a file of them: --pose='1 0 0 0.6  0 1 0 0.2  0 0 1 0.3'",
    )
    command.add_argument(
        "--current",
        metavar="Q1,Q2,…",
        help="with --pose: joint positions now (rad, m), for what the pose leaves open (default 0): --current=0.1,-0.2",
    )


def _codegen(commands: Any) -> None:
    command = _command(
        commands,
        "codegen",
        "write a robot's models as C or Python that a controller can carry",
        "One C99 file and header without allocation or any dependency but math.h, or one Python file that needs\n"
        "NumPy alone: inverse dynamics, base and Slotine-Li regressors, energy functions, inertia matrix, Coriolis\n"
        "and gravity effort, direct and inverse geometry, Jacobian. Each file carries a self-test (C: -DSELF_TEST).",
        "identify codegen rx90 --parameters result -o controller",
    )
    robot(command)
    output(command, "DIR", "folder to write the files to")
    command.add_argument("--language", choices=("c", "python"), default="c", help="language (default: %(default)s)")
    command.add_argument(
        "--parameters",
        metavar="DIR",
        type=path,
        help="result folder whose parameters go in (default: the robot file's)",
    )


def _export(commands: Any) -> None:
    command = _command(
        commands,
        "export",
        "write a robot, identified or as described, as TOML, URDF or MJCF",
        "Of a result folder: the robot that was fitted, with the masses, centres of mass, inertias and friction that\n"
        "are nearest to the result among those that physics allows. FILE says which logs they come from. Of a\n"
        "built-in name or a robot file: the robot as it is read, in TOML by modified Denavit-Hartenberg parameters.\n"
        "What a format has no place for is named in FILE and on stdout.",
        "identify export result --format mjcf -o my_arm.xml",
    )
    what = "result folder of `identify fit`, built-in name (rx90, tx40), or a .toml, .urdf or MJCF .xml file"
    command.add_argument("source", metavar="SOURCE", help=what)
    part_of_robot(command)
    command.add_argument("--format", choices=ROBOT_FORMATS, required=True, help="format of the robot file")
    output(command, "FILE", "robot file to write, .toml, .urdf or .xml")
