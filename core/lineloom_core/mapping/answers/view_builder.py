"""Turning the site's memory into the immutable view that queries are answered from."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import se2
from lineloom_core.mapping.answers.map_lines import fused_lines
from lineloom_core.mapping.answers.site_view import (
    ComponentView,
    ConstraintView,
    KeyframeView,
    PlaceView,
    RobotView,
    SiteView,
)
from lineloom_core.mapping.answers.trajectories import Trajectories, Way, Whereabouts
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.graph_drift import Drifts
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.facts.robot_record import RobotRecord


def build_view(
    site: SiteMap, robots: dict[str, RobotRecord], version: int, *, settled: bool = False
) -> SiteView:
    """Compose the view of a version; changes nothing. settled: whether the site's poses are."""
    component_of = {k: site.component_id(k) for k in site.keyframes}
    drifts, kept = _drifts(site, robots), Counter(k.robot for k in site.keyframes.values())
    return SiteView(
        version=version,
        robots={n: _robot(site, r, kept[n], component_of, drifts) for n, r in robots.items()},
        components=_components(site, component_of),
        merged_into=dict(site.merged_into),
        trajectories=_trajectories(site, robots, component_of),
        lines=fused_lines(site, component_of),
        keyframes=_keyframes(site, component_of),
        constraints=_constraints(site),
        places=_places(site),
        settled=settled,
    )


def _components(site: SiteMap, component_of: dict[int, str]) -> tuple[ComponentView, ...]:
    members: dict[str, list[int]] = {}
    for keyframe, component in component_of.items():
        members.setdefault(component, []).append(keyframe)
    return tuple(
        ComponentView(
            id=component,
            robots=tuple(sorted({site.keyframes[k].robot for k in keyframes})),
            keyframes=len(keyframes),
        )
        for component, keyframes in members.items()
    )


def _robot(
    site: SiteMap,
    record: RobotRecord,
    kept: int,
    component_of: dict[int, str],
    drifts: dict[int, Drifts],
) -> RobotView:
    pose = covariance = component = None
    latest = record.latest
    if latest is not None:
        T_base_laser = record.mount.T_base_laser
        pose = site.pose(latest.keyframe) @ latest.T_keyframe_laser @ T_base_laser.inverse()
        holder, _ = site.resting.on(latest.keyframe)
        component = component_of[holder]
        covariance = _covariance(site, holder, drifts)
    return RobotView(
        robot=record.name,
        component=component,
        pose=pose,
        covariance=covariance,
        state=record.state,
        scans_processed=record.processed,
        keyframes=kept,
        latest_stamp=record.stamp,
        latest_session=record.session,
        latest_seq=record.seq,
        health=record.health,
    )


def _drifts(site: SiteMap, robots: dict[str, RobotRecord]) -> dict[int, Drifts]:
    """By component root: how sure the robots' latest keyframes are against it, asked at once."""
    latest: dict[int, list[int]] = {}
    for record in robots.values():
        if record.latest is not None:
            holder, _ = site.resting.on(record.latest.keyframe)
            latest.setdefault(site.component_root(holder), []).append(holder)
    return {root: site.drifts([root, *keyframes]) for root, keyframes in latest.items()}


def _covariance(site: SiteMap, keyframe: int, drifts: dict[int, Drifts]) -> NDArray[np.float64]:
    """A keyframe's pose against its component's anchor, (3, 3), in the map's axes."""
    root = site.component_root(keyframe)
    heading = np.array([0.0, 0.0, site.pose(keyframe).theta])
    return se2.transport(drifts[root](root, keyframe), heading)


def _trajectories(
    site: SiteMap, robots: dict[str, RobotRecord], component_of: dict[int, str]
) -> Trajectories:
    blocks = {name: record.placed.blocks() for name, record in robots.items()}
    return Trajectories(
        ways={
            name: Way(
                len(blocks[name]), tuple(record.unplaced), record.mount.T_base_laser.inverse()
            )
            for name, record in robots.items()
        },
        blocks=tuple(block for own in blocks.values() for block in own),
        keyframes=_whereabouts(site, component_of),
    )


def _whereabouts(site: SiteMap, component_of: dict[int, str]) -> Whereabouts:
    """Poses of all keyframes ever, in a few steps for all of them at once."""
    ids, kept = site.graph.estimates()
    resting, holders, T_holder_resting = site.resting.rows()
    count = 1 + max(ids.max(initial=-1), resting.max(initial=-1))
    poses, component = np.full((count, 3), np.nan), np.full(count, -1, dtype=np.int32)
    names = {name: number for number, name in enumerate(dict.fromkeys(component_of.values()))}
    poses[ids] = kept
    component[ids] = [names[component_of[k]] for k in ids.tolist()]
    poses[resting] = se2.compose(poses[holders], T_holder_resting)
    component[resting] = component[holders]
    return Whereabouts(poses, component, tuple(names))


def _keyframes(site: SiteMap, component_of: dict[int, str]) -> tuple[KeyframeView, ...]:
    return tuple(
        KeyframeView(
            id=k.name,
            robot=k.robot,
            component=component_of[k.id],
            session=k.scan.session,
            seq=k.scan.seq,
            stamp=k.scan.stamp,
            pose=site.pose(k.id),
        )
        for k in site.keyframes.values()
    )


def _places(site: SiteMap) -> tuple[PlaceView, ...]:
    return tuple(
        PlaceView(
            id=site.id_of("place", place.id),
            robot=site.keyframes[place.anchor].robot,
            anchor=site.keyframes[place.anchor].name,
            keyframes=tuple(site.keyframes[k].name for k in place.keyframes),
        )
        for place in site.places.values()
    )


def _constraints(site: SiteMap) -> tuple[ConstraintView, ...]:
    """All constraints; what is barred is not in the map, but must be there to be restored."""
    residuals = site.graph.residuals()
    known = {**site.constraints, **{c.id: c for c in site.verdicts.all_barred()}}
    return tuple(_constraint(site, c, residuals.get(c.id)) for c in known.values())


def _constraint(site: SiteMap, c: Constraint, residual: float | None) -> ConstraintView:
    a, b = site.keyframes[c.keyframe_a], site.keyframes[c.keyframe_b]
    return ConstraintView(
        id=c.id,
        kind=c.kind,
        state=c.state,
        keyframe_a=a.name,
        keyframe_b=b.name,
        T_a_b=c.T_a_b,
        information=c.information,
        reason=c.reason,
        origin=c.origin,
        scan_a=a.scan_name,
        scan_b=b.scan_name,
        checks=dict(c.checks),
        consistency_set=c.consistency_set,
        residual=residual,
        history=c.history,
    )
