"""A whole office floor, different for every seed.

+------+-----+------+----+-----+------+
|      |     |      |    |     |      |   the upper row of rooms
|      +-- --+-- ---+- --+-- --+      |
+---  -+   corridor            +-  ---+
|        +-----+------+-----+         |   a corridor round a core of rooms, which a
|      | |     | pass |     |  |      |   passage crosses
|        +-- --+      +- ---+         |
+--  --+                       +-  ---+
|      +-- --+--- --+-- --+-- -+      |
|      |     |      |     |    |      |   the lower row
+------+-----+------+-----+----+------+
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from lineloom_lab.simulation.blueprint import WALL_THICKNESS_M, Blueprint
from lineloom_lab.simulation.building import Building
from lineloom_lab.simulation.furniture import STYLES, Rectangle, Room, duct, furnish, shelf
from lineloom_lab.simulation.world import World

_WIDTH_M, _HEIGHT_M = 40.0, 20.0
_HALF_WALL_M = 0.5 * WALL_THICKNESS_M
_DOOR_DEPTH_M = 1.25
_PASSAGE_M = 0.9
_MIN_ROOM_M = 3.4


@dataclass
class _Floor:
    """The drawing under way: rooms so far, and the wall lines of the plan [m].

    mouths: where the passage meets the corridor.
    """

    plan: Blueprint
    rng: np.random.Generator
    left: float
    right: float
    low: float
    high: float
    core: Rectangle
    rooms: list[Room] = field(default_factory=list)
    mouths: list[Rectangle] = field(default_factory=list)


def office_floor(seed: int = 0) -> World:
    """Return a floor of 40 x 20 m: about twenty furnished rooms around and inside a corridor loop.

    The same seed gives the same floor. Every room can be reached by a robot of 0.3 m radius.
    """
    return office_building(seed).world


def office_building(seed: int = 0, furniture_seed: int | None = None) -> Building:
    """Return `office_floor` with its doorways; every piece of furniture is telling.

    furniture_seed: draws the furniture alone, so that floors of one seed share their walls; None
    lets the walls' own stream go on.
    """
    floor = _draw_walls(seed)
    furniture = Blueprint("furniture")
    rng = floor.rng if furniture_seed is None else np.random.default_rng([furniture_seed, 5])
    for index, room in enumerate(floor.rooms):
        style = STYLES[(index + int(rng.integers(2))) % len(STYLES)]
        furnish(furniture, room, rng, style)
    _furnish_corridor(floor, furniture, rng)
    return Building.of(floor.plan, furniture)


def _draw_walls(seed: int) -> _Floor:
    rng = np.random.default_rng(seed)
    left, right = float(rng.uniform(5.2, 6.2)), _WIDTH_M - float(rng.uniform(5.2, 6.2))
    low, high = float(rng.uniform(4.6, 5.4)), _HEIGHT_M - float(rng.uniform(4.6, 5.4))
    widths = rng.uniform(1.8, 2.4, size=4)
    core = (
        left + float(widths[0]),
        low + float(widths[1]),
        right - float(widths[2]),
        high - float(widths[3]),
    )
    floor = _Floor(Blueprint("office"), rng, left, right, low, high, core)
    _draw_shell(floor)
    _draw_row(floor, 0.0, low, door_above=True)
    _draw_row(floor, high, _HEIGHT_M, door_above=False)
    _draw_wing(floor, 0.0, left, door_right=True)
    _draw_wing(floor, right, _WIDTH_M, door_right=False)
    _draw_core(floor)
    return floor


def _draw_shell(floor: _Floor) -> None:
    corners = [(0.0, 0.0), (_WIDTH_M, 0.0), (_WIDTH_M, _HEIGHT_M), (0.0, _HEIGHT_M)]
    for i, corner in enumerate(corners):
        floor.plan.wall(corner, corners[(i + 1) % 4])


def _cuts(
    rng: np.random.Generator, start: float, end: float, count: int, least: float = _MIN_ROOM_M
) -> list[float]:
    """Cut [start, end] into `count` stretches of random length, none under `least` [m]."""
    spare = end - start - count * least
    shares = rng.dirichlet(np.full(count, 2.0)) * spare + least
    return [start, *(start + float(s) for s in np.cumsum(shares)[:-1]), end]


def _room(x0: float, y0: float, x1: float, y1: float) -> Room:
    """Return the room between four wall centre lines."""
    h = _HALF_WALL_M
    return Room((x0 + h, y0 + h, x1 - h, y1 - h))


def _door_in(rng: np.random.Generator, start: float, end: float) -> tuple[float, float]:
    """Choose an opening of 0.95 to 1.3 m somewhere on the stretch of wall from start to end."""
    width = float(rng.uniform(0.95, 1.3))
    at = float(rng.uniform(start + 0.3, end - 0.3 - width))
    return at, at + width


def _hang_door(
    floor: _Floor,
    room: Room,
    opening: tuple[float, float],
    wall: float,
    *,
    upright: bool,
    side: int,
) -> None:
    """Keep the way through a door free, and hang an open leaf beside half of the doors.

    wall: the wall's coordinate across; upright: the wall runs along y. side: +1 where the room lies
    on the wall's increasing side.
    """
    a, b = opening
    has_leaf = bool(floor.rng.random() < 0.5)
    reach = 0.85 * (b - a)
    # Behind an open leaf a robot still has to get round its tip.
    depth = _HALF_WALL_M + (reach + _PASSAGE_M if has_leaf else _DOOR_DEPTH_M)
    # Both sides of the wall: furniture in a corridor respects the doors along it, too.
    near, far = wall - side * (_HALF_WALL_M + _DOOR_DEPTH_M), wall + side * depth
    box = (a - 0.35, min(near, far), b + 0.35, max(near, far))
    room.keep_free.append((box[1], box[0], box[3], box[2]) if upright else box)
    if not has_leaf:
        return
    at_a = bool(floor.rng.random() < 0.5)
    along = a if at_a else b
    # The leaf opens into the room by a little more than a right angle, clear of the opening.
    swing = math.radians(float(floor.rng.uniform(90.0, 108.0)))
    across = wall + side * _HALF_WALL_M
    tip_along = along + (1.0 if at_a else -1.0) * reach * math.cos(swing)
    tip_across = across + side * reach * math.sin(swing)
    if upright:
        floor.plan.line((across, along), (tip_across, tip_along))
    else:
        floor.plan.line((along, across), (tip_along, tip_across))


def _draw_row(floor: _Floor, y0: float, y1: float, *, door_above: bool) -> None:
    """Draw the rooms between the wings along one long side, each with a door on the corridor."""
    rng = floor.rng
    cuts = _cuts(rng, floor.left, floor.right, int(rng.integers(5, 8)))
    rooms = [_room(a, y0, b, y1) for a, b in pairwise(cuts)]
    wall, side = (y1, -1) if door_above else (y0, 1)
    openings = []
    for room in rooms:
        opening = _door_in(rng, room.inside[0], room.inside[2])
        # The corridor starts where the wings end.
        openings.append((opening[0] - floor.left, opening[1] - floor.left))
        _hang_door(floor, room, opening, wall, upright=False, side=side)
    floor.plan.wall((floor.left, wall), (floor.right, wall), openings)
    for index, x in enumerate(cuts[1:-1]):
        _draw_partition(floor, rooms[index], rooms[index + 1], x, y0, y1)
    floor.rooms += rooms


def _draw_partition(
    floor: _Floor, first: Room, second: Room, x: float, y0: float, y1: float
) -> None:
    """Draw the wall between neighbours; a third of them share a door."""
    openings = []
    if floor.rng.random() < 0.33:
        opening = _door_in(floor.rng, y0 + 1.2, y1 - 1.2)
        openings.append((opening[0] - y0, opening[1] - y0))
        _hang_door(floor, first, opening, x, upright=True, side=-1)
        _hang_door(floor, second, opening, x, upright=True, side=1)
    floor.plan.wall((x, y0), (x, y1), openings)


def _draw_wing(floor: _Floor, x0: float, x1: float, *, door_right: bool) -> None:
    """Draw the three rooms at one end, from the lower to the upper outer wall."""
    rng = floor.rng
    third = (floor.high - floor.low) / 3.0
    cuts = [
        0.0,
        floor.low + third + float(rng.uniform(-0.9, 0.3)),
        floor.low + 2.0 * third + float(rng.uniform(-0.3, 0.9)),
        _HEIGHT_M,
    ]
    wall, side = (x1, -1) if door_right else (x0, 1)
    openings = []
    for a, b in pairwise(cuts):
        room = _room(x0, a, x1, b)
        on_corridor = max(a, floor.low), min(b, floor.high)
        opening = _door_in(rng, on_corridor[0] + _HALF_WALL_M, on_corridor[1] - _HALF_WALL_M)
        openings.append(opening)
        _hang_door(floor, room, opening, wall, upright=True, side=side)
        floor.rooms.append(room)
    floor.plan.wall((wall, 0.0), (wall, _HEIGHT_M), openings)
    for y in cuts[1:-1]:
        floor.plan.wall((x0, y), (x1, y))


def _draw_core(floor: _Floor) -> None:
    """Draw the blocks inside the corridor loop: one is a passage, one an open bay, others rooms."""
    rng = floor.rng
    x0, y0, x1, y1 = floor.core
    passage = float(rng.uniform(0.3, 0.7)) * (x1 - x0) + x0
    half = 0.5 * float(rng.uniform(1.6, 2.2))
    reach = half + _HALF_WALL_M
    floor.mouths += [
        (passage - reach, y - _DOOR_DEPTH_M, passage + reach, y + _DOOR_DEPTH_M) for y in (y0, y1)
    ]
    sides = [(x0, passage - half), (passage + half, x1)]
    bay = int(rng.integers(2))
    for index, (a, b) in enumerate(sides):
        cuts = _cuts(rng, a, b, 2 if b - a < 12.0 else 3)
        for x in cuts:
            floor.plan.wall((x, y0), (x, y1))
        for block, (c, d) in enumerate(pairwise(cuts)):
            _draw_block(floor, c, d, is_bay=index == bay and block == 0)


def _draw_block(floor: _Floor, x0: float, x1: float, *, is_bay: bool) -> None:
    """Draw one block of the core: a bay open to the corridor below, one deep room, or two rooms."""
    rng, (_, y0, _, y1) = floor.rng, floor.core
    middle = float(rng.uniform(0.42, 0.58)) * (y1 - y0) + y0
    split = is_bay or bool(rng.random() < 0.4)
    lower, upper = (_room(x0, y0, x1, y1),) * 2
    if split:
        lower, upper = _room(x0, y0, x1, middle), _room(x0, middle, x1, y1)
        floor.plan.wall((x0, middle), (x1, middle))
    door = (x0 + 0.6, x1 - 0.6) if is_bay else _door_in(rng, x0 + 0.1, x1 - 0.1)
    floor.plan.wall((x0, y0), (x1, y0), [(door[0] - x0, door[1] - x0)])
    if is_bay:
        lower.keep_free.append((door[0], y0 - 1.5, door[1], y0 + 0.5))
    else:
        _hang_door(floor, lower, door, y0, upright=False, side=1)
    if split or rng.random() < 0.5:
        door = _door_in(rng, x0 + 0.1, x1 - 0.1)
        floor.plan.wall((x0, y1), (x1, y1), [(door[0] - x0, door[1] - x0)])
        _hang_door(floor, upper, door, y1, upright=False, side=-1)
    else:
        floor.plan.wall((x0, y1), (x1, y1))
    floor.rooms += [lower, upper] if split else [lower]


def _furnish_corridor(floor: _Floor, furniture: Blueprint, rng: np.random.Generator) -> None:
    """Line the corridor with ducts, cabinets and pilasters, never in front of a door."""
    cx0, cy0, cx1, cy1 = floor.core
    h = _HALF_WALL_M
    legs = [
        (floor.left + h, floor.low + h, floor.right - h, cy0 - h),
        (floor.left + h, cy1 + h, floor.right - h, floor.high - h),
        (floor.left + h, cy0, cx0 - h, cy1),
        (cx1 + h, cy0, floor.right - h, cy1),
    ]
    doors = [area for room in floor.rooms for area in room.keep_free]
    for leg, pieces in zip(legs, (8, 8, 3, 3), strict=True):
        corridor = Room(leg, keep_free=doors + floor.mouths)
        furnish(furniture, corridor, rng, [duct, shelf] * pieces)
