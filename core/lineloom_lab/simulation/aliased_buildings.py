"""Buildings whose parts share their walls and differ in their furniture alone.

Where one room is like the next, only what stands in them tells a robot where it is: the worlds in
which maps get joined wrongly. `bare=True` leaves out all that tells: nobody could know.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lineloom_lab.simulation.blueprint import WALL_THICKNESS_M, Blueprint
from lineloom_lab.simulation.building import Building
from lineloom_lab.simulation.buildings import draw_niched_corridor
from lineloom_lab.simulation.furniture import (
    OFFICE,
    Piece,
    Rectangle,
    Room,
    column,
    desk,
    duct,
    furnish,
    shelf,
    table,
)

_HALF_WALL_M = 0.5 * WALL_THICKNESS_M
_DOOR_M = 1.0
_DOOR_DEPTH_M = 1.25
_LUGGAGE: tuple[Piece, ...] = (duct, shelf, duct, column, duct, shelf, column)
_AISLE: tuple[Piece, ...] = (duct, shelf, duct, duct, shelf, duct)
_HALL_PIECES: tuple[Piece, ...] = (table, shelf, desk, table, shelf, duct, column, desk)


def rooms_in_a_row(seed: int = 0, *, count: int = 8, bare: bool = False) -> Building:
    """Return a corridor with `count` rooms of 4.2 x 5 m along one side, all of the same walls.

    Both ends of the corridor are alike, too.
    """
    rng, plan, furniture = np.random.default_rng([seed, 11]), *_boards("rooms-in-a-row")
    width, depth, corridor = 4.2, 5.0, 2.2
    length = count * width
    door = 1.2, 1.2 + _DOOR_M
    _draw_outline(plan, length, -corridor, depth)
    plan.wall((0.0, 0.0), (length, 0.0), [(i * width + door[0], i * width + door[1])
                                          for i in range(count)])  # fmt: skip
    for i in range(1, count):
        plan.wall((i * width, 0.0), (i * width, depth))
    doors = [_swept(i * width + door[0], 0.0) for i in range(count)]
    for i in range(count):
        room = _inside((i * width, 0.0, (i + 1) * width, depth), doors)
        furnish(furniture, room, rng, () if bare else OFFICE)
    aisle = _inside((0.0, -corridor, length, 0.0), doors)
    furnish(furniture, aisle, rng, () if bare else _AISLE)
    return Building.of(plan, furniture)


def hotel_floor(seed: int = 0, *, count: int = 7, bare: bool = False) -> Building:
    """Return a corridor with `count` hotel rooms on each side, every second one mirrored.

    Bathroom, bed and desk stand in all of them alike, to within 4 cm; what guests left differs.
    """
    rng, plan, furniture = np.random.default_rng([seed, 12]), *_boards("hotel-floor")
    width, depth, half = 3.9, 6.4, 0.95
    length = count * width
    _draw_outline(plan, length, -half - depth, half + depth)
    doors: list[Rectangle] = []
    for side in (1, -1):
        lefts = [i * width for i in range(count)]
        entries = [x + (2.4 if _is_straight(i, side) else 0.5) for i, x in enumerate(lefts)]
        openings = [(x, x + _DOOR_M) for x in entries]
        plan.wall((0.0, side * half), (length, side * half), openings)
        for x in lefts[1:]:
            plan.wall((x, side * half), (x, side * (half + depth)))
        for i, (x, entry) in enumerate(zip(lefts, entries, strict=True)):
            low, high = sorted((side * half, side * (half + depth)))
            doors.append(_swept(entry, side * half))
            room = _inside((x, low, x + width, high), doors[-1:])
            slack = np.zeros(3) if bare else rng.uniform(-0.04, 0.04, size=3)
            _draw_hotel_room(plan, room, side, slack, straight=_is_straight(i, side))
            furnish(furniture, room, rng, () if bare else _LUGGAGE)
    aisle = _inside((0.0, -half, length, half), doors)
    furnish(furniture, aisle, rng, () if bare else _AISLE)
    return Building.of(plan, furniture)


def self_similar_corridor(seed: int = 0, *, length: float = 60.0, bare: bool = False) -> Building:
    """Return `long_corridor` with ducts and cabinets along it at random: they alone tell."""
    rng, plan, furniture = np.random.default_rng([seed, 13]), *_boards("long-corridor")
    draw_niched_corridor(plan, length, width := 2.2, spacing=3.0)
    pieces = () if bare else (duct, shelf) * 8
    furnish(furniture, Room((0.0, 0.0, length, width)), rng, pieces)
    return Building.of(plan, furniture)


def symmetric_hall(seed: int = 0, *, bare: bool = False) -> Building:
    """Return a hall of 20 x 14 m that looks alike from both ends and in a mirror.

    Six columns stand in a grid, niches in all four walls; the furniture is as it comes.
    """
    rng, plan, furniture = np.random.default_rng([seed, 14]), *_boards("symmetric-hall")
    width, height, niche, deep = 20.0, 14.0, 1.2, 0.4
    corners: list[tuple[float, float]] = []
    sides = (
        ((0.0, 0.0), (1.0, 0.0), width),
        ((width, 0.0), (0.0, 1.0), height),
        ((width, height), (-1.0, 0.0), width),
        ((0.0, height), (0.0, -1.0), height),
    )
    for (x, y), (u, v), span in sides:
        corners.append((x, y))
        for at in (0.25 * span, 0.75 * span):
            for along, out in ((-niche, 0.0), (-niche, deep), (niche, deep), (niche, 0.0)):
                s = at + 0.5 * along
                corners.append((x + s * u + out * v, y + s * v - out * u))
    plan.outline(corners)
    for cx in (5.0, 10.0, 15.0):
        for cy in (4.5, 9.5):
            plan.box((cx, cy), 0.5, 0.5)
    room = Room((0.0, 0.0, width, height))
    room.taken += [(x - 0.25, y - 0.25, x + 0.25, y + 0.25)
                   for x in (5.0, 10.0, 15.0) for y in (4.5, 9.5)]  # fmt: skip
    furnish(furniture, room, rng, () if bare else _HALL_PIECES)
    return Building.of(plan, furniture)


def _boards(name: str) -> tuple[Blueprint, Blueprint]:
    """Two drawing boards: one for the walls, one for the furniture."""
    return Blueprint(name), Blueprint("furniture")


def _draw_outline(plan: Blueprint, length: float, low: float, high: float) -> None:
    corners = [(0.0, low), (length, low), (length, high), (0.0, high)]
    for i, corner in enumerate(corners):
        plan.wall(corner, corners[(i + 1) % 4])


def _inside(walls: Rectangle, keep_free: Sequence[Rectangle]) -> Room:
    """Return the room between four wall centre lines."""
    h = _HALF_WALL_M
    clear = (walls[0] + h, walls[1] + h, walls[2] - h, walls[3] - h)
    return Room(clear, keep_free=list(keep_free))


def _swept(door: float, wall: float) -> Rectangle:
    """What must stay free on both sides of a door at x = `door` in the wall at y = `wall`."""
    depth = _HALF_WALL_M + _DOOR_DEPTH_M
    return door - 0.35, wall - depth, door + _DOOR_M + 0.35, wall + depth


def _is_straight(index: int, side: int) -> bool:
    return (index + (side > 0)) % 2 == 0


def _draw_hotel_room(
    plan: Blueprint, room: Room, side: int, slack: NDArray[np.float64], *, straight: bool
) -> None:
    """Draw bathroom, bed and desk, mirrored as the room is."""
    x0, y0, x1, y1 = room.inside
    near = y0 if side > 0 else y1

    def put(depth_along: tuple[float, float], from_left: tuple[float, float]) -> None:
        a, b = (near + side * d for d in depth_along)
        if straight:
            low, high = x0 + from_left[0], x0 + from_left[1]
        else:
            low, high = x1 - from_left[1], x1 - from_left[0]
        box = low, min(a, b), high, max(a, b)
        plan.outline([(box[0], box[1]), (box[2], box[1]), (box[2], box[3]), (box[0], box[3])])
        room.taken.append(box)

    width = x1 - x0
    bed, shift, writing = (float(v) for v in slack)
    put((0.0, 2.2), (0.0, 1.8))
    put((3.3 + bed, 4.9 + bed), (0.0, 2.0 + shift))
    put((4.4 + writing, 5.7 + writing), (width - 0.6, width))
