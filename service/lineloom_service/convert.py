"""Between the contract's models and the core's types: the only file that knows both,
but for the events of `events/difference.py`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping

import networkx as nx
import numpy as np
from lineloom import wire
from lineloom.wire.base import Covariance
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.site_view import ConstraintView, MapLine, RobotView, SiteView
from lineloom_core.matching import MatchResult
from lineloom_core.scan import Mount, Scan
from numpy.typing import NDArray

from lineloom_service.engine.hosted_site import Remaking
from lineloom_service.engine.published import Published
from lineloom_service.observation.arrivals import Heard
from lineloom_service.observation.loads import Load
from lineloom_service.relative_pose import RelativePose
from lineloom_service.store.codec import decode_mount
from lineloom_service.store.records import SCANS, RobotRecord, SiteRecord, Skip


def to_scan(scan: wire.Scan) -> Scan:
    """Return the core's scan. Raises InvalidScanError where the fields do not fit together."""
    odometry = scan.odometry
    return Scan.checked(
        # A list as it came, or an array of float32: numpy takes either.
        np.asarray(scan.ranges, dtype=np.float64),
        angle_min=scan.angle_min,
        angle_increment=scan.angle_increment,
        angle_max=scan.angle_max,
        range_min=scan.range_min,
        range_max=scan.range_max,
        stamp=scan.stamp,
        seq=scan.seq or 0,
        session=scan.session,
        time_increment=scan.time_increment,
        scan_time=scan.scan_time,
        odometry=None if odometry is None else Pose(odometry.x, odometry.y, odometry.theta),
    )


def to_mount(mount: wire.MountSettings) -> Mount:
    """Return the core's mount."""
    return Mount(Pose(mount.x, mount.y, mount.theta), mount.inverted)


def to_remaking(remaking: Remaking | None) -> wire.Remaking | None:
    """Return how far the map is that will be shown instead."""
    if remaking is None:
        return None
    return wire.Remaking(position=remaking.position, of=remaking.of, why=remaking.why)


def to_site(
    record: SiteRecord,
    published: Published,
    trouble: str | None,
    remaking: wire.Remaking | None,
    load: Load,
) -> wire.Site:
    """Return how a site is doing. trouble: why it is not mapped just now."""
    view = published.view
    constraints: dict[str, dict[str, int]] = {}
    for (kind, state), count in Counter((c.kind, c.state) for c in view.constraints).items():
        constraints.setdefault(kind, {})[state] = count
    counts = _counts(record.accepted, published.scans, published.skipped)
    return wire.Site(
        site=record.name,
        version=view.version,
        settled=view.settled,
        idle=counts.pending == 0 and published.rank >= (record.position, True),
        scans=counts,
        robots=sorted(record.robots),
        components=[
            wire.Component(id=c.id, robots=list(c.robots), keyframes=c.keyframes)
            for c in view.components
        ],
        merged_into=dict(view.merged_into),
        constraints=constraints,
        trouble=trouble,
        remaking=remaking,
        overloaded=load.is_over,
        suggested_rate_hz=load.rate_hz,
    )


def to_robot(
    site: str,
    record: RobotRecord,
    view: SiteView,
    skips: Iterable[Skip],
    heard: Heard,
    conflict: str | None = None,
) -> wire.Robot:
    """Return a robot at its latest processed scan. conflict: why scans of it are refused."""
    skipped = [skip for skip in skips if skip.robot == record.name]
    seen = view.robots.get(record.name)
    processed = 0 if seen is None else seen.scans_processed
    skipped_scans = sum(skip.kind in SCANS for skip in skipped)
    health = [] if seen is None else list(seen.health)
    if conflict is not None:
        health.append(conflict)
    if record.held:
        health.append(f"{record.held} scans wait for those with lower seq")
    if record.late:
        health.append(
            f"back-fill: {record.late} scans came after those that follow them; once no more of "
            "them come, the map is made anew with them at their places"
        )
    health += [_describe_skip(skip) for skip in skipped]
    state = "starting" if seen is None else seen.state
    if heard.is_silent:
        health.append(silence(heard.silent_for_s))
    return wire.Robot(
        robot=record.name,
        site=site,
        component=None if seen is None else seen.component,
        settled=view.settled,
        pose=None if seen is None else to_uncertain_pose(seen),
        state="silent" if heard.is_silent else state,
        scans=_counts(record.accepted, processed, skipped_scans),
        keyframes=0 if seen is None else seen.keyframes,
        latest_stamp=None if seen is None else seen.latest_stamp,
        latest_session=None if seen is None else seen.latest_session,
        latest_seq=None if seen is None else seen.latest_seq,
        last_received=heard.received,
        silent_for_s=round(heard.silent_for_s, 1),
        mount=None if record.mount is None else _mount(decode_mount(record.mount)),
        health=health,
    )


def silence(seconds: float) -> str:
    """Return what an operator should know of a robot that has fallen silent."""
    return (
        f"silent: no scan has come for {seconds:.0f} s: look at the robot, its network and what "
        "its client answers"
    )


def to_uncertain_pose(robot: RobotView) -> wire.UncertainPose | None:
    """Return a robot's pose, None before its first scan is placed."""
    if robot.pose is None:
        return None
    covariance = None if robot.covariance is None else matrix(robot.covariance)
    pose = robot.pose
    return wire.UncertainPose(x=pose.x, y=pose.y, theta=pose.theta, covariance=covariance)


