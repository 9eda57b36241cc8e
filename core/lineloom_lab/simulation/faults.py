"""What goes wrong in real buildings: people in the way, lost scans, glass. All optional."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lineloom_lab.simulation.drive import Drive
from lineloom_lab.simulation.planner import Planner
from lineloom_lab.simulation.world import World


class Blockers(Protocol):
    """Moving round things that stop beams."""

    def disks(self, time_s: float) -> NDArray[np.float64]:
        """Return where they are at a global time [s]: shape (k, 3), rows x, y, radius [m]."""
        ...


@dataclass(frozen=True, eq=False)
class Walkers:
    """People (or robots) as disks of `radius` [m], each on a drive of its own.

    A drive that is over starts again from its end backwards, so that nobody ever stands still.
    """

    drives: tuple[Drive, ...]
    radius: float = 0.2

    @staticmethod
    def strolling(
        planner: Planner, count: int, rng: np.random.Generator, *, speed: float = 1.0
    ) -> Walkers:
        """Send `count` people through five random places each, at `speed` [m/s]."""
        space, drives = planner.space, []
        for _ in range(count):
            path = planner.route([space.random_point(rng) for _ in range(5)])
            drives.append(
                Drive.along(path, space.world, radius=space.radius, speed=speed, turn_rate=2.0)
            )
        return Walkers(tuple(drives))

    def disks(self, time_s: float) -> NDArray[np.float64]:
        """Return where they are at a global time [s]: shape (k, 3), rows x, y, radius [m]."""
        rows = []
        for drive in self.drives:
            span = max(drive.duration_s, 1e-9)
            phase = time_s % (2.0 * span)
            pose = drive.pose_at(phase if phase <= span else 2.0 * span - phase)
            rows.append((pose.x, pose.y, self.radius))
        return np.array(rows, dtype=np.float64).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class Followers:
    """People who walk behind somebody, one behind the other. drive: whom they follow.

    behind_s: how much later each is where the one before was; at the start all wait there.
    """

    drive: Drive
    count: int
    behind_s: float = 2.0
    radius: float = 0.2

    def disks(self, time_s: float) -> NDArray[np.float64]:
        """Return where they are at a global time [s]: shape (k, 3), rows x, y, radius [m]."""
        where = self.drive.positions([time_s - self.behind_s * k for k in range(1, self.count + 1)])
        return np.column_stack([where, np.full(self.count, self.radius)])


def disks_in_view(
    blockers: Sequence[Blockers], time_s: float, x: float, y: float, margin: float
) -> NDArray[np.float64]:
    """Collect all disks [m], shape (k, 3), but for those that would touch the robot at (x, y).

    People step aside: nobody stands closer to the laser than `margin` [m].
    """
    if not blockers:
        return np.empty((0, 3))
    disks = np.vstack([b.disks(time_s) for b in blockers])
    apart = np.hypot(disks[:, 0] - x, disks[:, 1] - y) > disks[:, 2] + margin
    return disks[apart]


@dataclass(frozen=True, slots=True)
class ScanLoss:
    """Scans that never arrive, alone or in bursts.

    share: of all scans, on average. burst: mean length of a row of lost scans, at least 1. Raises
    ValueError for values outside.
    """

    share: float
    burst: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.share < 1.0 or self.burst < 1.0:
            raise ValueError("share must lie in [0, 1) and burst must be at least 1")
        if self.share > self.burst / (1.0 + self.burst):
            raise ValueError("bursts this short cannot lose that share: make burst longer")

    def lost(self, rng: np.random.Generator) -> Iterator[bool]:
        """Yield for every scan whether it is lost (a two-state Markov chain)."""
        ends = 1.0 / self.burst
        begins = ends * self.share / (1.0 - self.share)
        losing = False
        while True:
            losing = rng.random() >= ends if losing else rng.random() < begins
            yield losing


def glazed(world: World, share: float, rng: np.random.Generator, min_length: float = 1.0) -> World:
    """Return the world with a share of its long walls turned into glass.

    Beams pass through glass, robots do not. Both faces of a thick wall turn at once: with each
    chosen wall go those that run parallel within 0.3 m of its middle. min_length: [m].
    """
    a, b = world.walls[:, :2], world.walls[:, 2:]
    lengths = np.hypot(*(b - a).T)
    candidates = np.flatnonzero(lengths >= min_length)
    chosen = candidates[rng.random(len(candidates)) < share]
    glass = np.zeros(len(world.walls), dtype=bool)
    directions = (b - a) / np.maximum(lengths, 1e-9)[:, None]
    for i in chosen:
        offset = 0.5 * (a[i] + b[i]) - a
        along = np.sum(offset * directions, axis=1)
        across = np.abs(offset[:, 0] * directions[:, 1] - offset[:, 1] * directions[:, 0])
        parallel = np.abs(directions @ directions[i]) > 0.9998
        glass |= parallel & (across < 0.3) & (along > -1e-6) & (along < lengths + 1e-6)
    panes = np.vstack([world.glass, world.walls[glass]])
    return replace(world, walls=world.walls[~glass], glass=panes)
