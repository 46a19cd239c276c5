"""XML from anywhere, parsed without trust: no declaration is expanded, no file opened, no size or depth left open."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from identify.errors import RobotError
from identify.robot import checks

DEEPEST = 200
"""Levels of elements; a chain of bodies takes one a body, and MuJoCo itself stops at 500."""
MOST = 200_000
"""Elements of a file."""
UNEXPANDED = "holds xacro macros; expand it first:  xacro FILE > arm.urdf"


def parse_xml(text: str, source: str) -> Element:
    """The top element. RobotError, in one line, for what is no XML, declares entities or is out of all proportion."""
    parser = expat.ParserCreate("utf-8")
    depth = count = 0

    def opened(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > DEEPEST:
            raise RobotError(f"{source}: elements lie more than {DEEPEST} deep; no robot description needs that")
        if count > MOST:
            raise RobotError(f"{source}: more than {MOST:,} elements; no robot description needs that")

    def closed(tag: str) -> None:
        nonlocal depth
        depth -= 1

    def declared(*_: object) -> None:
        raise RobotError(f"{source}: holds a DOCTYPE or ENTITY declaration, which is refused; remove it")

    parser.StartElementHandler = opened
    parser.EndElementHandler = closed
    # Entities can blow up or reach out; there are none without a DOCTYPE.
    parser.StartDoctypeDeclHandler = declared
    try:
        data = text.encode()
        parser.Parse(data, True)
        return ElementTree.fromstring(data, ElementTree.XMLParser(encoding="utf-8"))
    except (expat.ExpatError, ElementTree.ParseError) as error:
        raise RobotError(f"{source}: not valid XML: {error}") from None
    except UnicodeEncodeError:
        raise RobotError(f"{source}: not valid XML: a character that is none") from None


def attribute(element: Element, key: str, where: str) -> str:
    """The value of an attribute that has to be there."""
    value = element.get(key)
    if not value:
        raise RobotError(f"{where}: no attribute {key}")
    return checks.text(value, f"{where}: {key}")


def number(element: Element, key: str, default: float, where: str, infinite: bool = False) -> float:
    """One number, `default` where the attribute is not given; finite unless `infinite`."""
    value = element.get(key)
    if value is None:
        return default
    numbers = tuple(_floats(value, f"{where}: {key}", infinite))
    if len(numbers) != 1:
        raise RobotError(f"{where}: {key}: expected one number, found {checks.found(value)}")
    return numbers[0]


def vector(element: Element, key: str, default: tuple[float, ...], where: str) -> tuple[float, ...]:
    """As many numbers as `default`, which is taken where the attribute is not given."""
    value = element.get(key)
    if value is None:
        return default
    numbers = tuple(_floats(value, f"{where}: {key}"))
    if len(numbers) != len(default):
        raise RobotError(f"{where}: {key}: expected {len(default)} numbers, found {checks.found(value)}")
    return numbers


def _floats(text: str, where: str, infinite: bool = False) -> Iterator[float]:
    for word in text.split():
        try:
            value = float(word)
        except ValueError:
            told = (
                f"{UNEXPANDED}; found {checks.found(text)}"
                if "${" in text
                else f"expected numbers, found {checks.found(text)}"
            )
            raise RobotError(f"{where}: {told}") from None
        yield checks.number(value, where, infinite)
