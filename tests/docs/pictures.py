"""`python -m tests.docs.pictures`: makes the pictures of the concepts page anew.

Two simulated robots drive through one building: their maps before they are joined, after, and after
the join was taken back; and the constraints behind it, by state.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from lineloom_core.io.drawing import FRAME, INK, MUTED, Drawing, Label, Mark, Strokes, text_width
from lineloom_core.io.map_drawing import draw_map
from lineloom_core.io.map_layout import Panel, lay_out
from lineloom_core.io.png import to_png
from lineloom_core.io.selection import select
from lineloom_core.mapping.answers.site_view import ConstraintView, SiteView
from lineloom_core.mapping.belief.constraint_state import ConstraintState
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.simulation import Fleet, rooms, scanner_360

from tests.docs.pages import ROOT

FOLDER = ROOT / "core" / "docs" / "images"
_WIDTH = 760.0
_FONT = 15.0
_LOOKS: dict[ConstraintState, tuple[str, float, float, float]] = {
    "rejected": ("#e3989e", 1.0, 2.5, 4.0),
    "retracted": ("#a64d86", 2.4, 14.0, 4.0),
    "candidate": ("#b8860b", 2.2, 9.0, 5.0),
    "accepted": ("#009e73", 2.6, 0.0, 0.0),
}
"""Colour, width, and dash and gap [px] by state, the most telling on top."""


def pictures() -> dict[str, Drawing]:
    """Every picture by its file's name."""
    mapper = SiteMapper()
    fleet = Fleet.touring(rooms(0), robots=2, seed=0, duration_s=60.0, lidar=scanner_360())
    before = mapper.view()
    for one in fleet.scans():
        mapper.add(one.robot, one.scan)
        if mapper.version % 50 == 0:
            view = mapper.view()
            if len(view.components) == 2:
                before = view
    after = mapper.view()
    mapper.retract(_merge(after).id)
    undone = mapper.view()
    width = int(_WIDTH)
    return {
        "before.png": draw_map(before, width_px=width),
        "after.png": draw_map(after, width_px=width),
        "undone.png": draw_map(undone, width_px=width),
        "waiting.png": draw_constraints(before),
        "constraints.png": draw_constraints(undone),
    }


def draw_constraints(view: SiteView) -> Drawing:
    """Return all constraints but the tracked ones over the walls, one look a state."""
    panels = lay_out(select(view), None, _WIDTH)
    marks: list[Mark] = []
    for panel in panels:
        marks += _walls(panel)
    bottom = max(panel.top + panel.size[1] for panel in panels)
    found = [c for c in view.constraints if c.kind != "sequential"]
    for state, look in _LOOKS.items():
        lines = [line for c in found if c.state == state for line in _lines(c, view, panels)]
        dashes = tuple(piece for line in lines for piece in _dashed(line, *look[2:]))
        marks.append(Strokes(dashes, look[0], look[1], name=state))
    marks += _legend(bottom + 46.0)
    counts = ", ".join(f"{sum(c.state == s for c in found)} {s}" for s in _LOOKS)
    return Drawing(_WIDTH, bottom + 70.0, "Constraints by state", counts, tuple(marks))


def _merge(view: SiteView) -> ConstraintView:
    return next(c for c in view.constraints if c.kind == "rendezvous" and c.state == "accepted")


def _walls(panel: Panel) -> Iterator[Mark]:
    walls = panel.content.lines
    ends = tuple((panel.at(w.x1, w.y1), panel.at(w.x2, w.y2)) for w in walls)
    yield Strokes(ends, FRAME, 2.0, name="walls")
    component = panel.content.component
    text = f"{component.id}: {', '.join(component.robots)}"
    yield Label(panel.left, panel.top - 8.0, text, _FONT, MUTED)


Points = tuple[tuple[float, float], tuple[float, float]]


def _lines(constraint: ConstraintView, view: SiteView, panels: Sequence[Panel]) -> Iterator[Points]:
    """Yield one line on the page, none where a keyframe is on no panel."""
    at = {panel.content.component.id: panel.at for panel in panels}
    keyframes = {keyframe.id: keyframe for keyframe in view.keyframes}
    a, b = keyframes.get(constraint.keyframe_a), keyframes.get(constraint.keyframe_b)
    if a is not None and b is not None and {a.component, b.component} <= at.keys():
        yield (
            at[a.component](a.pose.x, a.pose.y),
            at[b.component](b.pose.x, b.pose.y),
        )


def _dashed(line: Points, dash: float, gap: float) -> Iterator[Points]:
    (x1, y1), (x2, y2) = line
    length = math.hypot(x2 - x1, y2 - y1)
    if dash == 0.0 or length == 0.0:
        yield line
        return
    for k in range(math.ceil(length / (dash + gap))):
        s, t = k * (dash + gap) / length, min((k * (dash + gap) + dash) / length, 1.0)
        yield (
            (x1 + s * (x2 - x1), y1 + s * (y2 - y1)),
            (x1 + t * (x2 - x1), y1 + t * (y2 - y1)),
        )


def _legend(y: float) -> Iterator[Mark]:
    x = 30.0
    for state, (colour, width, dash, gap) in _LOOKS.items():
        line = ((x, y - 5.0), (x + 40.0, y - 5.0))
        yield Strokes(tuple(_dashed(line, dash, gap)), colour, width)
        yield Label(x + 48.0, y, state, _FONT, INK)
        x += 48.0 + text_width(state, _FONT) + 26.0


def main() -> None:
    """Write the files."""
    for name, drawing in pictures().items():
        path: Path = FOLDER / name
        path.write_bytes(to_png(drawing))
        print(f"{path}: {path.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
