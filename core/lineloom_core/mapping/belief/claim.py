"""What an operator's verdict is about, in terms that hold in every replay of the log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose
from lineloom_core.mapping.belief.constraint_state import ConstraintKind
from lineloom_core.mapping.facts.scan_name import ScanName

Origin = Literal["step", "near", "recognition", "operator"]
"""How a constraint came about: tracked from keyframe to keyframe, registered where the graph
predicted two keyframes near each other, one place recognised in another, or said by an operator."""


@storable("claim")
@dataclass(frozen=True, slots=True)
class Claim:
    """That the lidar stood at T_a_b when it took scan b, seen from where it took scan a.

    constraint: the id of what claims it.
    """

    constraint: str
    kind: ConstraintKind
    origin: Origin
    scan_a: ScanName
    scan_b: ScanName
    T_a_b: Pose
