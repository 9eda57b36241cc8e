"""Turning the site's memory into the immutable view that queries are answered from."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features._kernels import VAR_OFFSET
from lineloom_core.fusion import LineObservations, fuse
from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.graph import Covariances, in_map_axes
from lineloom_core.mapping.robot_record import RobotRecord
from lineloom_core.mapping.site_map import SiteMap
from lineloom_core.mapping.site_view import (
    ComponentView,
    ConstraintView,
    KeyframeView,
    MapLine,
    RobotView,
    SiteView,
    TrajectoryView,
)

_LINES_PER_KEYFRAME = 100_000
"""Observation ids: keyframe times this plus the line's extraction number; stable for ever."""


def build_view(site: SiteMap, robots: dict[str, RobotRecord], version: int) -> SiteView:
    """Compose the view of a version; changes nothing."""
    component_of = {k: site.component_id(k) for k in site.keyframes}
    return SiteView(
        version=version,
        robots={name: _robot(site, record, component_of) for name, record in robots.items()},
        components=_components(site, component_of),
        merged_into=dict(site.merged_into),
        trajectories={name: _trajectory(site, r, component_of) for name, r in robots.items()},
        lines=fused_lines(site, component_of),
        keyframes=_keyframes(site, component_of),
        constraints=_constraints(site),
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


def _robot(site: SiteMap, record: RobotRecord, component_of: dict[int, str]) -> RobotView:
    pose = covariance = component = None
    latest = record.latest
    if latest is not None:
        T_base_laser = record.mount.T_base_laser
        pose = site.pose(latest.keyframe) @ latest.T_keyframe_laser @ T_base_laser.inverse()
        component = component_of[latest.keyframe]
        covariance = _covariance(site, latest.keyframe)
    return RobotView(
        robot=record.name,
        component=component,
        pose=pose,
        covariance=covariance,
        state=record.state,
        scans_processed=record.processed,
        keyframes=sum(1 for k in site.keyframes.values() if k.robot == record.name),
        latest_stamp=record.stamp,
        latest_session=record.session,
        latest_seq=record.seq,
        health=record.health,
    )


def _covariance(site: SiteMap, keyframe: int) -> NDArray[np.float64]:
    """Covariance of a keyframe's pose against its component's anchor, in the map's axes."""
    nodes, edges = site.graph.component_subgraph(keyframe)
    covariances = Covariances(nodes, edges, anchor=site.component_root(keyframe))
    return in_map_axes(covariances.of(keyframe), site.pose(keyframe))


def _trajectory(site: SiteMap, record: RobotRecord, component_of: dict[int, str]) -> TrajectoryView:
    placed = record.placed
    anchors = np.array([site.pose(p.keyframe).to_array() for p in placed]).reshape(-1, 3)
    steps = np.array([p.T_keyframe_laser.to_array() for p in placed]).reshape(-1, 3)
    base = record.mount.T_base_laser.inverse().to_array()
    poses = _compose(_compose(anchors, steps), np.broadcast_to(base, steps.shape))
    return TrajectoryView(
        session=tuple(p.session for p in placed),
        seq=np.array([p.seq for p in placed], dtype=np.int64),
        stamp=np.array([p.stamp for p in placed], dtype=np.float64),
        component=tuple(component_of[p.keyframe] for p in placed),
        poses=poses,
    )


def _compose(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    return np.column_stack(
        [
            a[:, 0] + c * b[:, 0] - s * b[:, 1],
            a[:, 1] + s * b[:, 0] + c * b[:, 1],
            wrap_array(a[:, 2] + b[:, 2]),
        ]
    )


def _keyframes(site: SiteMap, component_of: dict[int, str]) -> tuple[KeyframeView, ...]:
    return tuple(
        KeyframeView(
            id=k.id,
            robot=k.robot,
            component=component_of[k.id],
            session=k.scan.session,
            seq=k.scan.seq,
            stamp=k.scan.stamp,
            pose=site.pose(k.id),
        )
        for k in site.keyframes.values()
    )


def _constraints(site: SiteMap) -> tuple[ConstraintView, ...]:
    """All constraints; what is barred is not in the map, but must be there to be restored."""
    residuals = site.graph.residuals()
    known = {**site.constraints, **{c.id: c for c in site.verdicts.all_barred()}}
    return tuple(
        ConstraintView(
            id=c.id,
            kind=c.kind,
            state=c.state,
            keyframe_a=c.keyframe_a,
            keyframe_b=c.keyframe_b,
            T_a_b=c.T_a_b,
            information=c.information,
            reason=c.reason,
            checks=dict(c.checks),
            consistency_set=c.consistency_set,
            residual=residuals.get(c.id),
            history=c.history,
        )
        for c in known.values()
    )


def fused_lines(site: SiteMap, component_of: dict[int, str]) -> tuple[MapLine, ...]:
    """Fuse the lines of all keyframes, component by component (design §3 to §8)."""
    members: dict[str, list[int]] = {}
    for keyframe, component in component_of.items():
        members.setdefault(component, []).append(keyframe)
    names = sorted({k.robot for k in site.keyframes.values()})
    lines: list[MapLine] = []
    for component, keyframes in members.items():
        lines.extend(_component_lines(site, component, keyframes, names))
    return tuple(lines)


def _component_lines(
    site: SiteMap, component: str, keyframes: list[int], names: list[str]
) -> list[MapLine]:
    observations = _observations(site, keyframes, names)
    if len(observations) == 0:
        return []
    fused = fuse(observations, site.config.fusion)
    ends = fused.endpoints.tolist()
    return [
        MapLine(
            id=f"l{fused.id[i]}",
            component=component,
            x1=ends[i][0],
            y1=ends[i][1],
            x2=ends[i][2],
            y2=ends[i][3],
            sigma=float(fused.sigma[i]),
            support=int(fused.support[i]),
            robots=tuple(names[r] for r in fused.robots[i]),
            first_seen=float(fused.first_seen[i]),
            last_seen=float(fused.last_seen[i]),
        )
        for i in range(len(fused))
    ]


def _observations(site: SiteMap, keyframes: list[int], names: list[str]) -> LineObservations:
    """All keyframes' lines in the component's frame."""
    rows = [(k, site.keyframes[k], site.keyframes[k].features.lines) for k in keyframes]
    counts = np.array([len(lines) for _, _, lines in rows])
    number = {name: i for i, name in enumerate(names)}
    return LineObservations(
        endpoints=np.concatenate([_moved(site.pose(k), lines) for k, _, lines in rows]),
        sigma=np.sqrt(np.concatenate([lines[:, VAR_OFFSET] for _, _, lines in rows])),
        weight=np.ones(int(counts.sum())),
        keyframe=np.repeat(np.array([k for k, _, _ in rows], dtype=np.int64), counts),
        robot=np.repeat(np.array([number[f.robot] for _, f, _ in rows], dtype=np.int64), counts),
        stamp=np.repeat(np.array([f.scan.stamp for _, f, _ in rows]), counts),
        id=np.concatenate(
            [
                k * _LINES_PER_KEYFRAME + np.arange(len(lines), dtype=np.int64)
                for k, _, lines in rows
            ]
        ),
    )


def _moved(pose: Pose, lines: NDArray[np.float64]) -> NDArray[np.float64]:
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    x, y = lines[:, 0:4:2], lines[:, 1:4:2]
    moved = np.empty((len(lines), 4))
    moved[:, 0:4:2] = c * x - s * y + pose.x
    moved[:, 1:4:2] = s * x + c * y + pose.y
    return moved
