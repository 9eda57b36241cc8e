"""A drawing board for buildings: thick walls with openings, doors, boxes and pillars."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from lineloom_lab.simulation.world import World

Point = tuple[float, float]

WALL_THICKNESS_M = 0.15


@dataclass
class Blueprint:
    """Collects line segments [m, world frame] and turns them into a `World`.

    Every method draws closed outlines, so that beams never see a wall from its inside.
    """

    name: str
    segments: list[tuple[float, float, float, float]] = field(default_factory=list)
    doorways: list[tuple[float, float, float, float]] = field(default_factory=list)
    """Centre lines of all openings in thick walls: where a door may be closed."""

    def line(self, start: Point, end: Point) -> None:
        """Draw one thin segment, such as the leaf of an open door."""
        self.segments.append((*start, *end))

    def outline(self, corners: Sequence[Point]) -> None:
        """Draw a closed polygon."""
        for i, corner in enumerate(corners):
            self.line(corner, corners[(i + 1) % len(corners)])

    def box(self, centre: Point, length: float, width: float, angle: float = 0.0) -> None:
        """Draw a rectangle of length x width [m], its length along `angle` [rad]."""
        c, s = math.cos(angle), math.sin(angle)
        u, v = (0.5 * length * c, 0.5 * length * s), (-0.5 * width * s, 0.5 * width * c)
        signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        self.outline(
            [(centre[0] + a * u[0] + b * v[0], centre[1] + a * u[1] + b * v[1]) for a, b in signs]
        )

    def pillar(self, centre: Point, radius: float, sides: int = 8, angle: float = 0.0) -> None:
        """Draw a regular polygon whose corners lie `radius` [m] from its centre."""
        turns = [angle + math.tau * i / sides for i in range(sides)]
        self.outline(
            [(centre[0] + radius * math.cos(t), centre[1] + radius * math.sin(t)) for t in turns]
        )

    def wall(
        self,
        start: Point,
        end: Point,
        openings: Sequence[tuple[float, float]] = (),
        thickness: float = WALL_THICKNESS_M,
    ) -> None:
        """Draw a thick wall about the centre line start-end, open over the given stretches.

        openings: (from, to) [m] along the wall, in order and apart. Its ends reach half a thickness
        further, so that walls that share a corner leave no gap.
        """
        length = math.dist(start, end)
        u = ((end[0] - start[0]) / length, (end[1] - start[1]) / length)
        edges = [-0.5 * thickness, *(e for opening in openings for e in opening)]
        edges.append(length + 0.5 * thickness)
        if any(b <= a for a, b in pairwise(edges)):
            raise ValueError(f"openings {list(openings)} do not fit a wall of {length:.2f} m")
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            middle = (start[0] + 0.5 * (a + b) * u[0], start[1] + 0.5 * (a + b) * u[1])
            self.box(middle, b - a, thickness, math.atan2(u[1], u[0]))
        for a, b in openings:
            self.doorways.append(
                (
                    start[0] + a * u[0],
                    start[1] + a * u[1],
                    start[0] + b * u[0],
                    start[1] + b * u[1],
                )
            )

    def door_leaf(self, hinge: Point, width: float, angle: float) -> None:
        """Draw an open door's leaf of `width` [m] from its hinge along `angle` [rad]."""
        self.line(hinge, (hinge[0] + width * math.cos(angle), hinge[1] + width * math.sin(angle)))

    def world(self) -> World:
        """Return what was drawn."""
        return World(np.array(self.segments), name=self.name)
