"""A log's steps: how each scan lies to the one before, held against the reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_lab.evaluation.log_bench_judge import PlacedRobot, relation_error

STEP_M, STEP_RAD = 0.3, math.radians(5.0)
"""A step is right where it is no further off."""


@dataclass(frozen=True, slots=True)
class StepFigures:
    """steps: from one scan to the next in one component, both with a reference. right: of these.

    breaks: steps that the map does not make: into another component, or from or to no place at all.
    """

    steps: int
    right: int
    breaks: int

    @property
    def wrong(self) -> int:
        """Steps that are not right."""
        return self.steps - self.right

    @property
    def share_right(self) -> float | None:
        """Of all steps; None where there is none."""
        return self.right / self.steps if self.steps else None


@dataclass(frozen=True, slots=True)
class BadStep:
    """From scan `index` of a robot to the next: believed wrongly, or a break.

    off_m, off_rad: of the believed step; both None for a break.
    """

    robot: int
    index: int
    off_m: float | None
    off_rad: float | None


def step_figures(robots: Sequence[PlacedRobot]) -> StepFigures:
    """Count the steps of all robots."""
    steps = right = breaks = 0
    for robot in robots:
        own = _Steps.of(robot)
        steps += int(np.count_nonzero(own.judged))
        right += int(np.count_nonzero(own.judged & (own.excess <= 1.0)))
        breaks += int(np.count_nonzero(~own.tied))
    return StepFigures(steps, right, breaks)


def wrong_steps(robots: Sequence[PlacedRobot]) -> list[BadStep]:
    """Return the steps that are not right, furthest off first in units of what is right."""
    wrong: list[tuple[float, BadStep]] = []
    for number, robot in enumerate(robots):
        own = _Steps.of(robot)
        excess = own.excess
        for i in np.flatnonzero(own.judged & (excess > 1.0)).tolist():
            step = BadStep(number, i, float(own.off_m[i]), float(own.off_rad[i]))
            wrong.append((float(excess[i]), step))
    return [step for _, step in sorted(wrong, key=lambda row: -row[0])]


def broken_steps(robots: Sequence[PlacedRobot]) -> list[BadStep]:
    """Return the breaks at which there is a reference to show what was missed, as they come."""
    return [
        BadStep(number, i, None, None)
        for number, robot in enumerate(robots)
        for i in np.flatnonzero(_Steps.of(robot).shown).tolist()
    ]


@dataclass(frozen=True, eq=False)
class _Steps:
    """A robot's steps, each array (n - 1,).

    tied: in one component. judged: and with a reference at both ends. off_m, off_rad: NaN where
    they are not. shown: a break with a reference.
    """

    tied: NDArray[np.bool_]
    judged: NDArray[np.bool_]
    shown: NDArray[np.bool_]
    off_m: NDArray[np.float64]
    off_rad: NDArray[np.float64]

    @staticmethod
    def of(robot: PlacedRobot) -> _Steps:
        """Compare each scan with the one before it."""
        same: NDArray[np.bool_] = np.asarray(robot.component[:-1] == robot.component[1:])
        tied = robot.placed[:-1] & robot.placed[1:] & same
        known = robot.known[:-1] & robot.known[1:]
        off = relation_error(
            robot.poses[:-1], robot.poses[1:], robot.reference[:-1], robot.reference[1:]
        )
        off_m, off_rad = np.hypot(off[:, 0], off[:, 1]), np.abs(off[:, 2])
        return _Steps(tied, tied & known, known & ~tied, off_m, off_rad)

    @property
    def excess(self) -> NDArray[np.float64]:
        """How far off each is, in units of what is right; more than 1 is wrong."""
        return np.maximum(self.off_m / STEP_M, self.off_rad / STEP_RAD)
