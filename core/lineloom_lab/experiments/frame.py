"""Where a panel of a figure lies on its page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from lineloom_core.io.drawing import MUTED, Label, Mark, Strokes, text_width

FONT = 13.0
TITLE_FONT = 15.0


@dataclass(frozen=True, slots=True)
class Frame:
    """A rectangle of the page [px]: left, top, width, height."""

    left: float
    top: float
    width: float
    height: float

    @property
    def right(self) -> float:
        """Right border [px]."""
        return self.left + self.width

    @property
    def bottom(self) -> float:
        """Lower border [px]."""
        return self.top + self.height


class Panel(Protocol):
    """One part of a figure."""

    def marks(self, frame: Frame) -> Iterator[Mark]:
        """Yield what is drawn inside `frame`."""


@dataclass(frozen=True, slots=True)
class LegendEntry:
    """A name and the colour that stands for it."""

    text: str
    colour: str


def legend(entries: tuple[LegendEntry, ...], left: float, baseline: float) -> Iterator[Mark]:
    """Yield a legend in one row: a stroke of each colour and its name."""
    x = left
    for entry in entries:
        y = baseline - 0.35 * FONT
        yield Strokes((((x, y), (x + 18.0, y)),), entry.colour, 4.0, name="legend")
        yield Label(x + 26.0, baseline, entry.text, FONT, MUTED)
        x += 50.0 + text_width(entry.text, FONT)
