"""A drive: where a robot is at every moment, within its limits of speed and turning."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from lineloom_core.geometry import Pose, wrap
from numpy.typing import ArrayLike, NDArray

from lineloom_lab.simulation.world import World

_SHARPEST_ARC_RAD = math.radians(140.0)
_SMALLEST_ARC_M = 0.05
_ARC_MARGIN_M = 0.005


@dataclass(frozen=True, slots=True)
class Leg:
    """Motion at constant speed and turning rate: a straight, an arc, or a turn on the spot.

    start: T_world_base. length: distance along the way [m]. turn: total turn [rad],
    counter-clockwise. duration_s: [s].
    """

    start: Pose
    length: float
    turn: float
    duration_s: float

    def pose_at(self, time_s: float) -> Pose:
        """Return T_world_base `time_s` seconds into the leg."""
        share = min(1.0, max(0.0, time_s / self.duration_s)) if self.duration_s > 0.0 else 1.0
        length, turn = share * self.length, share * self.turn
        if abs(self.turn) < 1e-12:
            return self.start @ Pose(length, 0.0, 0.0)
        radius = self.length / self.turn  # negative for a right turn
        return self.start @ Pose(
            radius * math.sin(turn), radius * (1.0 - math.cos(turn)), wrap(turn)
        )

    @property
    def end(self) -> Pose:
        """T_world_base at the end of the leg."""
        return self.pose_at(self.duration_s)


@dataclass(frozen=True, eq=False)
class Drive:
    """Legs one after the other; each starts where the one before ends."""

    start: Pose
    legs: tuple[Leg, ...] = ()

    @staticmethod
    def along(
        path: ArrayLike,
        world: World,
        *,
        radius: float,
        speed: float = 0.5,
        turn_rate: float = 1.0,
        heading: float | None = None,
    ) -> Drive:
        """Drive a path of corner points, shape (k, 2) [m], that is free for a disk of `radius`.

        Corners become arcs where there is room and turns on the spot elsewhere. speed: [m/s],
        turn_rate: [rad/s], both limits; heading: at the start [rad], along the path if None.
        """
        corners = _distinct(np.asarray(path, dtype=np.float64).reshape(-1, 2))
        along = 0.0
        if len(corners) > 1:
            along = math.atan2(*(corners[1] - corners[0])[::-1])
        first = Pose(float(corners[0, 0]), float(corners[0, 1]), along)
        start = first if heading is None else Pose(first.x, first.y, wrap(heading))
        driver = _Driver(world, radius, speed, turn_rate, start)
        for i in range(1, len(corners)):
            driver.go(corners[i], corners[i + 1] if i + 1 < len(corners) else None)
        return Drive(start, tuple(driver.legs))

    @cached_property
    def _starts(self) -> NDArray[np.float64]:
        return np.concatenate([[0.0], np.cumsum([leg.duration_s for leg in self.legs])])

    @property
    def duration_s(self) -> float:
        """How long the drive takes [s]."""
        return float(self._starts[-1])

    @property
    def length_m(self) -> float:
        """How far the drive goes [m]."""
        return sum(leg.length for leg in self.legs)

    def pose_at(self, time_s: float) -> Pose:
        """Return T_world_base at a time since the start [s]; the robot waits at both ends."""
        if not self.legs or time_s <= 0.0:
            return self.start
        at = min(int(np.searchsorted(self._starts, time_s, side="right")) - 1, len(self.legs) - 1)
        return self.legs[at].pose_at(time_s - float(self._starts[at]))

    def positions(self, times_s: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
        """Return positions at the given times [s], shape (n, 2) [m]."""
        poses = [self.pose_at(float(t)) for t in times_s]
        return np.array([(p.x, p.y) for p in poses]).reshape(-1, 2)


class _Driver:
    """Builds legs; knows where the robot stands and which way it looks."""

    def __init__(
        self, world: World, radius: float, speed: float, turn_rate: float, start: Pose
    ) -> None:
        if speed <= 0.0 or turn_rate <= 0.0:
            raise ValueError("speed and turn_rate must be positive")
        self.world, self.radius = world, radius
        self.speed, self.turn_rate = speed, turn_rate
        self.pose = start
        self.legs: list[Leg] = []

    def go(self, corner: NDArray[np.float64], beyond: NDArray[np.float64] | None) -> None:
        """Drive to a corner and, where an arc fits, round it towards the point beyond."""
        here = np.array([self.pose.x, self.pose.y])
        ahead = corner - here
        self._spin_to(math.atan2(ahead[1], ahead[0]))
        distance = float(np.hypot(*ahead))
        if beyond is None:
            self._add(distance, 0.0)
            return
        onward = beyond - corner
        turn = wrap(math.atan2(onward[1], onward[0]) - self.pose.theta)
        arc = self._arc_radius(corner, turn, distance, 0.5 * float(np.hypot(*onward)))
        if arc is None:
            self._add(distance, 0.0)
            return
        self._add(distance - arc * math.tan(0.5 * abs(turn)), 0.0)
        self._add(arc * abs(turn), turn)

    def _arc_radius(
        self, corner: NDArray[np.float64], turn: float, before: float, after: float
    ) -> float | None:
        """Return the widest free arc around a corner [m], or None for a turn on the spot."""
        if not 1e-6 < abs(turn) <= _SHARPEST_ARC_RAD:
            return None
        tangent = math.tan(0.5 * abs(turn))
        radius = min(self.speed / self.turn_rate, before / tangent, after / tangent)
        while radius >= _SMALLEST_ARC_M:
            back = radius * tangent
            c, s = math.cos(self.pose.theta), math.sin(self.pose.theta)
            entry = Pose(corner[0] - back * c, corner[1] - back * s, self.pose.theta)
            if self._is_free(Leg(entry, radius * abs(turn), turn, 1.0)):
                return radius
            radius *= 0.5
        return None

    def _is_free(self, arc: Leg) -> bool:
        pieces = max(2, math.ceil(abs(arc.turn) / 0.15))
        poses = [arc.pose_at(i / pieces) for i in range(pieces + 1)]
        # The margin covers the sagitta between the arc and its chords.
        return all(
            self.world.is_move_free((a.x, a.y), (b.x, b.y), self.radius + _ARC_MARGIN_M)
            for a, b in pairwise(poses)
        )

    def _spin_to(self, heading: float) -> None:
        turn = wrap(heading - self.pose.theta)
        if abs(turn) > 1e-9:
            self._add(0.0, turn)

    def _add(self, length: float, turn: float) -> None:
        if length <= 1e-9 and turn == 0.0:
            return
        duration = max(length / self.speed, abs(turn) / self.turn_rate)
        leg = Leg(self.pose, max(0.0, length), turn, duration)
        self.legs.append(leg)
        self.pose = leg.end


def _distinct(path: NDArray[np.float64]) -> NDArray[np.float64]:
    """Drop corners that repeat the one before."""
    if len(path) == 0:
        raise ValueError("a drive needs a path of at least one point")
    moved = np.hypot(*np.diff(path, axis=0).T) > 1e-6
    distinct: NDArray[np.float64] = path[np.concatenate([[True], moved])]
    return distinct
