"""Results as `fit` leaves them, made up from a seed: a decoupled arm with gravity and friction, and its residuals.

The figures in the record are computed from the arrays, so that tables and curves of a report agree.
"""

from __future__ import annotations

from typing import Any

import numpy as np

STILL = 0.01
HASH = "9f2c1e7ab04d5c3386e1f0a7d2b94c65e8a1f37d0c5b9248ee6a7130fd5c2b91"
LETTERS = ("XX", "XY", "XZ", "YZ", "ZZ", "MX", "MY", "Ia")
RX90_GROUPING = {
    "ZZR1": "ZZ1 + Ia1 + YY2 + YY3 + D3**2*(M3+M4+M5+M6)",
    "XXR2": "XX2 - YY2 - D3**2*(M3+M4+M5+M6)",
    "XZR2": "XZ2 - D3*MZ3",
    "ZZR2": "ZZ2 + Ia2 + D3**2*(M3+M4+M5+M6)",
    "MXR2": "MX2 + D3*(M3+M4+M5+M6)",
    "XXR3": "XX3 - YY3 + YY4 + 2*RL4*MZ4 + RL4**2*(M4+M5+M6)",
    "ZZR3": "ZZ3 + YY4 + 2*RL4*MZ4 + RL4**2*(M4+M5+M6)",
    "MYR3": "MY3 + MZ4 + RL4*(M4+M5+M6)",
}


