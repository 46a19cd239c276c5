"""Damage done to robot files at random: bytes, numbers, names, lines and elements lost, doubled, swapped or absurd."""

from __future__ import annotations

import re

import numpy as np

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")
WORD = re.compile(r"[A-Za-z_][A-Za-z_0-9]*")
ELEMENT = re.compile(r"<[^<>]*>")
VALUE = re.compile(r'"[^"]*"')

ABSURD = [
    "nan",
    "inf",
    "-inf",
    "0",
    "-0",
    "-1",
    "1",
    "1e-9",
    "1e-320",
    "1e9",
    "1e11",
    "1e300",
    "1e400",
    "-1e300",
    "0x10",
    "1_0",
    "1,5",
    "0.1.2",
    "++1",
    "-",
    "٣",
    "true",
    "[]",
    "{}",
    "[[[[]]]]",
    "&#0;",
    "&amp;",
    "&lt;",
    "${x}",
    "$(x)",
    "\\",
    "base",
    "world",
    "robot",
    "joint_1",
    "../..",
    "/etc/passwd",
    "\x00",
    "\ufffe",
    "\U0001f916",
]
ABSURD += ["", " ", "\n", "9" * 5000, "0x" + "f" * 6000, "1 2", "1 2 3 4 5 6 7", "x" * 3000, "[" * 2000, "a." * 500]
EXTRA = (
    '<!DOCTYPE r [<!ENTITY a "b">]>',
    '<!DOCTYPE r SYSTEM "file:///etc/passwd">',
    "<!-- -->",
    "<![CDATA[x]]>",
    "<?xml version='1.0' encoding='utf-16'?>",
    "<mimic joint='elbow' multiplier='nan'/>",
    "<body>" * 50,
    "</body>",
    "<joint/>",
    "<include file='x.xml'/>",
    "<replicate count='1000000000'>",
    "<freejoint/>",
    "<inertial mass='0'/>",
    "<mujoco>",
    "<robot>",
    '[[joint]]\nname = "again"\n',
    "parent = 'shoulder'\n",
    "\ufeff",
)


def mutated(rng: np.random.Generator, text: str) -> str:
    """The text after one random change or a few."""
    for _ in range(int(rng.choice([1, 2, 3, 5], p=[0.6, 0.2, 0.1, 0.1]))):
        text = CHANGES[int(rng.integers(len(CHANGES)))](rng, text)
    return text


def _replaced(pattern: re.Pattern[str], rng: np.random.Generator, text: str, new: str) -> str:
    found = list(pattern.finditer(text))
    if not found:
        return text + new
    at = found[int(rng.integers(len(found)))]
    return text[: at.start()] + new + text[at.end() :]


def _pick(rng: np.random.Generator, choices: tuple[str, ...] | list[str]) -> str:
    return choices[int(rng.integers(len(choices)))]


def _number(rng: np.random.Generator, text: str) -> str:
    return _replaced(NUMBER, rng, text, _pick(rng, ABSURD))


def _nudged(rng: np.random.Generator, text: str) -> str:
    """A number that stays one: turned round, scaled or moved."""
    found = list(NUMBER.finditer(text))
    if not found:
        return text
    at = found[int(rng.integers(len(found)))]
    old = float(at.group())
    new = (-old, old * 10.0 ** rng.uniform(-12, 12), old + rng.normal(), 0.0, round(old))[int(rng.integers(5))]
    return text[: at.start()] + repr(float(new)) + text[at.end() :]


def _value(rng: np.random.Generator, text: str) -> str:
    found = VALUE.findall(text)
    other = _pick(rng, found) if found and rng.random() < 0.5 else f'"{_pick(rng, ABSURD)}"'
    return _replaced(VALUE, rng, text, other)


def _word(rng: np.random.Generator, text: str) -> str:
    return _replaced(WORD, rng, text, _pick(rng, WORD.findall(text) or ["x"]) if rng.random() < 0.7 else "")


def _element(rng: np.random.Generator, text: str) -> str:
    other = _pick(rng, ELEMENT.findall(text) or ["<x/>"])
    new = ("", other, other * 3)[int(rng.integers(3))]
    return _replaced(ELEMENT, rng, text, new)


def _line(rng: np.random.Generator, text: str) -> str:
    lines = text.splitlines(keepends=True) or [""]
    a, b = (int(x) for x in rng.integers(len(lines), size=2))
    kind = rng.integers(3)
    if kind == 0:
        del lines[min(a, b) : max(a, b) + 1 if rng.random() < 0.2 else min(a, b) + 1]
    elif kind == 1:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        lines.insert(a, lines[b])
    return "".join(lines)


def _character(rng: np.random.Generator, text: str) -> str:
    at = int(rng.integers(len(text) + 1))
    new = ("", chr(int(rng.integers(1, 0x250))), _pick(rng, "<>\"'=[]{}/\\&;#\n. "))[int(rng.integers(3))]
    return text[:at] + new + text[at + 1 :]


def _insert(rng: np.random.Generator, text: str) -> str:
    at = int(rng.integers(len(text) + 1))
    return text[:at] + _pick(rng, EXTRA) + text[at:]


def _cut(rng: np.random.Generator, text: str) -> str:
    return text[: int(rng.integers(len(text) + 1))] if rng.random() < 0.3 else text


CHANGES = (
    _nudged,
    _nudged,
    _nudged,
    _nudged,
    _number,
    _number,
    _value,
    _value,
    _word,
    _element,
    _line,
    _character,
    _insert,
    _cut,
)


def robot_files() -> list[tuple[str, str]]:
    """(file name, text) of sound robots in every format, to be damaged."""
    import test_mjcf_reading
    import test_toml
    import test_urdf

    from identify.robot.library import load_robot
    from identify.robot.mjcf import to_mjcf
    from identify.robot.toml import write_toml

    rng = np.random.default_rng(0)
    return [
        ("arm.urdf", test_urdf.ARM),
        ("random.urdf", test_urdf.random_urdf(rng, 5, special=True, tree=True)),
        ("arm.xml", test_mjcf_reading.ARM),
        ("random.xml", test_mjcf_reading.random_mjcf(rng, 4)),
        ("rx90.xml", to_mjcf(load_robot("rx90"), position_gain=np.ones(6))),
        ("arm.toml", test_toml.ARM),
        ("tx40.toml", write_toml(load_robot("tx40"))),
    ]
