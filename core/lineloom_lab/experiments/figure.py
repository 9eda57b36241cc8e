"""A figure: panels in rows on one page, as SVG and PNG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lineloom_core.io.drawing import INK, Drawing, Label, Mark
from lineloom_core.io.png import to_png
from lineloom_core.io.svg import to_svg

from lineloom_lab.experiments.frame import Frame, Panel

_WIDTH, _MARGIN, _HEADING = 1200.0, 20.0, 44.0


@dataclass(frozen=True, slots=True)
class Figure:
    """A page. name: of its files. title: begins with the thesis's figure number.

    rows: panels from top to bottom, each row filled from left to right. row_height [px].
    """

    name: str
    title: str
    description: str
    rows: tuple[tuple[Panel, ...], ...]
    row_height: float = 360.0

    def drawing(self) -> Drawing:
        """Return the page's marks."""
        marks: list[Mark] = [Label(_MARGIN + 8.0, 32.0, self.title, 19.0, INK)]
        for number, panels in enumerate(self.rows):
            top = _HEADING + _MARGIN / 2 + number * (self.row_height + _MARGIN)
            width = (_WIDTH - _MARGIN * (len(panels) + 1)) / len(panels)
            for column, panel in enumerate(panels):
                left = _MARGIN + column * (width + _MARGIN)
                marks.extend(panel.marks(Frame(left, top, width, self.row_height)))
        height = _HEADING + _MARGIN + len(self.rows) * (self.row_height + _MARGIN)
        return Drawing(_WIDTH, height, self.title, self.description, tuple(marks))

    def save(self, folder: Path) -> tuple[Path, Path]:
        """Write `name`.svg and `name`.png into a folder that exists."""
        drawing = self.drawing()
        svg, png = folder / f"{self.name}.svg", folder / f"{self.name}.png"
        svg.write_text(to_svg(drawing), encoding="utf-8")
        png.write_bytes(to_png(drawing))
        return svg, png


def grid(panels: Sequence[Panel], columns: int = 2) -> tuple[tuple[Panel, ...], ...]:
    """Arrange panels in rows of `columns`."""
    return tuple(tuple(panels[i : i + columns]) for i in range(0, len(panels), columns))
