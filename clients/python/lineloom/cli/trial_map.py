"""A recording's first scans through a mapper on this machine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.scan import Mount
from lineloom_core.scan import Scan as CoreScan
from numpy.typing import NDArray

from lineloom.cli.schedule import Stream
from lineloom.wire import Scan


@dataclass(frozen=True)
class TrialMap:
    """scans: tried; placed: with a pose; parts: pieces that do not hang together. turned [rad]: in
    all, to and fro. turned_with_odometry: correlation of the turns with odometry's, -1..1."""

    scans: int
    placed: int
    parts: int
    turned: float
    turned_with_odometry: float | None
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
    path = view.trajectories[stream.robot]
    thetas = dict(zip(path.seq.tolist(), path.poses[:, 2].tolist(), strict=True))
    odometry = {s.seq: s.odometry.theta for s in tried if s.odometry is not None}
    both = [seq for seq in thetas if seq in odometry]
    map_turns = _turns(np.array([thetas[seq] for seq in both]))
    odometry_turns = _turns(np.array([odometry[seq] for seq in both]))
    return TrialMap(
        scans=len(tried),
        placed=len(path.seq),
        parts=len(view.components),
        turned=float(np.abs(odometry_turns).sum()),
        turned_with_odometry=_correlation(map_turns, odometry_turns),
        health=view.robots[stream.robot].health,
    )


def _turns(thetas: NDArray[np.float64]) -> NDArray[np.float64]:
    turns: NDArray[np.float64] = wrap_array(np.diff(thetas))
    return turns


def _correlation(a: NDArray[np.float64], b: NDArray[np.float64]) -> float | None:
    norm = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / norm if norm > 0.0 else None


def _core_scan(scan: Scan) -> CoreScan:
    """Return the core's scan, without odometry: what lidars alone say is compared with it."""
    return CoreScan.checked(
        scan.ranges,
        angle_min=scan.angle_min,
        angle_increment=scan.angle_increment,
        angle_max=scan.angle_max,
        range_min=scan.range_min,
        range_max=scan.range_max,
        stamp=scan.stamp,
        seq=scan.seq,
        session=scan.session,
        time_increment=scan.time_increment,
        scan_time=scan.scan_time,
    )
