"""A robot that drives through a world and scans it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import repeat

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.scan import Mount, Scan
from numpy.typing import ArrayLike

from lineloom_lab.simulation.drive import Drive
from lineloom_lab.simulation.faults import Blockers, ScanLoss, disks_in_view
from lineloom_lab.simulation.free_space import FreeSpace
from lineloom_lab.simulation.lidar import Lidar
from lineloom_lab.simulation.odometry import DriftingOdometry
from lineloom_lab.simulation.planner import Planner
from lineloom_lab.simulation.world import World

ROBOT_RADIUS_M = 0.25


@dataclass(frozen=True, slots=True)
class SimulatedScan:
    """A scan as the robot sends it, and what the robot does not know.

    true_pose: T_world_laser at the time of the scan. time_s: of the simulation, one for all robots.
    """

    robot: str
    scan: Scan
    true_pose: Pose
    time_s: float


@dataclass(frozen=True, eq=False)
class SimulatedRobot:
    """One robot: its way, its sensors and its clock. The same seed yields the same scans.

    drive: T_world_base over time. clock_offset_s: the robot's own clock reads simulation time plus
    this. phase_s: time of its first scan. duration_s: it stops scanning then; None = at the end of
    its drive. odometry: None = the scans carry none. blockers: things that move in the beams' way.
    """

    name: str
    world: World
    lidar: Lidar
    drive: Drive
    seed: int = 0
    mount: Mount = field(default_factory=Mount)
    odometry: DriftingOdometry | None = None
    clock_offset_s: float = 0.0
    phase_s: float = 0.0
    duration_s: float | None = None
    session: str = "0"
    blockers: tuple[Blockers, ...] = ()
    loss: ScanLoss | None = None

    @staticmethod
    def through(
        name: str,
        world: World,
        stops: ArrayLike,
        *,
        lidar: Lidar,
        seed: int = 0,
        planner: Planner | None = None,
        heading: float | None = None,
        speed: float = 0.5,
        turn_rate: float = 1.0,
        duration_s: float | None = None,
        odometry: DriftingOdometry | None = None,
    ) -> SimulatedRobot:
        """Send a robot through given stops, shape (n, 2) [m], on collision-free ways.

        planner: for this world, built here if None. Raises ValueError for a stop out of reach.
        """
        planner = planner or Planner(FreeSpace.of(world, ROBOT_RADIUS_M))
        drive = Drive.along(
            planner.route(stops),
            world,
            radius=planner.space.radius,
            speed=speed,
            turn_rate=turn_rate,
            heading=heading,
        )
        return SimulatedRobot(
            name, world, lidar, drive, seed, odometry=odometry, duration_s=duration_s
        )

    @staticmethod
    def wandering(
        name: str,
        world: World,
        *,
        lidar: Lidar,
        seed: int = 0,
        duration_s: float = 60.0,
        start: Pose | None = None,
        planner: Planner | None = None,
        speed: float = 0.5,
        turn_rate: float = 1.0,
        odometry: DriftingOdometry | None = None,
    ) -> SimulatedRobot:
        """Send a robot from one random place to the next for `duration_s` seconds.

        start: T_world_base, random if None.
        """
        planner = planner or Planner(FreeSpace.of(world, ROBOT_RADIUS_M))
        rng = np.random.default_rng([seed, 1])
        first = start or planner.space.random_pose(rng)
        stops, length = [(first.x, first.y)], 0.0
        while length < speed * duration_s:
            stops.append(planner.space.random_point(rng))
            length += math.dist(stops[-2], stops[-1])  # the way is never shorter than this
        return SimulatedRobot.through(
            name,
            world,
            stops,
            lidar=lidar,
            seed=seed,
            planner=planner,
            heading=first.theta,
            speed=speed,
            turn_rate=turn_rate,
            duration_s=duration_s,
            odometry=odometry,
        )

    @property
    def scan_times_s(self) -> list[float]:
        """Times of all scans, lost ones included, in simulation time [s]."""
        end = self.drive.duration_s if self.duration_s is None else self.duration_s
        period = 1.0 / self.lidar.rate_hz
        count = max(0, math.floor((end - self.phase_s) / period + 1e-9) + 1)
        return [self.phase_s + i * period for i in range(count)]

    def scans(self) -> Iterator[SimulatedScan]:
        """Yield all scans in order. `seq` counts from 0; a lost scan leaves a gap in it."""
        # Each part draws from its own stream: switching one on leaves the others as they were.
        noise, drift, chance = np.random.default_rng([self.seed, 2]).spawn(3)
        times = self.scan_times_s
        bases = [self.drive.pose_at(t) for t in times]
        odometry: Iterator[Pose | None] = (
            repeat(None) if self.odometry is None else self.odometry.measure(bases, drift)
        )
        lost = repeat(False) if self.loss is None else self.loss.lost(chance)
        rows = zip(times, bases, odometry, lost, strict=False)  # the last two may never end
        for seq, (time_s, base, believed, is_lost) in enumerate(rows):
            simulated = self._scan_at(time_s, base, noise, seq, believed)
            if not is_lost:
                yield simulated

    def _scan_at(
        self, time_s: float, base: Pose, rng: np.random.Generator, seq: int, believed: Pose | None
    ) -> SimulatedScan:
        laser = base @ self.mount.T_base_laser
        scan = self.lidar.scan(
            self.world,
            laser,
            rng,
            stamp=self.clock_offset_s + time_s,
            seq=seq,
            session=self.session,
            odometry=believed,
            inverted=self.mount.inverted,
            disks=disks_in_view(self.blockers, time_s, laser.x, laser.y, ROBOT_RADIUS_M),
            pose_after=lambda s: self.drive.pose_at(time_s + s) @ self.mount.T_base_laser,
        )
        return SimulatedScan(self.name, scan, laser, time_s)
