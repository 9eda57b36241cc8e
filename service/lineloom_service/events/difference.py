"""From two published views of a site to the events in between."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from lineloom import wire
from lineloom.wire.constraint import ConstraintState
from lineloom_core.mapping.answers.site_view import (
    ComponentView,
    ConstraintView,
    RobotView,
    SiteView,
)
from lineloom_core.mapping.answers.view_change import ViewChange

from lineloom_service.convert import to_uncertain_pose

MOST_LINES_LISTED = 5_000
"""A map event names so many lines at most."""


def events_between(old: SiteView, new: SiteView, at: float) -> list[wire.AnyEvent]:
    """Return what happened, causes before effects. at: when it was published [s since 1970]."""
    change = ViewChange.between(old, new)
    found: list[wire.AnyEvent] = []
    found += _scans(change, old, at)
    found += _constraints(change, old, at)
    found += _merges(change, old, new, at)
    found += _splits(change, old, new, at)
    found += _map(change, at, rests=new.settled and not old.settled)
    found += _robots(change, old, at)
    return found


def _scans(change: ViewChange, old: SiteView, at: float) -> Iterator[wire.ScanEvent]:
    for robot in change.robots.new.values():
        before = old.robots.get(robot.robot)
        known = 0 if before is None else before.scans_processed
        # Fewer than before: it was forgotten in between and has started anew.
        added = robot.scans_processed - (known if known <= robot.scans_processed else 0)
        if added > 0:
            yield wire.ScanEvent(
                version=change.version,
                at=at,
                robot=robot.robot,
                added=added,
                processed=robot.scans_processed,
                session=robot.latest_session,
                seq=robot.latest_seq,
                stamp=robot.latest_stamp,
            )


def _robots(change: ViewChange, old: SiteView, at: float) -> Iterator[wire.RobotEvent]:
    for robot in change.robots.new.values():
        before = old.robots.get(robot.robot)
        if before is None or _state_of(before) != _state_of(robot):
            yield wire.RobotEvent(
                version=change.version,
                at=at,
                robot=robot.robot,
                component=robot.component,
                pose=to_uncertain_pose(robot),
                state=robot.state,
                keyframes=robot.keyframes,
                health=list(robot.health),
            )
    for robot in (old.robots[name] for name in change.robots.gone):
        yield wire.RobotEvent(
            version=change.version, at=at, robot=robot.robot, state=robot.state, forgotten=True
        )


def _state_of(robot: RobotView) -> tuple[object, ...]:
    return robot.component, robot.pose, robot.state, robot.keyframes, robot.health


def _constraints(change: ViewChange, old: SiteView, at: float) -> Iterator[wire.ConstraintEvent]:
    known = {constraint.id: constraint for constraint in old.constraints}
    states = {id: constraint.state for id, constraint in known.items()}
    for c in change.constraints.new.values():
        if c.state != states.get(c.id):
            yield _constraint(c, c.state, states.get(c.id), change.version, at)
    for id in change.constraints.gone:
        yield _constraint(known[id], "removed", known[id].state, change.version, at)


def _constraint(
    constraint: ConstraintView,
    state: ConstraintState | Literal["removed"],
    was: ConstraintState | None,
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
        robot_a=constraint.scan_a.robot,
        robot_b=constraint.scan_b.robot,
        reason=constraint.reason,
    )


def _merges(
    change: ViewChange, old: SiteView, new: SiteView, at: float
) -> Iterator[wire.ComponentMergedEvent]:
    absorbed = [id for id in change.merged_into.new if id not in old.merged_into]
    if not absorbed:
        return
    components = {component.id: component for component in new.components}
    accepted = {c.id for c in old.constraints if c.state == "accepted"}
    joined = [
        c
        for c in change.constraints.new.values()
        if c.state == "accepted" and c.kind != "sequential" and c.id not in accepted
    ]
    component_of = {keyframe.id: keyframe.component for keyframe in new.keyframes}
    for component in absorbed:
        survivor = _survivor(new, component)
        yield wire.ComponentMergedEvent(
            version=change.version,
            at=at,
            component=component,
            merged_into=survivor,
            robots=list(components[survivor].robots) if survivor in components else [],
            constraints=[c.id for c in joined if component_of.get(c.keyframe_a) == survivor],
        )


def _survivor(view: SiteView, component: str) -> str:
    while component in view.merged_into:
        component = view.merged_into[component]
    return component


def _splits(
    change: ViewChange, old: SiteView, new: SiteView, at: float
) -> Iterator[wire.ComponentSplitEvent]:
    known = {component.id for component in old.components}
    for component in change.components.new.values():
        if component.id in known:
            continue
        origin = _origin(old, new, component)
        if origin is not None:
            yield wire.ComponentSplitEvent(
                version=change.version,
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


def _map(change: ViewChange, at: float, *, rests: bool) -> Iterator[wire.MapEvent]:
    """rests: it has settled, which is worth telling even where no line has moved by it."""
    changed, removed = list(change.lines.new), list(change.lines.gone)
    if not changed and not removed and not rests:
        return
    complete = len(changed) + len(removed) <= MOST_LINES_LISTED
    yield wire.MapEvent(
        version=change.version,
        at=at,
        changed=changed if complete else [],
        removed=removed if complete else [],
        complete=complete,
        settled=change.settled,
    )
