"""From two published views of a site to the events in between."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from lineloom import wire
from lineloom.wire.constraint import ConstraintState
from lineloom_core.mapping.answers.site_view import (
    ComponentView,
    ConstraintView,
    MapLine,
    RobotView,
    SiteView,
)

from lineloom_service.convert import to_uncertain_pose

MOST_LINES_LISTED = 5_000
"""A map event names so many lines at most."""


@dataclass(frozen=True, slots=True)
class LineChanges:
    """Ids of lines that are new or not what they were, and of those that are gone."""

    changed: tuple[str, ...]
    removed: tuple[str, ...]


def line_changes(old: SiteView, new: SiteView) -> LineChanges:
    """Compare two maps line by line, to the last bit."""
    before = {line.id: line for line in old.lines}
    changed = tuple(line.id for line in new.lines if _differ(before.pop(line.id, None), line))
    return LineChanges(changed, tuple(before))


def _differ(old: MapLine | None, new: MapLine) -> bool:
    # Mostly it is the same object; comparing field by field takes twenty times as long.
    return old is not new and old != new


def events_between(old: SiteView, new: SiteView, at: float) -> list[wire.AnyEvent]:
    """Return what happened, causes before effects. at: when it was published [s since 1970]."""
    if old is new:
        return []
    found: list[wire.AnyEvent] = []
    found += _scans(old, new, at)
    found += _constraints(old, new, at)
    found += _merges(old, new, at)
    found += _splits(old, new, at)
    found += _map(old, new, at)
    found += _robots(old, new, at)
    return found


def _scans(old: SiteView, new: SiteView, at: float) -> Iterator[wire.ScanEvent]:
    for name, robot in new.robots.items():
        before = old.robots.get(name)
        known = 0 if before is None else before.scans_processed
        # Fewer than before: it was forgotten in between and has started anew.
        added = robot.scans_processed - (known if known <= robot.scans_processed else 0)
        if added > 0:
            yield wire.ScanEvent(
                version=new.version,
                at=at,
                robot=name,
                added=added,
                processed=robot.scans_processed,
                session=robot.latest_session,
                seq=robot.latest_seq,
                stamp=robot.latest_stamp,
            )


def _robots(old: SiteView, new: SiteView, at: float) -> Iterator[wire.RobotEvent]:
    for name, robot in new.robots.items():
        before = old.robots.get(name)
        if before is None or _state_of(before) != _state_of(robot):
            yield wire.RobotEvent(
                version=new.version,
                at=at,
                robot=name,
                component=robot.component,
                pose=to_uncertain_pose(robot),
                state=robot.state,
                keyframes=robot.keyframes,
                health=list(robot.health),
            )
    for name, robot in old.robots.items():
        if name not in new.robots:
            yield wire.RobotEvent(
                version=new.version, at=at, robot=name, state=robot.state, forgotten=True
            )


def _state_of(robot: RobotView) -> tuple[object, ...]:
    return robot.component, robot.pose, robot.state, robot.keyframes, robot.health


def _constraints(old: SiteView, new: SiteView, at: float) -> Iterator[wire.ConstraintEvent]:
    before = {constraint.id: constraint for constraint in old.constraints}
    changed: list[tuple[ConstraintView, ConstraintState | None]] = []
    for constraint in new.constraints:
        known = before.pop(constraint.id, None)
        if known is None or known.state != constraint.state:
            changed.append((constraint, None if known is None else known.state))
    robots = _robots_of(new) if changed else {}
    for constraint, was in changed:
        yield _constraint(constraint, constraint.state, was, robots, new.version, at)
    robots = _robots_of(old) if before else {}
    for gone in before.values():
        yield _constraint(gone, "removed", gone.state, robots, new.version, at)


def _robots_of(view: SiteView) -> dict[int, str]:
    return {keyframe.id: keyframe.robot for keyframe in view.keyframes}


def _constraint(
    constraint: ConstraintView,
    state: ConstraintState | Literal["removed"],
    was: ConstraintState | None,
    robots: dict[int, str],
    version: int,
    at: float,
) -> wire.ConstraintEvent:
    return wire.ConstraintEvent(
        version=version,
        at=at,
        constraint=constraint.id,
        kind=constraint.kind,
        state=state,
        was=was,
        keyframe_a=constraint.keyframe_a,
        keyframe_b=constraint.keyframe_b,
        robot_a=robots.get(constraint.keyframe_a),
        robot_b=robots.get(constraint.keyframe_b),
        reason=constraint.reason,
    )


def _merges(old: SiteView, new: SiteView, at: float) -> Iterator[wire.ComponentMergedEvent]:
    if new.merged_into.keys() <= old.merged_into.keys():
        return
    components = {component.id: component for component in new.components}
    joined = [c for c in _newly_accepted(old, new) if c.kind != "sequential"]
    component_of = {keyframe.id: keyframe.component for keyframe in new.keyframes}
    for absorbed in new.merged_into:
        if absorbed in old.merged_into:
            continue
        survivor = _survivor(new, absorbed)
        yield wire.ComponentMergedEvent(
            version=new.version,
            at=at,
            component=absorbed,
            merged_into=survivor,
            robots=list(components[survivor].robots) if survivor in components else [],
            constraints=[c.id for c in joined if component_of.get(c.keyframe_a) == survivor],
        )


def _newly_accepted(old: SiteView, new: SiteView) -> list[ConstraintView]:
    known = {c.id for c in old.constraints if c.state == "accepted"}
    return [c for c in new.constraints if c.state == "accepted" and c.id not in known]


def _survivor(view: SiteView, component: str) -> str:
    while component in view.merged_into:
        component = view.merged_into[component]
    return component


def _splits(old: SiteView, new: SiteView, at: float) -> Iterator[wire.ComponentSplitEvent]:
    known = {component.id for component in old.components}
    for component in new.components:
        if component.id in known:
            continue
        origin = _origin(old, new, component)
        if origin is not None:
            yield wire.ComponentSplitEvent(
                version=new.version,
                at=at,
                component=component.id,
                split_from=origin,
                robots=list(component.robots),
            )


def _origin(old: SiteView, new: SiteView, component: ComponentView) -> str | None:
    """Return the component that this one's oldest keyframe known before was in."""
    if component.id in old.merged_into:
        return _survivor(old, component.id)
    members = {k.id for k in new.keyframes if k.component == component.id}
    return next((k.component for k in old.keyframes if k.id in members), None)


def _map(old: SiteView, new: SiteView, at: float) -> Iterator[wire.MapEvent]:
    changes = line_changes(old, new)
    if not changes.changed and not changes.removed:
        return
    complete = len(changes.changed) + len(changes.removed) <= MOST_LINES_LISTED
    yield wire.MapEvent(
        version=new.version,
        at=at,
        changed=list(changes.changed) if complete else [],
        removed=list(changes.removed) if complete else [],
        complete=complete,
    )
