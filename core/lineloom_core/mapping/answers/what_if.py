"""What a retraction or its undoing would do to the robots."""

from __future__ import annotations

from collections.abc import Mapping

from lineloom_core.geometry import angle_difference
from lineloom_core.mapping.answers.evidence import Action, RobotMove, WhatIf
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.facts.robot_record import RobotRecord


def what_if(
    action: Action, constraint: str, now: SiteMap, then: SiteMap, robots: Mapping[str, RobotRecord]
) -> WhatIf:
    """Compare the map as it is with the one that the action would give."""
    return WhatIf(
        action,
        constraint,
        _components(now),
        _components(then),
        tuple(_move(now, then, record) for record in robots.values()),
    )


def _components(site: SiteMap) -> dict[str, tuple[str, ...]]:
    members: dict[str, set[str]] = {}
    for k, frame in site.keyframes.items():
        members.setdefault(site.component_id(k), set()).add(frame.robot)
    return {component: tuple(sorted(names)) for component, names in members.items()}


def _move(now: SiteMap, then: SiteMap, record: RobotRecord) -> RobotMove:
    latest = record.latest
    if latest is None:
        return RobotMove(record.name, None, None, None, None)
    before, after = now.component_id(latest.keyframe), then.component_id(latest.keyframe)
    if before != after:
        return RobotMove(record.name, before, after, None, None)
    old, new = (site.pose(latest.keyframe) @ latest.T_keyframe_laser for site in (now, then))
    return RobotMove(
        record.name, before, after, old.distance(new), abs(angle_difference(new.theta, old.theta))
    )