def to_trajectory(robot: str, view: SiteView) -> wire.Trajectory:
    """Return every processed scan, with its pose if it has one."""
    found = view.trajectories.get(robot)
    poses: list[wire.TrajectoryPose] = []
    if found is not None:
        for session, seq, stamp, component, pose in found.rows():
            x, y, theta = (None, None, None) if pose is None else pose
            poses.append(
                wire.TrajectoryPose.model_construct(
                    session=session,
                    seq=seq,
                    stamp=stamp,
                    component=component,
                    x=x,
                    y=y,
                    theta=theta,
                )
            )
    return wire.Trajectory.model_construct(
        robot=robot, version=view.version, settled=view.settled, poses=poses
    )


def to_line(line: MapLine) -> wire.Line:
    """Return a line of the map."""
    return wire.Line.model_construct(
        id=line.id,
        component=line.component,
        x1=line.x1,
        y1=line.y1,
        x2=line.x2,
        y2=line.y2,
        sigma=line.sigma,
        support=line.support,
        robots=list(line.robots),
        first_seen=line.first_seen,
        last_seen=line.last_seen,
        layer=line.layer,
        wall=line.wall,
    )


def to_graph(site: str, view: SiteView) -> wire.Graph:
    """Return keyframes and accepted constraints, as networkx writes them."""
    graph = nx.MultiDiGraph(site=site, version=view.version, settled=view.settled)
    graph.graph["submaps"] = [
        {"id": s.id, "robot": s.robot, "anchor": s.anchor, "keyframes": s.keyframes}
        for s in view.places
    ]
    for k in view.keyframes:
        where = {"robot": k.robot, "component": k.component, "x": k.pose.x, "y": k.pose.y}
        when = {"session": k.session, "seq": k.seq, "stamp": k.stamp}
        graph.add_node(k.id, **where, theta=k.pose.theta, **when)
    for c in view.constraints:
        if c.state == "accepted":
            T_a_b = {"x": c.T_a_b.x, "y": c.T_a_b.y, "theta": c.T_a_b.theta}
            weighed = {"information": matrix(c.information), "residual": c.residual}
            said = {"kind": c.kind, "state": c.state, **T_a_b, **weighed}
            graph.add_edge(c.keyframe_a, c.keyframe_b, key=c.id, **said)
    return wire.Graph.model_validate(nx.node_link_data(graph, edges="edges"))


def to_constraint(constraint: ConstraintView) -> wire.Constraint:
    """Return a constraint."""
    return wire.Constraint(
        id=constraint.id,
        kind=constraint.kind,
        state=constraint.state,
        keyframe_a=constraint.keyframe_a,
        keyframe_b=constraint.keyframe_b,
        robot_a=constraint.scan_a.robot,
        robot_b=constraint.scan_b.robot,
        T_a_b=_pose(constraint.T_a_b),
        information=matrix(constraint.information),
        reason=constraint.reason,
        checks=figures(constraint.checks),
        consistency_set=list(constraint.consistency_set),
        residual=constraint.residual,
        history=[
            wire.StateChange(version=h.version, state=h.state, reason=h.reason)
            for h in constraint.history
        ],
    )


def to_transform(robot_a: str, robot_b: str, view: SiteView, found: RelativePose) -> wire.Transform:
    """Return where one robot is, seen from another."""
    return wire.Transform(
        robot_a=robot_a,
        robot_b=robot_b,
        component=found.component,
        version=view.version,
        settled=view.settled,
        T_a_b=_pose(found.T_a_b),
        covariance=None if found.covariance is None else matrix(found.covariance),
        constraints=list(found.constraints),
    )


def to_match(result: MatchResult) -> wire.MatchAnswer:
    """Return what is known about T_reference_current."""
    T = result.T_reference_current
    return wire.MatchAnswer(
        verdict=result.verdict,
        T_reference_current=None if T is None else _pose(T),
        weak_direction=result.weak_direction,
        covariance=None if result.covariance is None else matrix(result.covariance),
        score=result.score,
        pairs=[
            wire.LinePair(
                reference=p.reference,
                current=p.current,
                overlap=p.overlap,
                distance=p.distance,
                angle=p.angle,
            )
            for p in result.pairs
        ],
        checks=figures(result.checks),
        alternatives=[
            wire.Alternative(
                x=a.T_reference_current.x,
                y=a.T_reference_current.y,
                theta=a.T_reference_current.theta,
                score=a.score,
            )
            for a in result.alternatives
        ],
        reason=result.reason,
    )


def _counts(accepted: int, processed: int, skipped: int) -> wire.ScanCounts:
    # A robot that was forgotten and came back may still be shown with its former scans.
    pending = max(0, accepted - processed - skipped)
    return wire.ScanCounts(accepted=accepted, processed=processed, skipped=skipped, pending=pending)


def _describe_skip(skip: Skip) -> str:
    what = f"scan {skip.seq} of session {skip.session!r}" if skip.kind in SCANS else skip.kind
    return f"{what} was left out of the map: {skip.reason}"


def _pose(pose: Pose) -> wire.PoseAnswer:
    return wire.PoseAnswer(x=pose.x, y=pose.y, theta=pose.theta)


def _mount(mount: Mount) -> wire.MountSettings:
    T = mount.T_base_laser
    return wire.MountSettings(x=T.x, y=T.y, theta=T.theta, inverted=mount.inverted)


def matrix(values: NDArray[np.float64]) -> Covariance:
    """Return a 3x3 matrix, null where it is not finite."""
    rows: list[list[float]] = values.tolist()
    return [[value if math.isfinite(value) else None for value in row] for row in rows]


def figures(checks: Mapping[str, float]) -> dict[str, float | None]:
    """Return figures by name, null where they are not finite."""
    return {name: float(value) if math.isfinite(value) else None for name, value in checks.items()}
