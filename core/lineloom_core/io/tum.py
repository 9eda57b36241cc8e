"""A trajectory in the text format of the TUM RGB-D benchmark, as evo and others read it."""

from __future__ import annotations

import math

from lineloom_core.mapping.answers.site_view import TrajectoryView


def write_trajectory(trajectory: TrajectoryView) -> str:
    """Return one row `stamp tx ty tz qx qy qz qw` per pose, in processing order.

    Stamps in seconds, positions in metres, the rotation about z as a unit quaternion; full
    precision. A comment line names component and session wherever they change: poses of different
    components are in unrelated frames. Scans that fitted nowhere have no row: the format knows none
    without a pose.
    """
    rows = ["# timestamp tx ty tz qx qy qz qw"]
    before: tuple[str, str] | None = None
    for session, component, stamp, (x, y, theta) in zip(
        trajectory.session,
        trajectory.component,
        trajectory.stamp.tolist(),
        trajectory.poses.tolist(),
        strict=True,
    ):
        if (component, session) != before:
            rows.append(f"# component {component} session {session}")
            before = (component, session)
        qz, qw = math.sin(theta / 2.0), math.cos(theta / 2.0)
        rows.append(f"{stamp!r} {x!r} {y!r} 0 0 0 {qz!r} {qw!r}")
    return "\n".join(rows) + "\n"
