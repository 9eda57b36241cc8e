"""Why a constraint is believed or not, and what undoing it would do."""

from __future__ import annotations

from typing import Literal

from lineloom.wire.base import Answer
from lineloom.wire.constraint import Constraint


class CheckLimit(Answer):
    """What a figure in `checks` is held to, and what it is; without bounds it is only shown.

    means: in words. unit: `share` is 0 to 1, empty is a plain number. log_odds: what it adds to the
    log-odds that the constraint is false, null where it is not weighed.
    """

    at_least: float | None
    at_most: float | None
    holds: bool
    means: str = ""
    unit: str = ""
    log_odds: float | None = None


class MatchedLines(Answer):
    """Two line segments taken for one wall: [x1, y1, x2, y2] in the frame of keyframe a."""

    reference: list[float]
    current: list[float]
    overlap: float
    distance: float
    angle: float


class RunnerUp(Answer):
    """The best other way to lay the two on each other: keyframe b seen from keyframe a.

    evidence: metres of wall that speak for it.
    """

    x: float
    y: float
    theta: float
    evidence: float


class ConstraintDetail(Constraint):
    """A constraint with all of its evidence; coordinates in the frame of keyframe a.

    limits: by check, what its figure is held to. conflicts: points of one in free space of the
    other. votes: metres of line that voted for the hypothesis. margin: its lead over the
    runner-up as a share of its evidence. All null where the mapper could not be asked just now.
    """

    limits: dict[str, CheckLimit] | None = None
    matched: list[MatchedLines] | None = None
    conflicts: list[list[float]] | None = None
    votes: float | None = None
    runner_up: RunnerUp | None = None
    margin: float | None = None


class ComponentRobots(Answer):
    """A component and the robots in it."""

    id: str
    robots: list[str]


class RobotMove(Answer):
    """How far a robot's latest pose would move.

    Null where it would change the component: frames of two components cannot be compared.
    """

    robot: str
    component_before: str | None
    component_after: str | None
    moved_m: float | None
    turned_rad: float | None


class WhatIf(Answer):
    """What retracting a constraint, or restoring a retracted one, would do."""

    constraint: str
    action: Literal["retract", "restore"]
    version: int
    components_before: list[ComponentRobots]
    components_after: list[ComponentRobots]
    robots: list[RobotMove]
