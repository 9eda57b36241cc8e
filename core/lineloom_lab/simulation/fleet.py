"""Several robots in one world, who know nothing of each other."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from lineloom_core.geometry import Pose
from numpy.typing import NDArray

from lineloom_lab.simulation.drive import Drive
from lineloom_lab.simulation.faults import Walkers
from lineloom_lab.simulation.free_space import FreeSpace
from lineloom_lab.simulation.lidar import Lidar, scanner_360
from lineloom_lab.simulation.odometry import DriftingOdometry
from lineloom_lab.simulation.office import office_floor
from lineloom_lab.simulation.planner import Planner
from lineloom_lab.simulation.robot import ROBOT_RADIUS_M, SimulatedRobot, SimulatedScan
from lineloom_lab.simulation.tour import plan_tours
from lineloom_lab.simulation.world import World

_EPOCH_S = 1_700_000_000.0
_CLOCK_SPREAD_S = 30.0 * 86_400.0
PATH_STEP_M = 0.25
"""Between two points of `Fleet.paths`."""


@dataclass(frozen=True, eq=False)
class Fleet:
    """Robots in one world. Start poses and clocks are known to nobody but the simulation."""

    world: World
    robots: tuple[SimulatedRobot, ...]

    @staticmethod
    def touring(
        world: World,
        *,
        robots: int = 3,
        seed: int = 0,
        duration_s: float = 240.0,
        lidar: Lidar | None = None,
        starts: Sequence[Pose] | None = None,
        shared: float = 0.35,
        speed: float = 0.5,
        turn_rate: float = 1.0,
        odometry: DriftingOdometry | None = None,
        people: int = 0,
        see_each_other: bool = False,
    ) -> Fleet:
        """Send robots through a world: each through its own part and along a common way.

        starts: T_world_base of each robot, spread at random if None. shared: share of the driving
        spent on the way common to all. people: how many walk about. see_each_other: robots block
        beams. Raises ValueError for a start out of reach or a wrong number of starts.
        """
        rng = np.random.default_rng([seed, 3])
        planner = Planner(FreeSpace.of(world, ROBOT_RADIUS_M))
        tours = plan_tours(
            planner, robots, rng, budget_m=speed * duration_s, shared=shared, starts=starts
        )
        drives = [
            Drive.along(
                planner.route(stops),
                world,
                radius=ROBOT_RADIUS_M,
                speed=speed,
                turn_rate=turn_rate,
                heading=heading,
            )
            for heading, stops in tours
        ]
        members = _crew(world, drives, lidar or scanner_360(), rng, seed, duration_s, odometry)
        crowd = (Walkers.strolling(planner, people, rng),) if people else ()
        return Fleet(world, tuple(_among(members, crowd, see_each_other=see_each_other)))

    @staticmethod
    def office(
        seed: int = 0, robots: int = 3, duration_s: float = 240.0, lidar: Lidar | None = None
    ) -> Fleet:
        """Return the demo's fleet: robots with unknown starts on `office_floor(seed)`."""
        return Fleet.touring(
            office_floor(seed), robots=robots, seed=seed, duration_s=duration_s, lidar=lidar
        )

    def scans(self) -> Iterator[SimulatedScan]:
        """Yield the scans of all robots in the order of simulation time, then of robots."""
        streams = [
            ((s.time_s, index, s) for s in robot.scans()) for index, robot in enumerate(self.robots)
        ]
        for _, _, simulated in heapq.merge(*streams, key=lambda row: row[:2]):
            yield simulated

    def paths(self) -> list[NDArray[np.float64]]:
        """Return each robot's way, one point every `PATH_STEP_M`, shape (n, 2) [m, world frame]."""
        return [_way(robot) for robot in self.robots]

    def overlap_m(self, within_m: float = 1.5) -> NDArray[np.float64]:
        """Return how much of robot i's way lies within `within_m` of robot j's, shape (n, n) [m].

        Distances are straight, through walls; keep `within_m` small. The diagonal holds the length
        of each robot's way. Ground covered twice counts once: points are thinned to 0.25 m.
        """
        ways = [_thinned(way) for way in self.paths()]
        table = np.zeros((len(ways), len(ways)))
        for i, a in enumerate(ways):
            for j, b in enumerate(ways):
                gaps = np.min(np.hypot(*(a[:, None, :] - b[None, :, :]).transpose(2, 0, 1)), axis=1)
                table[i, j] = PATH_STEP_M * float(np.count_nonzero(gaps <= within_m))
        return table


def _crew(
    world: World,
    drives: Sequence[Drive],
    lidar: Lidar,
    rng: np.random.Generator,
    seed: int,
    duration_s: float,
    odometry: DriftingOdometry | None,
) -> list[SimulatedRobot]:
    """Put a robot on each drive, with a clock of its own and scans out of step with the others."""
    return [
        SimulatedRobot(
            name=f"robot-{index + 1}",
            world=world,
            lidar=lidar,
            drive=drive,
            seed=1000 * seed + index,
            odometry=odometry,
            clock_offset_s=_EPOCH_S + float(rng.uniform(-_CLOCK_SPREAD_S, _CLOCK_SPREAD_S)),
            phase_s=float(rng.uniform(0.0, 1.0 / lidar.rate_hz)),
            duration_s=duration_s,
        )
        for index, drive in enumerate(drives)
    ]


def _among(
    members: Sequence[SimulatedRobot], crowd: tuple[Walkers, ...], *, see_each_other: bool
) -> list[SimulatedRobot]:
    """Put people, and if asked the other robots, into every robot's beams."""
    placed = []
    for own in members:
        others = tuple(m.drive for m in members if m is not own and see_each_other)
        bodies = (Walkers(others, ROBOT_RADIUS_M),) if others else ()
        placed.append(replace(own, blockers=(*crowd, *bodies)))
    return placed


def _way(robot: SimulatedRobot) -> NDArray[np.float64]:
    end = robot.drive.duration_s if robot.duration_s is None else robot.duration_s
    fine = robot.drive.positions(np.arange(0.0, end + 1e-9, 0.05))
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(fine, axis=0).T))])
    marks = np.searchsorted(travelled, np.arange(0.0, travelled[-1] + 1e-9, PATH_STEP_M))
    return fine[np.minimum(marks, len(fine) - 1)]


def _thinned(way: NDArray[np.float64]) -> NDArray[np.float64]:
    cells = np.floor(way / PATH_STEP_M).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    return way[np.sort(first)]
