"""An edge of the pose graph and why it is what it is."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from lineloom.wire.base import Answer, Covariance, Settled
from lineloom.wire.pose import PoseAnswer

ConstraintKind = Literal["sequential", "loop", "rendezvous", "operator"]
ConstraintState = Literal["candidate", "accepted", "rejected", "retracted"]


class StateChange(Answer):
    """A move of a constraint: at which version it came into the state, and why."""

    version: int
    state: ConstraintState
    reason: str


class Constraint(Answer):
    """Two keyframes and how they lie to each other.

    T_a_b: pose of keyframe b in the frame of keyframe a. information: 3x3, x, y, theta in the
    axes of b. checks: each check's figure by name. residual: whitened norm in the graph now,
    null where the constraint is not in the graph. reason: why it is in this state. history: how
    it came there.
    """

    id: str
    kind: ConstraintKind
    state: ConstraintState
    keyframe_a: str
    keyframe_b: str
    robot_a: str | None = None
    robot_b: str | None = None
    T_a_b: PoseAnswer
    information: Covariance
    reason: str
    checks: dict[str, float | None]
    consistency_set: list[str]
    residual: float | None = None
    history: list[StateChange] = Field(default_factory=list)


class ConstraintPage(Answer):
    """Some constraints; ask again with `cursor=next_cursor` for more, until it is null."""

    site: str
    version: int
    settled: Settled = False
    constraints: list[Constraint]
    next_cursor: str | None = None
