"""What the runs of `scripts/example_control` come to: a table in Markdown and a figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from control_laws import OMEGA, PERIOD, Array
from control_runs import ADAPTIVE, EVERY, FLOOR, GUESSED, IDENTIFIED, LOADED, PAYLOAD, PD, TOOL, WRONG, Comparison

from identify.experiment.sensors import POSITION_NOISE

COLOURS = {PD: "#8a8a8a", GUESSED: "#d55e00", IDENTIFIED: "#0072b2"}
COLOURS |= {LOADED: COLOURS[IDENTIFIED], ADAPTIVE: "#009e73", FLOOR: "#b5b5b5"}
MOMENT_COLOURS = ("#a6cee3", "#1f4e79", "#e69f00", "#7b3294", "#c2185b")


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def report(comparison: Comparison, command: str) -> str:
    """Tracking errors by law and by joint, and what became of the parameters that the payload changes, as Markdown."""
    c, half = comparison, len(comparison.motion.q) // 2
    whole, joints = [], []
    for name, run in c.runs.items():
        error, tool = 1e3 * (run.q - c.motion.q), 1e3 * c.tool_error(name)
        late = rms(error[half:]), rms(tool[len(tool) // 2 :])
        figures = rms(error), np.abs(error).max(), late[0], rms(tool), tool.max(), late[1]
        whole.append([name, *(f"{x:.2f}" for x in figures)])
        joints.append([name, *(f"{rms(column):.2f}" for column in error.T)])
    names, free, adapted = c.regressor.names, c.regressor.parameters, c.runs[ADAPTIVE].theta
    changed = np.flatnonzero(np.abs(c.truth - free) > 1e-9)
    columns = free, c.result.parameters, adapted[-1], c.truth
    parameters = [[names[k], c.regressor.units[k], *(f"{theta[k]:.4f}" for theta in columns)] for k in changed]
    clipped = sum(run.clipped for run in c.runs.values())
    start, end = 100 * c.torque_error(adapted[[0, -1]])
    v = c.lyapunov()
    rise = 100 * (v / np.minimum.accumulate(v)).max() - 100
    return f"""# Identified parameters in a controller's loop

Made by `{command}`. The simulated RX-90 tracks a random motion of {c.motion.time[-1]:.0f} s that the fit did not see.
- Gains: every law asks for ë + 2ω·ė + ω²·e = 0 with ω = 2π·{OMEGA / (2 * np.pi):g} rad/s. Inertias in the gains of
  PD and of the adaptive law are those of the wrong parameters.
- Measured: positions at {1 / PERIOD:g} Hz with noise of {np.rad2deg(POSITION_NOISE["standard"]):g}° (level standard),
  velocity by their low-passed differences.
- Wrong: inertia of each link and each drive off by up to {100 * WRONG:g} % (seeded), friction not known.
- Identified: fitted to a simulated log of another motion, noise standard.
- Payload: {PAYLOAD.mass:g} kg at {PAYLOAD.com} m in the last frame. The adaptive law starts from the parameters
  identified without it.
- True: computed torque that knows arm and payload. What is left is friction where it changes sign, noise and delay.

## Tracking error

Over all joints [mrad], and of a point {1000 * TOOL[2]:.0f} mm in front of the wrist [mm]. Late: in the second half.
Torques clipped at the limits of the drives: {clipped}.

{table(["law", "RMS mrad", "peak mrad", "late RMS mrad", "RMS mm", "peak mm", "late RMS mm"], whole)}

RMS of each joint [mrad]:

{table(["law", *c.regressor.robot.joint_names], joints)}

## Parameters under the payload

Error of the torque that the adaptive law's parameters give along the motion: {start:.1f} % of the torque at the start,
{end:.1f} % at the end. The Lyapunov function fell to {100 * v[-1] / v[0]:.0f} % of its start and was never more than
{rise:.2g} % above its least value so far. It need not go to zero: a parameter whose torque this motion hardly needs
stays where it was.

{table(["parameter", "unit", "without payload", "identified", "adapted", "with payload"], parameters, 2)}
"""


def table(head: list[str], rows: list[list[str]], words: int = 1) -> str:
    """A Markdown table; all but the first columns of words hold numbers."""
    lines = [head, ["---"] * words + ["---:"] * (len(head) - words), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def draw(comparison: Comparison, path: Path) -> None:
    """The figure: errors without and with payload, and parameters settling."""
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    c, time, run = comparison, comparison.motion.time, comparison.runs[ADAPTIVE]
    style: dict[str, Any] = {
        "font.size": 9.5,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.edgecolor": "#666666",
    }
    style |= {"axes.titlesize": 10.5, "axes.titlelocation": "left", "axes.titleweight": "bold", "axes.grid": True}
    style |= {"grid.color": "#e6e6e6", "legend.frameon": False, "legend.fontsize": 9, "lines.linewidth": 1.8}
    style |= {"figure.constrained_layout.w_pad": 0.08, "figure.constrained_layout.h_pad": 0.06}
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(style)
        figure = Figure(figsize=(9, 6.4), dpi=200, layout="constrained", facecolor="white")
        (free, loaded), (moments, learning) = figure.subplots(2, 2, sharex=True)
        width = round(0.5 / (PERIOD * EVERY))
        for axes, names in ((free, (PD, GUESSED, IDENTIFIED)), (loaded, (LOADED, ADAPTIVE, FLOOR))):
            for name in names:
                power = np.convolve(c.tool_error(name) ** 2, np.ones(width) / width, mode="valid")
                label = name.removesuffix(", payload")
                axes.plot(time[::EVERY][width - 1 :], 1e3 * np.sqrt(power), color=COLOURS[name], label=label)
            axes.set(yscale="log", ylim=(0.05, 300), ylabel="tool error, RMS over 0.5 s [mm]")
        free.set_title("No payload")
        loaded.set_title(f"Unknown payload of {PAYLOAD.mass:g} kg (grey: known)")

        weighed = [k for k, name in enumerate(c.regressor.names) if name.startswith("M")]
        weighed = [k for k in weighed if abs(c.truth[k] - c.regressor.parameters[k]) > 1e-9]
        for at, k in enumerate(weighed):
            start, colour = c.result.parameters[k], MOMENT_COLOURS[at]
            wide = 3.2 if at == 0 else 1.4  # MXR2 and MYR3 hold the payload's mass alike: one line upon the other
            moments.plot(time, run.theta[:, k] - start, label=c.regressor.names[k], color=colour, linewidth=wide)
            moments.axhline(c.truth[k] - start, color=colour, linewidth=1, linestyle="--")
        moments.set(xlabel="time [s]", ylabel="change [kg·m]", ylim=(-0.6, 2.1), xlim=(0, time[-1]))
        moments.set_title("First moments as adapted (dashed: true)")

        rows = slice(None, None, 20)
        v, error = c.lyapunov(20), c.torque_error(run.theta[rows])
        learning.plot(time[rows], 100 * v / v[0], color="#cc79a7", label="Lyapunov function, % of its start")
        learning.plot(time[rows], 100 * error, color=COLOURS[ADAPTIVE], label="torque error by them, % of the torque")
        learning.set(yscale="log", ylim=(0.1, 1000), xlabel="time [s]", ylabel="[%]")
        learning.set_title("Adapted parameters, all together")
        for axes in (free, loaded, learning):
            axes.yaxis.set_major_formatter("{x:g}")
        for axes in (free, loaded, moments, learning):
            axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
            axes.legend(loc="upper right", ncols=3 if axes is moments else 1)
        figure.savefig(path, format="png")
