"""What kinds of constraint there are, and what may become of one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from lineloom_core.codec import storable

ConstraintKind = Literal["sequential", "loop", "rendezvous", "operator"]
ConstraintState = Literal["candidate", "accepted", "rejected", "retracted"]


@storable("state-change")
@dataclass(frozen=True, slots=True)
class StateChange:
    """When a constraint came into a state (`version`: log entries processed) and why."""

    version: int
    state: ConstraintState
    reason: str
