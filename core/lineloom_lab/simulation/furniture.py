"""Rooms and what stands in them: placed at random, never in the way of a door."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from lineloom_lab.simulation.blueprint import Blueprint

Rectangle = tuple[float, float, float, float]
"""x_min, y_min, x_max, y_max [m]."""

_PASSAGE_M = 0.9
"""Between two pieces, or a piece and a wall, there is this much room, or none at all: whatever is
drawn, a robot of 0.3 m radius gets everywhere."""


@dataclass
class Room:
    """The clear inside of an upright room [m] and the places that must stay free.

    keep_free: swept areas of doors and the like. taken: outlines of the furniture so far.
    """

    inside: Rectangle
    keep_free: list[Rectangle] = field(default_factory=list)
    taken: list[Rectangle] = field(default_factory=list)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height [m]."""
        return self.inside[2] - self.inside[0], self.inside[3] - self.inside[1]

    def admits(self, box: Rectangle) -> bool:
        """Does a piece of furniture fit here without blocking any way?"""
        x0, y0, x1, y1 = self.inside
        gaps = (box[0] - x0, box[1] - y0, x1 - box[2], y1 - box[3])
        if any(gap < -1e-9 or 1e-9 < gap < _PASSAGE_M for gap in gaps):
            return False
        if any(_gap(box, area) <= 0.0 for area in self.keep_free):
            return False
        return all(_gap(box, piece) >= _PASSAGE_M for piece in self.taken)

    def take(self, box: Rectangle) -> bool:
        """Reserve the box if it fits; says whether it did."""
        if not self.admits(box):
            return False
        self.taken.append(box)
        return True


def _gap(a: Rectangle, b: Rectangle) -> float:
    """Return the larger of the two axis gaps between two boxes [m]; below 0 they overlap."""
    return max(b[0] - a[2], a[0] - b[2], b[1] - a[3], a[1] - b[3])


Piece = Callable[[Blueprint, Room, np.random.Generator], None]


def furnish(plan: Blueprint, room: Room, rng: np.random.Generator, pieces: Sequence[Piece]) -> None:
    """Put the pieces into the room one after the other; one that fits nowhere is left out."""
    for piece in pieces:
        piece(plan, room, rng)


def _along_wall(
    room: Room, rng: np.random.Generator, length: float, depth: float, tries: int = 12
) -> Rectangle | None:
    """Find a stretch of wall for a piece of length x depth [m] and reserve it."""
    x0, y0, x1, y1 = room.inside
    for _ in range(tries):
        side = int(rng.integers(4))
        span = (x1 - x0 if side % 2 == 0 else y1 - y0) - length
        if span < 0.0:
            continue
        # A third of the pieces stand in a corner; the others leave a passage on both sides.
        at = float(rng.choice([0.0, span])) if rng.random() < 0.35 else float(rng.uniform(0, span))
        box = (
            (x0 + at, y0, x0 + at + length, y0 + depth),
            (x1 - depth, y0 + at, x1, y0 + at + length),
            (x0 + at, y1 - depth, x0 + at + length, y1),
            (x0, y0 + at, x0 + depth, y0 + at + length),
        )[side]
        if room.take(box):
            return box
    return None


def _free_standing(
    room: Room, rng: np.random.Generator, width: float, height: float, tries: int = 15
) -> Rectangle | None:
    """Find room away from all walls for a piece of width x height [m] and reserve it."""
    x0, y0, x1, y1 = room.inside
    spare_x, spare_y = x1 - x0 - width - 2 * _PASSAGE_M, y1 - y0 - height - 2 * _PASSAGE_M
    if spare_x < 0.0 or spare_y < 0.0:
        return None
    for _ in range(tries):
        x = x0 + _PASSAGE_M + float(rng.uniform(0.0, spare_x))
        y = y0 + _PASSAGE_M + float(rng.uniform(0.0, spare_y))
        if room.take((x, y, x + width, y + height)):
            return x, y, x + width, y + height
    return None


