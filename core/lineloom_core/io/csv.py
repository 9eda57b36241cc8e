"""A trajectory as a table of comma-separated values."""

from __future__ import annotations

import csv
import io

from lineloom_core.mapping.site_view import TrajectoryView

COLUMNS = ("session", "seq", "stamp", "component", "x", "y", "theta")


def write_trajectory(trajectory: TrajectoryView) -> str:
    """Return a header and one row per pose, in processing order (s, m, rad; full precision)."""
    target = io.StringIO()
    writer = csv.writer(target, lineterminator="\n")
    writer.writerow(COLUMNS)
    for session, seq, stamp, component, (x, y, theta) in zip(
        trajectory.session,
        trajectory.seq.tolist(),
        trajectory.stamp.tolist(),
        trajectory.component,
        trajectory.poses.tolist(),
        strict=True,
    ):
        writer.writerow((session, seq, repr(stamp), component, repr(x), repr(y), repr(theta)))
    return target.getvalue()
