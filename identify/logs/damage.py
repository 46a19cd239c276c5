"""What of a recording could not be used, and how it is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from identify.logs.wording import counted

_TOLD = 8
_SECOND = 1_000_000_000


@dataclass(frozen=True)
class Damage:
    """Bytes that could not be used: where they start, how many, why, and the log times they span where known [ns].

    `cut`: the file ends there, before its time. file: its name where there are several.
    """

    offset: int
    lost_bytes: int
    reason: str
    span: tuple[int, int] | None = None
    cut: bool = False
    file: str = ""


def describe(damages: Sequence[Damage], recovered: str, first: int) -> list[str]:
    """A sentence for every damage: what was lost. recovered: what was not; first: log time of the start [ns]."""
    sentences = []
    for damage in damages[:_TOLD]:
        lost = f"{counted(damage.lost_bytes, 'byte')} lost" if damage.lost_bytes else "no sample lost"
        if damage.span is not None:
            start, stop = ((when - first) / _SECOND for when in damage.span)
            lost += f", which spanned {start:.3f} to {stop:.3f} s"
        name = f"{damage.file}: the file" if damage.file else "the file"
        if damage.cut and damage.lost_bytes:
            sentences.append(f"{name} is cut: {damage.reason} at byte {damage.offset}; {recovered}; {lost}")
        elif damage.cut:
            sentences.append(f"{name} is cut: {damage.reason}; {recovered}; what followed is not known")
        else:
            sentences.append(f"{name} is damaged at byte {damage.offset}: {damage.reason}; {lost}")
    if damages[_TOLD:]:
        lost_bytes = sum(damage.lost_bytes for damage in damages[_TOLD:])
        sentences.append(
            f"{counted(len(damages) - _TOLD, 'more place')} damaged, with {counted(lost_bytes, 'byte')} lost"
        )
    return sentences