def _draw_box(plan: Blueprint, box: Rectangle) -> None:
    centre = (0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3]))
    plan.box(centre, box[2] - box[0], box[3] - box[1])


def shelf(plan: Blueprint, room: Room, rng: np.random.Generator) -> None:
    """Stand a shelf of 0.8 to 2.4 m against a wall."""
    box = _along_wall(room, rng, float(rng.uniform(0.8, 2.4)), float(rng.uniform(0.3, 0.45)))
    if box is not None:
        _draw_box(plan, box)


def desk(plan: Blueprint, room: Room, rng: np.random.Generator) -> None:
    """Push a desk against a wall."""
    box = _along_wall(room, rng, float(rng.uniform(1.2, 1.8)), float(rng.uniform(0.7, 0.9)))
    if box is not None:
        _draw_box(plan, box)


def table(plan: Blueprint, room: Room, rng: np.random.Generator) -> None:
    """Stand a table in the open, upright or askew."""
    length, width = float(rng.uniform(1.2, 2.6)), float(rng.uniform(0.8, 1.3))
    angle = float(rng.choice([0.0, 0.5 * math.pi, rng.uniform(-0.6, 0.6)]))
    c, s = abs(math.cos(angle)), abs(math.sin(angle))
    box = _free_standing(room, rng, length * c + width * s, length * s + width * c)
    if box is not None:
        plan.box((0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])), length, width, angle)


def round_table(plan: Blueprint, room: Room, rng: np.random.Generator) -> None:
    """Stand an eight-cornered table in the open."""
    radius = float(rng.uniform(0.45, 0.8))
    box = _free_standing(room, rng, 2 * radius, 2 * radius)
    if box is not None:
        turn = float(rng.uniform(0.0, math.pi / 4))
        plan.pillar((0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])), radius, 8, turn)


def column(plan: Blueprint, room: Room, rng: np.random.Generator) -> None:
    """Stand a square or round column in the open."""
    size = float(rng.uniform(0.3, 0.55))
    box = _free_standing(room, rng, size, size)
    if box is not None:
        centre = (0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3]))
        if rng.random() < 0.5:
            plan.box(centre, size, size)
        else:
            plan.pillar(centre, 0.5 * size, 12)


def sofa(plan: Blueprint, room: Room, rng: np.random.Generator) -> None:
    """Stand an L-shaped sofa in the open."""
    length, width, seat = float(rng.uniform(1.8, 2.6)), float(rng.uniform(1.5, 2.0)), 0.8
    box = _free_standing(room, rng, length, width)
    if box is None:
        return
    x0, y0, x1, y1 = box
    corners = [
        (x0, y0),
        (x1, y0),
        (x1, y0 + seat),
        (x0 + seat, y0 + seat),
        (x0 + seat, y1),
        (x0, y1),
    ]
    if rng.random() < 0.5:
        corners = [(x0 + x1 - x, y) for x, y in corners]
    if rng.random() < 0.5:
        corners = [(x, y0 + y1 - y) for x, y in corners]
    plan.outline(corners)


def duct(plan: Blueprint, room: Room, rng: np.random.Generator) -> None:
    """Build a shallow duct onto a wall: the small jogs that real walls are full of."""
    box = _along_wall(room, rng, float(rng.uniform(0.4, 0.9)), float(rng.uniform(0.15, 0.4)))
    if box is not None:
        _draw_box(plan, box)


OFFICE: tuple[Piece, ...] = (desk, shelf, desk, shelf, duct, column)
MEETING: tuple[Piece, ...] = (table, shelf, duct, duct)
LOUNGE: tuple[Piece, ...] = (sofa, round_table, shelf, column, column)
LABORATORY: tuple[Piece, ...] = (table, table, desk, desk, shelf, shelf, duct)
STORE: tuple[Piece, ...] = (shelf, shelf, shelf, shelf, duct)
STYLES: tuple[tuple[Piece, ...], ...] = (OFFICE, MEETING, LOUNGE, LABORATORY, STORE)
