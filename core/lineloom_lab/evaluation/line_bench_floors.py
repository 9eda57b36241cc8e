"""The simulated floors of the benchmark of lines: buildings, lidars, people, fleets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.evaluation.log_bench_ladders import Conditions
from lineloom_lab.evaluation.log_bench_log import BenchLog, Half, Recording
from lineloom_lab.simulation import Fleet, Lidar, World, corridors, office_floor, rooms
from lineloom_lab.simulation.odometry import DriftingOdometry

_BUILDINGS = {"office": office_floor, "flat": rooms, "corridors": corridors}

_RATE_HZ = 5.0

LIDARS: dict[str, Conditions] = {
    "plain": Conditions(rate_hz=_RATE_HZ),
    "sick": Conditions(beams=181, view_deg=180.0, noise_mm=12.5, rate_hz=_RATE_HZ),
    "dense": Conditions(beams=1080, view_deg=360.0, range_m=30.0, rate_hz=_RATE_HZ),
    "sparse": Conditions(beams=120, view_deg=360.0, range_m=12.0, noise_mm=15.0, rate_hz=_RATE_HZ),
    "noisy": Conditions(noise_mm=30.0, view_deg=360.0, rate_hz=_RATE_HZ),
    "short": Conditions(beams=682, view_deg=240.0, range_m=5.6, rate_hz=_RATE_HZ),
    "crowd": Conditions(people=4, rate_hz=_RATE_HZ),
}
"""Lidars, and whether people are about, by the name of the case."""


@dataclass(frozen=True, slots=True)
class Floor:
    """A robot, or several, touring one simulated building; `load` is a `LogSource`'s.

    kind: one of `LIDARS`. Even seeds are half A: parameters may be chosen with them.
    """

    kind: str
    building: str
    seed: int
    robots: int = 1
    duration_s: float = 120.0

    @property
    def name(self) -> str:
        """The lidar, the building, the seed."""
        fleet = f", {self.robots} robots" if self.robots > 1 else ""
        return f"{self.kind}, {self.building} {self.seed}{fleet}"

    @property
    def half(self) -> Half:
        """Even seeds A, odd ones B."""
        return "B" if self.seed % 2 else "A"

    @property
    def world(self) -> World:
        """The building."""
        return _BUILDINGS[self.building](self.seed)

    @property
    def lidar(self) -> Lidar:
        """The lidar of every robot."""
        return LIDARS[self.kind].lidar()

    def load(self) -> BenchLog:
        """Simulate it."""
        fleet = Fleet.touring(
            self.world,
            robots=self.robots,
            seed=self.seed,
            duration_s=self.duration_s,
            lidar=self.lidar,
            shared=0.35 if self.robots > 1 else 0.0,
            people=LIDARS[self.kind].people,
            odometry=DriftingOdometry(),
        )
        scans: dict[str, list[Scan]] = {}
        poses: dict[str, list[NDArray[np.float64]]] = {}
        for seen in fleet.scans():
            scans.setdefault(seen.robot, []).append(seen.scan)
            poses.setdefault(seen.robot, []).append(seen.true_pose.to_array())
        recordings = (Recording(name, tuple(scans[name]), np.array(poses[name])) for name in scans)
        return BenchLog(tuple(recordings), "reference")


def floors(*, quick: bool) -> list[Floor]:
    """Return the cases: every lidar through a building of both halves, fleets, people.

    quick: three of them, and shorter ones.
    """
    if quick:
        return [Floor(kind, "office", 0, duration_s=60.0) for kind in ("plain", "sick", "sparse")]
    kinds = list(_BUILDINGS)
    alone = [
        Floor(lidar, kinds[(number + seed) % len(kinds)], seed)
        for number, lidar in enumerate(LIDARS)
        for seed in range(2)
    ]
    return alone + [Floor("plain", "office", seed, robots=3) for seed in (2, 3)]