def example(
    n: int = 6,
    *,
    test: bool = True,
    simulated: bool = True,
    prismatic: tuple[int, ...] = (),
    coupled: bool = False,
    energy: bool = False,
    noise: float = 0.02,
    seed: int = 0,
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Record and arrays of an arm of n joints; `prismatic`: the sliding ones (0-based); `noise`: a share of torque."""
    rng = np.random.default_rng(seed)
    joints = [_joint(k, k in prismatic) for k in range(n)]
    size = 20.0 * 0.62 ** np.minimum(np.arange(n), 7)
    names = [
        f"{x}{'R' if x in ('XX', 'ZZ') else ''}{j}" for j in range(1, n + 1) for x in (LETTERS if j > 1 else ("ZZ",))
    ]
    parameters = [_parameter(name, size, joints, simulated, noise, rng) for name in names]
    friction = [_friction(k, joints[k], size[k], simulated, noise, rng) for k in range(n)]
    transmission = []
    if coupled:
        units = ("kg·m²", "N·m·s/rad", "N·m")
        transmission = [
            {"name": f"{x}{n}", "estimate": v, "std": 0.04 * v, "unit": u}
            for x, v, u in zip(("Iam", "Fvm", "Fsm"), (0.08, 0.61, 0.35), units, strict=True)
        ]
    every = [*names, *(f"{x}{j}" for j in range(1, n + 1) for x in ("Fv", "Fs", "off"))]
    every += [t["name"] for t in transmission]
    curves: dict[str, np.ndarray] = {}
    train = _motion("train0", n, size, friction, noise, rng, curves)
    tests = (
        [{"path": "runs/unseen.mcap", **_motion("test0", n, size, friction, 1.4 * noise, rng, curves)}] if test else []
    )
    for entry in tests:
        entry["nominal_relative_residual_percent"] = 31.4
        entry["outside_training_percent"] = [0.0] * (n - 1) + [3.25]
        for row in entry["per_joint"]:
            row["nominal_moving_rmse"] = 9.1 * row["moving_rmse"]
    lag = np.arange(100) * 0.02
    curves["residual/lag"] = lag
    curves["residual/autocorrelation"] = np.array(
        [np.exp(-lag / (0.1 + 0.03 * (k % 5))) * np.cos(5 * lag) for k in range(n)]
    ).T
    for kind, entry in [("train", train), *(("test", t) for t in tests)]:
        for row, joint in zip(entry["per_joint"], joints, strict=True):
            row["joint"], row["unit"] = joint["name"], joint["effort_unit"]
        entry["energy_residual_percent"] = 4.31 if energy and kind == "train" else None
    noise_word = {"noise": "standard"} if simulated else {"noise": None, "noise_reason": "a recorded log"}
    logs = [
        _log("runs/excitation.mcap", "train", simulated, noise_word, ["41 rows with no effort were dropped (0.14 %)."])
    ]
    logs += [_log("runs/unseen.mcap", "test", simulated, noise_word, [])] if test else []
    torque = {
        "parameters": [],
        "condition_number": 38.4,
        "relative_residual_percent": 2.1,
        "moving_relative_residual_percent": 1.9,
    }
    rival = {
        **torque,
        "condition_number": 1420.0,
        "relative_residual_percent": 6.3,
        "moving_relative_residual_percent": 5.8,
    }
    estimates = [
        *parameters,
        *(row[key] for row in friction for key in ("viscous", "coulomb", "offset")),
        *transmission,
    ]
    torque["parameters"] = [
        {"name": x, "estimate": p["estimate"], "std": p["std"]} for x, p in zip(every, estimates, strict=True)
    ]
    rival["parameters"] = [
        {"name": p["name"], "estimate": p["estimate"] + 6 * p["std"] * rng.standard_normal(), "std": 6 * p["std"]}
        for p in torque["parameters"]
    ]
    std = np.array([p["std"] for p in torque["parameters"]])
    record: dict[str, Any] = {
        "format": "identify/parameters/1",
        "robot": {
            "name": "Stäubli RX-90" if n == 6 else f"Test arm with {n} joints",
            "source": "robots/rx90.toml",
            "sha256": HASH,
            "note": "Inertias, drives and friction of this robot file are chosen, not measured" if simulated else "",
            "joints": joints,
        },
        "model": "energy" if energy else "torque",
        "estimator": "weighted least squares",
        "simulated": simulated,
        "logs": logs,
        "names": every,
        "base_parameters": parameters,
        "friction": friction,
        "transmission": transmission,
        "covariance": np.diag(std**2).tolist(),
        "fit": {**train, "condition_number": 1420.0 if energy else 38.4},
        "settings": {
            "position_cutoff_hz": 40.0,
            "effort_cutoff_hz": 10.0,
            "decimated_rate_hz": 20.0,
            "rest_counted": False,
            "guard_s": 0.025,
            "still_rad_s": STILL,
            "coulomb_form": "smooth sign",
            "coulomb_velocity": 0.012,
            "window_s": 0.1 if energy else None,
            "window_s_reason": "the torque model balances no windows",
            "chosen_by": "cross-validation inside the training logs, 5 blocks",
            "effective_samples": 2950,
            "rows": 9000,
            "candidates": [
                {"settings": {"position_cutoff_hz": c}, "moving_percent": s}
                for c, s in ((5, 3.1), (10, 2.4), (20, 4.9))
            ],
        },
        "test": tests or None,
        "coverage": {"per_joint": [_coverage(k, joints[k], n) for k in range(n)]},
        "models": {
            "torque": torque,
            "energy": rival,
            "agreement": {"largest_z": 2.7, "name": every[-3], "within_2_sigma_percent": 94.8},
        },
        "cross_check": {
            "pinocchio": {"max_abs_error": 3.1e-14, "samples": 1000, "what": "regressor times standard parameters"},
            "mujoco": {"max_abs_error": 8.7e-14, "samples": 1000, "what": "regressor times standard parameters"},
            "identified": {
                "pinocchio": {"max_abs_error": 4.4e-13, "samples": 1000, "what": "identified rigid-body model"},
                "mujoco": None,
                "mujoco_reason": "no physically consistent set of links was computed",
            },
        },
        "physical": None,
        "physical_reason": "physical consistency is not part of this version",
        "verdict": _verdict(test, simulated, train, tests),
        "versions": {"identify": "0.1.0", "python": "3.11.7", "numpy": "2.4.0", "pin": "4.1.0", "mujoco": "4.0.0"},
        "seed": 0,
        "command": "identify fit runs/excitation.mcap --robot rx90 --test runs/unseen.mcap -o result",
        "created": None,
    }
    if not test:
        record["test_reason"] = "no test log was given"
    return record, curves


def rejected(n: int = 6) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """A log that hardly moves: verdict reject, no parameters, arrays without a prediction."""
    record, curves = example(n, test=False, simulated=False)
    why = "the log can't support a model"
    for key in ("fit", "test", "covariance", "settings", "models", "cross_check"):
        record[key], record[f"{key}_reason"] = None, why
    for key in ("base_parameters", "friction", "transmission", "names"):
        record[key], record[f"{key}_reason"] = [], why
    reasons = [f"joint_{k} moves over 0.004 rad; at least a tenth of its range is needed" for k in (2, 3)]
    record["verdict"] = {
        "status": "reject",
        "reasons": reasons,
        "uses": [],
        "actions": ["Record the trajectory that `identify excite rx90` designs", "Check that the brakes are released"],
    }
    kept = {f"train0/{key}" for key in ("time", "measured", "position", "velocity", "acceleration", "moving")}
    curves = {key: value for key, value in curves.items() if key in kept}
    curves["train0/position"] = 1e-3 * curves["train0/position"]
    curves["train0/moving"] = np.zeros_like(curves["train0/moving"])
    for row in record["coverage"]["per_joint"]:
        row.update(position=[0.1, 0.104], position_limit_percent=0.07, velocity_max=0.002, velocity_limit_percent=0.05)
        row.update(acceleration_max=0.01, acceleration_limit_percent=0.1)
    return record, curves


def _joint(k: int, slides: bool) -> dict[str, Any]:
    limits = {
        "position": [-2.8 + 0.1 * (k % 3), 2.8],
        "velocity": 4.0 + k % 4,
        "acceleration": 8.0 + 2 * (k % 4),
        "effort": 300.0,
    }
    if slides:
        limits = {"position": [0.0, 0.8], "velocity": 1.2, "acceleration": None, "effort": 900.0}
    return {
        "name": f"joint_{k + 1}",
        "type": "prismatic" if slides else "revolute",
        "effort_unit": "N" if slides else "N·m",
        "position_unit": "m" if slides else "rad",
        "limits": limits,
    }


def _parameter(
    name: str, size: np.ndarray, joints: list[Any], simulated: bool, noise: float, rng: Any
) -> dict[str, Any]:
    letters, j = name.rstrip("0123456789"), int(name[len(name.rstrip("0123456789")) :])
    scale = size[j - 1] * {"ZZR": 0.9, "XXR": -0.4, "Ia": 0.2, "MX": 0.3, "MY": 0.25}.get(letters, 0.03)
    true = float(scale * (0.8 + 0.4 * rng.random()))
    std = float(size[j - 1] * noise * (0.05 + 0.5 * rng.random()) * (3 if letters in ("XY", "YZ") else 1))
    value = true + std * float(rng.standard_normal())
    unit = "kg·m" if letters in ("MX", "MY") else "kg·m²"
    if letters == "Ia" and joints[j - 1]["type"] == "prismatic":
        unit = "kg"
    truth = {"truth": true} if simulated else {"truth": None, "truth_reason": "a recorded log has no known truth"}
    return {
        "name": name,
        "grouping": RX90_GROUPING.get(name, name) if len(size) == 6 else name.replace("R", ""),
        "unit": unit,
        "estimate": value,
        "std": std,
        "relative_std_percent": 100 * std / abs(value),
        "identified": bool(std < 0.1 * abs(value)),
        **truth,
        "prior": true * float(1 + 0.1 * rng.standard_normal()),
        "link": j,
    }


def _friction(k: int, joint: dict[str, Any], size: float, simulated: bool, noise: float, rng: Any) -> dict[str, Any]:
    force, speed = joint["effort_unit"], joint["position_unit"]
    row: dict[str, Any] = {"joint": joint["name"]}
    for key, value, unit in (("viscous", 0.7, f"{force}·s/{speed}"), ("coulomb", 0.6, force), ("offset", 0.03, force)):
        true, std = value * size, noise * size * (0.1 + 0.2 * rng.random())
        truth = {"truth": true} if simulated else {"truth": None, "truth_reason": "a recorded log has no known truth"}
        estimate = true + std * float(rng.standard_normal())
        row[key] = {
            "estimate": estimate,
            "std": std,
            "unit": unit,
            **truth,
            "identified": bool(std < 0.1 * abs(estimate)),
        }
    return row


def _motion(
    key: str, n: int, size: np.ndarray, friction: list[Any], noise: float, rng: Any, curves: dict[str, np.ndarray]
) -> dict[str, Any]:
    """Arrays of one log into `curves`; the figures that the record gives for it."""
    t = np.linspace(0.0, 30.0, 3000)
    w = 2 * np.pi * 0.1 * np.arange(1, 6)[:, None, None]
    a, b = rng.normal(size=(2, 5, 1, n)) * 0.5 / np.arange(1, 6)[:, None, None]
    phase = w * t[None, :, None]
    ramp = np.clip((np.minimum(t, 30.0 - t) - 1.0) / 3.0, 0, 1)[:, None]
    q = ramp**3 * (10 - 15 * ramp + 6 * ramp**2) * (a * np.sin(phase) + b * np.cos(phase)).sum(axis=0)
    dq, ddq = np.gradient(q, t, axis=0), np.gradient(np.gradient(q, t, axis=0), t, axis=0)
    moving = np.abs(dq) > STILL
    rigid = size * (0.9 * ddq + 2.4 * np.cos(q))
    lost = np.array([[row[key]["estimate"] for row in friction] for key in ("viscous", "coulomb", "offset")])
    predicted = rigid + lost[0] * dq + lost[1] * np.clip(dq / 0.012, -1.0, 1.0) + lost[2]
    colour = np.array(
        [np.convolve(rng.standard_normal(len(t) + 24), np.hanning(25) / 3.1, "valid") for _ in range(n)]
    ).T
    stuck = np.where(moving, 1.0, 6.0)
    measured = predicted + noise * 1.5 * size * colour[: len(t)] * stuck
    arrays = {"time": t, "measured": measured, "predicted": predicted, "moving": moving, "rigid": rigid}
    arrays |= {"position": q, "velocity": dq, "acceleration": ddq}
    curves.update({f"{key}/{name}": value for name, value in arrays.items()})
    error = measured - predicted
    rows = []
    for k in range(n):
        e, m = error[:, k], moving[:, k]
        row = {
            "rmse": _rms(e),
            "moving_rmse": _rms(e[m]),
            "rest_rmse": _rms(e[~m]),
            "max_abs_error": float(np.abs(e).max()),
        }
        row["relative_residual_percent"] = 100 * _rms(e) / _rms(measured[:, k])
        row["moving_relative_residual_percent"] = 100 * _rms(e * m) / _rms(measured[:, k] * m)
        row["std_of_signal"] = float(measured[:, k].std())
        row["rest_share_percent"] = float(100 * (~m).mean())
        rows.append(row)
    return {
        "relative_residual_percent": 100 * _rms(error) / _rms(measured),
        "moving_relative_residual_percent": 100 * _rms(error * moving) / _rms(measured * moving),
        "samples_used": 30000,
        "duration_s": 30.0,
        "per_joint": rows,
    }


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def _coverage(k: int, joint: dict[str, Any], n: int) -> dict[str, Any]:
    low, high = joint["limits"]["position"]
    first, last = low + (0.1 + 0.01 * (k % 6)) * (high - low), high - (0.05 + 0.03 * (k % 4)) * (high - low)
    row = {
        "joint": joint["name"],
        "position": [first, last],
        "position_limit_percent": 100 * (last - first) / (high - low),
    }
    row |= {"velocity_max": 1.9, "velocity_limit_percent": 190 / joint["limits"]["velocity"], "acceleration_max": 6.4}
    limit = joint["limits"]["acceleration"]
    row["acceleration_limit_percent"] = 640 / limit if limit else None
    return row if limit else {**row, "acceleration_limit_percent_reason": "the robot file gives no acceleration limit"}


def _log(path: str, role: str, simulated: bool, noise: dict[str, Any], findings: list[str]) -> dict[str, Any]:
    figures = {"samples": 30001, "rate_hz": 1000.0, "duration_s": 30.0, "simulated": simulated}
    return {"path": path, "role": role, "sha256": HASH[::-1], **figures, **noise, "findings": findings}


def _verdict(test: bool, simulated: bool, train: dict[str, Any], tests: list[Any]) -> dict[str, Any]:
    told = (
        f"{tests[0]['moving_relative_residual_percent']:.2g} % of the torque of unseen motion is left while moving"
        if test
        else None
    )
    uses = [
        {
            "use": "prediction of joint torque",
            "status": "MET" if test else "NOT TESTED",
            "result": told,
            "limit": "5 %",
            "limit_source": "the default of `identify fit`",
            "action": None if test else "Give a second log with --test",
        },
        {
            "use": "simulation",
            "status": "NOT TESTED",
            "result": None,
            "result_reason": "physical consistency of the links is not computed",
            "limit": None,
            "limit_source": None,
            "action": None,
        },
        {
            "use": "payload identification",
            "status": "NOT MET" if test else "NOT TESTED",
            "result": "the error at the wrist equals the torque of a 0.4 kg load" if test else None,
            "limit": "0.1 kg",
            "limit_source": "the robot file",
            "action": "Record slower motion of the wrist",
        },
    ]
    reasons = [] if test else ["no test log was given, so nothing is known about unseen motion"]
    actions = ["Give a test log with --test"] if not test else ["Record slower motion of joint_5 and joint_6"]
    return {"status": "accept" if test else "warn", "reasons": reasons, "uses": uses, "actions": actions}
