"""Simulated logs as ladders: one property of lidar, drive or building at a time, rung by rung.

All else is `_BASE`: 270 degrees, 360 beams and 25 m at 10 Hz, and nobody about. A rung is
run once per seed, in turn through offices, flats and corridors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lineloom_lab.evaluation.log_bench_log import BenchLog, Half, Recording
from lineloom_lab.simulation import (
    ROBOT_RADIUS_M,
    Blockers,
    DriftingOdometry,
    Followers,
    FreeSpace,
    Lidar,
    Planner,
    SimulatedRobot,
    Walkers,
    World,
    corridors,
    office_floor,
    rooms,
)

_BUILDINGS = {"office": office_floor, "flat": rooms, "corridors": corridors}
_DURATION_S = 90.0
_SPEED_MPS = 0.6


@dataclass(frozen=True, slots=True)
class Conditions:
    """What a ladder varies.

    beams: in a sweep. view_deg: field of view. range_m: the lidar's reach. noise_mm: standard
    deviation of ranges. rate_hz: sweeps a second. turn_rate: the fastest turn [rad/s]. people: who
    walk about; followers: who walk behind the robot. swept: share of its period that a sweep takes,
    so that motion skews it. told: whether scans say so by their `time_increment`.
    """

    beams: int = 360
    view_deg: float = 270.0
    range_m: float = 25.0
    noise_mm: float = 10.0
    rate_hz: float = 10.0
    turn_rate: float = 1.0
    people: int = 0
    followers: int = 0
    swept: float = 0.0
    told: bool = True

    def lidar(self) -> Lidar:
        """Return a lidar that looks ahead, its beams evenly over its view; a full turn has no
        beam twice."""
        view = math.radians(self.view_deg)
        full = self.view_deg >= 360.0
        return Lidar(
            angle_min=-0.5 * view,
            angle_increment=view / (self.beams if full else self.beams - 1),
            beams=self.beams,
            range_max=self.range_m,
            range_sigma=1e-3 * self.noise_mm,
            range_clip=3e-3 * self.noise_mm,
            rate_hz=self.rate_hz,
            time_increment=self.swept / (self.rate_hz * self.beams),
        )


_BASE = Conditions()


@dataclass(frozen=True, slots=True)
class Rung:
    """One value of one ladder."""

    ladder: str
    value: float
    conditions: Conditions

    @property
    def name(self) -> str:
        """In words."""
        return f"{self.ladder} {self.value:g}"


@dataclass(frozen=True, slots=True)
class SimulatedLog:
    """A rung's log of one seed: a robot wandering through one building. Its truth is exact."""

    rung: Rung
    seed: int
    duration_s: float = _DURATION_S

    @property
    def name(self) -> str:
        """The rung, the building and the seed."""
        return f"{self.rung.name}, {self.building} {self.seed}"

    @property
    def half(self) -> Half:
        """Simulated buildings are in neither."""
        return ""

    @property
    def building(self) -> str:
        """Its kind; seeds take turns."""
        return list(_BUILDINGS)[self.seed % len(_BUILDINGS)]

    def load(self) -> BenchLog:
        """Simulate it; the same seed gives the same building, stops and people on every rung."""
        conditions = self.rung.conditions
        world = _BUILDINGS[self.building](self.seed)
        robot = _robot(world, conditions, self.seed, self.duration_s)
        seen = list(robot.scans())
        scans = tuple(
            s.scan if conditions.told else replace(s.scan, time_increment=0.0) for s in seen
        )
        return BenchLog(
            (Recording("robot", scans, np.array([s.true_pose.to_array() for s in seen])),),
            "reference",
        )


def ladder_rungs() -> list[Rung]:
    """Return all rungs, ladder by ladder, from easy to hard or back."""
    swept, untold = replace(_BASE, swept=0.75), replace(_BASE, swept=0.75, told=False)
    ladders: tuple[tuple[str, str, Sequence[Any], Conditions], ...] = (
        ("beams", "beams", (45, 90, 180, 360, 720, 1080), _BASE),
        ("view, degrees", "view_deg", (57, 90, 120, 180, 270, 360), _BASE),
        ("range, m", "range_m", (4, 8, 12, 25, 80), _BASE),
        ("noise, mm", "noise_mm", (5, 10, 20, 30, 50), _BASE),
        ("rate, Hz", "rate_hz", (1, 2, 5, 10, 20, 40), _BASE),
        ("turn, rad/s", "turn_rate", (0.5, 1, 2, 3), swept),
        ("turn untold, rad/s", "turn_rate", (0.5, 1, 2, 3), untold),
        ("people", "people", (0, 2, 4, 8), _BASE),
        ("followers", "followers", (1, 2, 4), replace(_BASE, view_deg=360.0)),
    )
    return [
        Rung(name, float(value), replace(base, **{what: value}))
        for name, what, values, base in ladders
        for value in values
    ]


def _robot(world: World, conditions: Conditions, seed: int, duration_s: float) -> SimulatedRobot:
    planner = Planner(FreeSpace.of(world, ROBOT_RADIUS_M))
    robot = SimulatedRobot.wandering(
        "robot",
        world,
        lidar=conditions.lidar(),
        seed=seed,
        duration_s=duration_s,
        planner=planner,
        speed=_SPEED_MPS,
        turn_rate=conditions.turn_rate,
        odometry=DriftingOdometry(),
    )
    blockers: list[Blockers] = []
    if conditions.people:
        rng = np.random.default_rng([seed, 14])
        blockers.append(Walkers.strolling(planner, conditions.people, rng))
    if conditions.followers:
        blockers.append(Followers(robot.drive, conditions.followers))
    return replace(robot, blockers=tuple(blockers))
