"""A recording's first scans through a mapper on this machine."""

from __future__ import annotations

from dataclasses import dataclass

from lineloom_core.geometry import Pose
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.scan import Mount
from lineloom_core.scan import Scan as CoreScan

from lineloom.cli.schedule import Stream
from lineloom.wire import Scan


@dataclass(frozen=True)
class TrialMap:
    """scans: tried; placed: with a pose; parts: pieces that do not hang together. health: what the
    mapper found wrong with the sensor, as `name: message`."""

    scans: int
    placed: int
    parts: int
    health: tuple[str, ...]


def trial_map(stream: Stream, most: int) -> TrialMap:
    """Map the first `most` scans of a stream."""
    mapper = SiteMapper()
    if stream.mount is not None:
        m = stream.mount
        mapper.set_mount(stream.robot, Mount(Pose(m.x, m.y, m.theta), m.inverted))
    tried = list(stream.scans[:most])
    for scan in tried:
        mapper.add(stream.robot, _core_scan(scan))
    view = mapper.view()
    return TrialMap(
        scans=len(tried),
        placed=len(view.trajectories[stream.robot].seq),
        parts=len(view.components),
        health=view.robots[stream.robot].health,
    )


def _core_scan(scan: Scan) -> CoreScan:
    """Return the core's scan."""
    odometry = scan.odometry
    return CoreScan.checked(
        scan.ranges,
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
