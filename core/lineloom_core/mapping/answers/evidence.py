"""What the mapper answers to questions about its map; plain data, so that anyone can read it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lineloom_core.check import Limit
from lineloom_core.codec import storable
from lineloom_core.geometry import Pose

Action = Literal["retract", "restore"]


@storable("robot-move")
@dataclass(frozen=True, slots=True)
class RobotMove:
    """A robot's latest pose before and after.

    moved [m], turned [rad]: in the frame of the component; None where the robot would change the
    component, as frames of two components cannot be compared, or has no pose.
    """

    robot: str
    component_before: str | None
    component_after: str | None
    moved: float | None
    turned: float | None


@storable("what-if")
@dataclass(frozen=True, slots=True)
class WhatIf:
    """What the action would do: components with their robots before and after, and every robot."""

    action: Action
    constraint: str
    components_before: dict[str, tuple[str, ...]]
    components_after: dict[str, tuple[str, ...]]
    robots: tuple[RobotMove, ...]


@storable("matched-lines")
@dataclass(frozen=True, eq=False, slots=True)
class MatchedLines:
    """Two lines taken for one wall: x1, y1, x2, y2 in the frame of keyframe a.

    overlap [m], distance [m] and angle [rad] as they lie there.
    """

    reference: tuple[float, float, float, float]
    current: tuple[float, float, float, float]
    overlap: float
    distance: float
    angle: float


@storable("runner-up")
@dataclass(frozen=True, slots=True)
class RunnerUp:
    """The best other way to lay the two on each other: pose of keyframe b seen from keyframe a."""

    x: float
    y: float
    theta: float
    evidence: float


@storable("evidence")
@dataclass(frozen=True, eq=False)
class Evidence:
    """What speaks for a constraint and against it; all coordinates in the frame of keyframe a.

    limits: by check. votes: metres of line that voted for the hypothesis before it was refined.
    margin: lead of the hypothesis over the runner-up as a share of its evidence. reference,
    current (n, 4): all lines of both. conflicts (m, 2): points of one in free space of the other.
    votes, runner_up and margin are None where no pose-free match was made.
    """

    constraint: str
    limits: dict[str, Limit]
    matched: tuple[MatchedLines, ...]
    reference: NDArray[np.float64]
    current: NDArray[np.float64]
    conflicts: NDArray[np.float64]
    votes: float | None = None
    runner_up: RunnerUp | None = None
    margin: float | None = None


@storable("join-trial")
@dataclass(frozen=True, eq=False)
class JoinTrial:
    """What an operator's join would be: T_a_b as measured, and what speaks against it.

    T_frames: the frame of b's component seen in that of a's; None within one component. fits:
    whether the matcher could measure it. checks: by name. evidence: as of a constraint.
    """

    constraint: str
    component_a: str
    component_b: str
    keyframe_a: str
    keyframe_b: str
    T_a_b: Pose
    T_frames: Pose | None
    fits: bool
    reason: str
    objections: tuple[str, ...]
    checks: dict[str, float]
    evidence: Evidence
