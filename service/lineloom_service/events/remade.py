"""A map that took another's place: what differs between the two, as an event and as a file."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

from lineloom import wire
from lineloom_core.geometry import angle_difference
from lineloom_core.mapping.answers.site_view import RobotView, SiteView
from lineloom_core.mapping.answers.view_change import ViewChange

from lineloom_service.store.files import FileRecord

LAST = "last"
"""The name of the file of kind `remade` in which a site's last one is."""

MOST_CONSTRAINTS_LISTED = 1_000


def remade_event(before: SiteView, after: SiteView, why: str, at: float) -> wire.RemadeEvent:
    """Compare the view that was shown with the one that is shown instead."""
    accepted = [
        {c.id for c in view.constraints if c.state == "accepted" and c.kind != "sequential"}
        for view in (before, after)
    ]
    gained, lost = sorted(accepted[1] - accepted[0]), sorted(accepted[0] - accepted[1])
    lines = ViewChange.between(before, after).lines
    names = sorted(before.robots.keys() | after.robots.keys())
    return wire.RemadeEvent(
        version=after.version,
        at=at,
        why=why,
        version_before=before.version,
        components_before=_components(before),
        components_after=_components(after),
        constraints_gained=gained[:MOST_CONSTRAINTS_LISTED],
        constraints_lost=lost[:MOST_CONSTRAINTS_LISTED],
        complete=max(len(gained), len(lost)) <= MOST_CONSTRAINTS_LISTED,
        robots=[_move(name, before.robots, after.robots) for name in names],
        lines_changed=len(lines.new),
        lines_removed=len(lines.gone),
    )


def as_file(event: wire.RemadeEvent) -> FileRecord:
    """Return the file that keeps it when its event is no longer kept."""
    nothing = hashlib.sha256(b"").hexdigest()
    return FileRecord(LAST, event.model_dump_json(), nothing, 0, event.at, b"")


def from_file(file: FileRecord) -> wire.RemadeEvent:
    """Return what was kept."""
    return wire.RemadeEvent.model_validate_json(file.about)


def _components(view: SiteView) -> list[wire.ComponentRobots]:
    return [wire.ComponentRobots(id=c.id, robots=list(c.robots)) for c in view.components]


def _move(
    name: str, before: Mapping[str, RobotView], after: Mapping[str, RobotView]
) -> wire.RobotMove:
    old, new = before.get(name), after.get(name)
    was = None if old is None else old.component
    now = None if new is None else new.component
    moved = turned = None
    # Frames of two components cannot be compared, nor poses of two scans.
    if old and new and was == now and old.pose and new.pose and _latest(old) == _latest(new):
        moved = old.pose.distance(new.pose)
        turned = abs(angle_difference(new.pose.theta, old.pose.theta))
    return wire.RobotMove(
        robot=name, component_before=was, component_after=now, moved_m=moved, turned_rad=turned
    )


def _latest(robot: RobotView) -> tuple[str | None, int | None]:
    return robot.latest_session, robot.latest_seq
