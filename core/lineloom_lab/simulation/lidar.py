"""A 2D lidar with its noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.simulation.world import World

_SWEEP_PARTS = 40


@dataclass(frozen=True, slots=True)
class Lidar:
    """A sweep of `beams` directions and what is wrong with its measurements.

    angle_min, angle_increment: as in `Scan` [rad]. range_min, range_max: [m]. range_sigma: standard
    deviation of the range noise [m], redrawn beyond +-range_clip [m]. angle_sigma: standard
    deviation of each beam's true direction about its nominal one [rad]. dropout: probability that
    a beam returns nothing. rate_hz: sweeps per second. time_increment: from beam to beam [s], 0 =
    all at once. Raises ValueError for impossible values.
    """

    angle_min: float
    angle_increment: float
    beams: int
    range_min: float = 0.05
    range_max: float = 30.0
    range_sigma: float = 0.01
    range_clip: float = math.inf
    angle_sigma: float = 0.0
    dropout: float = 0.0
    rate_hz: float = 5.0
    time_increment: float = 0.0

    def __post_init__(self) -> None:
        if self.beams < 1 or self.angle_increment == 0.0:
            raise ValueError("a lidar needs at least one beam and an angle_increment other than 0")
        if not 0.0 <= self.range_min < self.range_max:
            raise ValueError("0 <= range_min < range_max must hold")
        if self.range_sigma < 0.0 or self.angle_sigma < 0.0 or self.range_clip <= 0.0:
            raise ValueError("noise must not be negative and range_clip must be positive")
        if not 0.0 <= self.dropout <= 1.0 or self.rate_hz <= 0.0:
            raise ValueError("dropout must lie in [0, 1] and rate_hz must be positive")
        if not 0.0 <= self.time_increment * self.beams <= 1.0 / self.rate_hz + 1e-9:
            raise ValueError("a sweep's beams must fit into the time of a sweep")

    @property
    def angles(self) -> NDArray[np.float64]:
        """Nominal directions of the beams in the laser frame [rad], shape (beams,)."""
        return self.angle_min + self.angle_increment * np.arange(self.beams, dtype=np.float64)

    def exact_ranges(
        self,
        world: World,
        pose: Pose,
        *,
        inverted: bool = False,
        disks: NDArray[np.float64] | None = None,
        angle_errors: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return noise-free ranges [m], shape (beams,), +inf beyond range_max.

        pose: T_world_laser. inverted: mounted upside down, so that angles run clockwise. disks:
        round things that block beams, shape (k, 3), rows x, y, radius [m] in the world frame.
        angle_errors: shape (beams,), added to the nominal directions [rad].
        """
        angles = self.angles if angle_errors is None else self.angles + angle_errors
        directions = pose.theta + (-angles if inverted else angles)
        ranges = world.cast(pose.x, pose.y, directions, self.range_max)
        if disks is not None and len(disks):
            ranges = np.minimum(ranges, _cast_at_disks(pose, directions, disks))
        ranges[ranges >= self.range_max] = np.inf
        return ranges

    def scan(
        self,
        world: World,
        pose: Pose,
        rng: np.random.Generator,
        *,
        stamp: float = 0.0,
        seq: int = 0,
        session: str = "0",
        odometry: Pose | None = None,
        inverted: bool = False,
        disks: NDArray[np.float64] | None = None,
        pose_after: Callable[[float], Pose] | None = None,
    ) -> Scan:
        """Measure one sweep from T_world_laser = `pose`; see `exact_ranges` for the rest.

        pose_after: T_world_laser so many seconds into the sweep. Given that and a `time_increment`,
        a moving robot skews its scan; else the sweep is instantaneous.
        """
        errors = self.angle_sigma * rng.standard_normal(self.beams) if self.angle_sigma else None
        ranges = self.exact_ranges(world, pose, inverted=inverted, disks=disks, angle_errors=errors)
        if pose_after is not None and self.time_increment:
            for part in np.array_split(np.arange(self.beams), _SWEEP_PARTS)[1:]:
                there = pose_after(float(part.mean()) * self.time_increment)
                ranges[part] = self.exact_ranges(
                    world, there, inverted=inverted, disks=disks, angle_errors=errors
                )[part]
        hit = np.isfinite(ranges)
        noise = _clipped_noise(rng, self.beams, self.range_sigma, self.range_clip)
        ranges[hit] = np.maximum(ranges[hit] + noise[hit], 0.0)
        if self.dropout:
            ranges[rng.random(self.beams) < self.dropout] = np.inf
        return Scan.checked(
            ranges,
            angle_min=self.angle_min,
            angle_increment=self.angle_increment,
            range_min=self.range_min,
            range_max=self.range_max,
            stamp=stamp,
            seq=seq,
            session=session,
            time_increment=self.time_increment,
            scan_time=1.0 / self.rate_hz,
            odometry=odometry,
        )


def sick_lms200() -> Lidar:
    """Return a SICK LMS200 as the thesis simulates it (§6.1): 180 degrees, 181 beams, 5 Hz.

    Range error sigma 1.25 cm within +-2.5 cm, angular error 0.1 degrees.
    """
    return Lidar(
        angle_min=-math.pi / 2,
        angle_increment=math.radians(1.0),
        beams=181,
        range_min=0.05,
        range_max=30.0,
        range_sigma=0.0125,
        range_clip=0.025,
        angle_sigma=math.radians(0.1),
        rate_hz=5.0,
    )


def scanner_360() -> Lidar:
    """Return a modern full-turn scanner: 1080 beams, 30 m, sigma 1 cm, 10 Hz."""
    return Lidar(
        angle_min=-math.pi,
        angle_increment=math.tau / 1080,
        beams=1080,
        range_min=0.05,
        range_max=30.0,
        range_sigma=0.01,
        range_clip=0.03,
        rate_hz=10.0,
    )


def _clipped_noise(
    rng: np.random.Generator, count: int, sigma: float, clip: float
) -> NDArray[np.float64]:
    """Draw normal noise [m], redrawing what falls outside +-clip (no heap of values at the clip).

    A clip far inside one sigma would redraw forever: after 100 rounds the rest is drawn uniformly,
    which is what the truncated normal tends to there.
    """
    noise = sigma * rng.standard_normal(count)
    for _ in range(100):
        outside = np.abs(noise) > clip
        if not outside.any():
            return noise
        noise[outside] = sigma * rng.standard_normal(int(outside.sum()))
    outside = np.abs(noise) > clip
    noise[outside] = rng.uniform(-clip, clip, int(outside.sum()))
    return noise


def _cast_at_disks(
    pose: Pose, directions: NDArray[np.float64], disks: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the distance [m] to the nearest disk along each direction, +inf where there is none.

    A disk around the laser itself hides everything: range 0.
    """
    to_centre = disks[:, :2] - np.array([pose.x, pose.y])
    along = np.outer(np.cos(directions), to_centre[:, 0]) + np.outer(
        np.sin(directions), to_centre[:, 1]
    )
    square = np.sum(to_centre**2, axis=1)
    half_chord_square = disks[:, 2] ** 2 - (square - along**2)
    with np.errstate(invalid="ignore"):
        first = along - np.sqrt(half_chord_square)
    first[~(half_chord_square >= 0.0) | (along < 0.0)] = np.inf
    first[:, square <= disks[:, 2] ** 2] = 0.0
    nearest: NDArray[np.float64] = first.min(axis=1)
    return nearest
