"""The fleets of the merge benchmark: robots through a class's floors, with all that goes wrong.

Everything is drawn from the case's seed: lidars, tours, people, closed doors, glass, lost scans,
lidars mounted upside down, declared or not. Clocks never agree.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.scan import Mount
from numpy.typing import NDArray

from lineloom_lab.evaluation.merge_bench_buildings import BuildingClass
from lineloom_lab.simulation import (
    ROBOT_RADIUS_M,
    Fleet,
    Lidar,
    ScanLoss,
    SimulatedRobot,
    SimulatedScan,
    sick_lms200,
)
from lineloom_lab.simulation.building import Building

_DOOR_CLOSED = 0.4
_GLASS = 0.08
_DURATION_S = 75.0


@dataclass(frozen=True, eq=False)
class BenchRobot:
    """One robot, the floor it drives on, and what its operator forgot to say.

    building: the floor with its glass. undeclared: mounted upside down, and nobody said so.
    """

    simulated: SimulatedRobot
    building: Building
    floor: int
    undeclared: bool

    @property
    def name(self) -> str:
        """The robot's name."""
        return self.simulated.name

    @property
    def declared_mount(self) -> Mount:
        """What the mapper is told: which way up the lidar hangs; its poses are the laser's."""
        return Mount(inverted=self.simulated.mount.inverted and not self.undeclared)


@dataclass(frozen=True, eq=False)
class BenchFleet:
    """All robots of one site."""

    robots: tuple[BenchRobot, ...]

    def scans(self) -> Iterator[SimulatedScan]:
        """Yield the scans of all robots in the order of time."""
        return self._simulated.scans()

    def paths(self) -> list[NDArray[np.float64]]:
        """Return each robot's way, as `Fleet.paths` does."""
        return self._simulated.paths()

    @property
    def _simulated(self) -> Fleet:
        return Fleet(self.robots[0].building.world, tuple(r.simulated for r in self.robots))


def bench_fleet(
    kind: BuildingClass, robots: int, seed: int, duration_s: float = _DURATION_S
) -> BenchFleet:
    """Draw a fleet of `robots` that drive for `duration_s` in the class's floors of that seed."""
    rng = np.random.default_rng([seed, robots, 31])
    floors = kind.draw(seed)
    if rng.random() < 0.3:
        floors = [floor.with_glass(_GLASS, rng) for floor in floors]
    on_floor = rng.permutation(np.arange(robots) % len(floors))
    shared = float(rng.choice([0.0, 0.25, 0.45]))
    members: list[BenchRobot] = []
    for number, building in enumerate(floors):
        count = int(np.count_nonzero(on_floor == number))
        if count:
            drawn = _crew(building, count, shared, duration_s, rng)
            members += [BenchRobot(robot, building, number, False) for robot in drawn]
    members = [replace(r, simulated=replace(r.simulated, name=f"robot-{i}", seed=1000 * seed + i))
               for i, r in enumerate(members)]  # fmt: skip
    return BenchFleet(tuple(_mounted(members, rng)))


def _crew(
    building: Building, count: int, shared: float, duration_s: float, rng: np.random.Generator
) -> list[SimulatedRobot]:
    """Robots of one floor on their tours, each with a lidar, losses and closed doors of its own."""
    fleet = Fleet.touring(
        building.world,
        robots=count,
        seed=int(rng.integers(2**31)),
        duration_s=duration_s,
        lidar=sick_lms200(),
        shared=shared,
        speed=float(rng.uniform(0.5, 0.8)),
        people=int(rng.integers(0, 2 + count // 2)),
        see_each_other=bool(rng.random() < 0.5),
    )
    crew = []
    for robot, way in zip(fleet.robots, fleet.paths(), strict=True):
        closed = _not_passed(building.doorways, way) & (
            rng.random(len(building.doorways)) < _DOOR_CLOSED
        )
        crew.append(
            replace(
                robot,
                world=building.with_doors_closed(closed),
                lidar=_lidar(rng),
                loss=ScanLoss(float(rng.uniform(0.02, 0.15)), 3.0) if rng.random() < 0.5 else None,
            )
        )
    return crew


def _mounted(members: list[BenchRobot], rng: np.random.Generator) -> list[BenchRobot]:
    """Mount some lidars upside down; in every fourth larger fleet one of them without a word."""
    forgotten = int(rng.integers(len(members))) if rng.random() < 0.25 else -1
    mounted = []
    for index, robot in enumerate(members):
        undeclared = index == forgotten and len(members) > 2
        turned = Pose(0.1, 0.0, math.pi) if rng.random() < 0.2 else Pose(0.1, 0.0, 0.0)
        mount = Mount(turned, inverted=bool(rng.random() < 0.2) or undeclared)
        mounted.append(
            replace(robot, simulated=replace(robot.simulated, mount=mount), undeclared=undeclared)
        )
    return mounted


def _lidar(rng: np.random.Generator) -> Lidar:
    """Draw one of three: SICK LMS200, a cheap full-turn scanner, a Hokuyo of 270 degrees."""
    kind = int(rng.integers(3))
    if kind == 0:
        return sick_lms200()
    if kind == 1:
        return Lidar(
            -math.pi, math.tau / 360, 360, range_min=0.12, range_max=12.0, range_sigma=0.012,
            range_clip=0.03, angle_sigma=math.radians(0.1), dropout=0.01, rate_hz=5.0,
        )  # fmt: skip
    return Lidar(
        -0.75 * math.pi, math.radians(1.0), 271, range_min=0.06, range_max=30.0, range_sigma=0.01,
        range_clip=0.03, dropout=0.002, rate_hz=5.0,
    )  # fmt: skip


def _not_passed(doorways: NDArray[np.float64], way: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which doors the robot never comes near to: they may be closed for it."""
    middle = 0.5 * (doorways[:, :2] + doorways[:, 2:])
    half = 0.5 * np.hypot(*(doorways[:, 2:] - doorways[:, :2]).T) + ROBOT_RADIUS_M + 0.3
    gaps = np.hypot(*(middle[:, None, :] - way[None, :, :]).transpose(2, 0, 1))
    apart: NDArray[np.bool_] = gaps.min(axis=1) > half
    return apart
