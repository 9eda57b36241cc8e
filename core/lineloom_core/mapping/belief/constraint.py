"""An edge of the pose graph with its history: what was measured, what became of it and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose
from lineloom_core.graph import Edge
from lineloom_core.mapping.belief.claim import Claim, Origin
from lineloom_core.mapping.belief.constraint_state import (
    ConstraintKind,
    ConstraintState,
    StateChange,
)

CONSTRAINT_FLOOR = np.diag([0.05**2, 0.05**2, 0.01**2])
"""How far two right constraints may disagree besides drift."""


@storable("constraint")
@dataclass(frozen=True, eq=False)
class Constraint:
    """T_a_b between two keyframes and its state.

    id: made of the scans that are compared (`ids`), so that the same pair has the same name in any
    replay. information: 3x3 in the tangent at b. place_a, place_b: the places it came from, -1
    where it came from two keyframes alone. evidence: metres of wall that speak for it. history: how
    it came to its state. claim: what it stands for, where it was not measured here (`standing`).
    """

    id: str
    kind: ConstraintKind
    state: ConstraintState
    keyframe_a: int
    keyframe_b: int
    T_a_b: Pose
    information: NDArray[np.float64]
    reason: str
    checks: dict[str, float] = field(default_factory=dict)
    consistency_set: tuple[str, ...] = ()
    place_a: int = -1
    place_b: int = -1
    evidence: float = 0.0
    history: tuple[StateChange, ...] = ()
    claim: Claim | None = None

    @property
    def origin(self) -> Origin:
        """How it came about."""
        if self.claim is not None:
            return self.claim.origin
        if self.kind == "sequential":
            return "step"
        return "near" if self.place_a < 0 else "recognition"

    def moved_to(
        self,
        state: ConstraintState,
        reason: str,
        at: int = 0,
        *,
        consistency_set: tuple[str, ...] = (),
    ) -> Constraint:
        """The same constraint in another state, for the reason given; at: the version it is then.

        Only moves are history: what an open candidate waits for may change with every scan.
        """
        move = StateChange(at, state, reason)
        same = bool(self.history) and self.history[-1].state == state
        before = self.history[:-1] if same else self.history
        return replace(
            self,
            state=state,
            reason=reason,
            consistency_set=consistency_set or self.consistency_set,
            history=(*before, replace(move, version=self.history[-1].version) if same else move),
        )

    def with_figures(self, figures: Mapping[str, float]) -> Constraint:
        """The same constraint, showing these as well."""
        return replace(self, checks={**self.checks, **figures})

    def edge(self) -> Edge:
        """The constraint as the solver takes it."""
        return Edge(
            id=self.id,
            kind=self.kind,
            node_a=self.keyframe_a,
            node_b=self.keyframe_b,
            T_a_b=self.T_a_b,
            information=self.information,
            robust=self.kind != "sequential",
        )


def turned_round(c: Constraint) -> Constraint:
    """The same constraint, written from its other end."""
    # A tangent at b is -Ad(T_a_b) of itself at a: the information goes along.
    A = c.T_a_b.inverse().adjoint()
    return replace(
        c,
        keyframe_a=c.keyframe_b,
        keyframe_b=c.keyframe_a,
        T_a_b=c.T_a_b.inverse(),
        information=A.T @ c.information @ A,
        place_a=c.place_b,
        place_b=c.place_a,
    )
