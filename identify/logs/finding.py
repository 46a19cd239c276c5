"""One thing that is odd about a recording: what, where, how bad, and what was done about it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

NOTE, WARNING, ERROR = "note", "warning", "error"
"""A note changes no result; a warning may; an error makes any result wrong, and `fit` refuses the log."""

KEPT, REFUSED = "kept", "refused"

_READING = (
    ("their time repeats", "duplicate time"),
    ("time runs backward", "backward time"),
    ("not finite, or absurd", "corrupt values"),
    ("is NaN", "corrupt values"),
    ("velocity sample", "corrupt values"),
    ("no effort is a finite number", "no effort"),
)
"""Words of the reading's sentences, and what kind of finding they are."""


@dataclass(frozen=True)
class Finding:
    """kind: a short name of the fault; text: the sentence; action: what was done; joints: those concerned."""

    kind: str
    severity: str
    text: str
    action: str = KEPT
    joints: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """The text with what was done about it, where that is anything and the text does not say it itself."""
        return self.text if self.action == KEPT or self.action in self.text else f"{self.text} ({self.action})"

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {**asdict(self), "joints": list(self.joints)}


def of_reading(sentence: str) -> Finding:
    """A sentence that reading or a simulation left in `Log.findings`."""
    kind = next((kind for words, kind in _READING if words in sentence), "reading")
    action = next((word for word in ("dropped", "derived", "not used") if word in sentence), KEPT)
    return Finding(kind, WARNING, sentence, action)
