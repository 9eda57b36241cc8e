"""A building's floor plan, and where in it the map lies."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from lineloom.wire.base import Answer, Settled
from lineloom.wire.pose import PoseAnswer


class Placement(Answer):
    """Where a component lies in the plan.

    verdict: "registered" with T_plan_map; "ambiguous": `rivals` do nearly as well; "none".
    margin: by how much the best place is better than the next. share_explained: of the mapped
    walls, on walls of the plan. share_missing: of the plan's walls that could be judged, those in
    whose place free space was seen. All 0..1.
    """

    component: str
    verdict: Literal["registered", "ambiguous", "none"]
    reason: str
    T_plan_map: PoseAnswer | None = None
    margin: float = 0.0
    share_explained: float = 0.0
    share_missing: float = 0.0
    rivals: list[PoseAnswer] = Field(default_factory=list)


class FloorPlanAnswer(Answer):
    """The plan of a site. lines: how many it has; extent: its longer side [m]."""

    site: str
    version: int
    settled: Settled = False
    sha256: str
    lines: int
    extent: float
    components: list[Placement]


class PlanPiece(Answer):
    """A piece of wall in the plan's frame [m]. line: the map's line that it is a part of."""

    x1: float
    y1: float
    x2: float
    y2: float
    line: str | None = None


class PlanDifferences(Answer):
    """missing: walls of the plan in whose place free space was seen. new: mapped walls that the
    plan does not have. confirmed_m, unseen_m: metres of the plan's walls that are there, and that
    nobody has seen."""

    site: str
    version: int
    settled: Settled = False
    component: str
    missing: list[PlanPiece]
    new: list[PlanPiece]
    confirmed_m: float
    unseen_m: float
