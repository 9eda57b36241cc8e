"""A trajectory, or the map's lines, as a table of comma-separated values."""

from __future__ import annotations

import csv
import io

from lineloom_core.io.selection import BBox, select
from lineloom_core.mapping.answers.site_view import SiteView, TrajectoryView

MAP_COLUMNS = (
    *("id", "component", "x1", "y1", "x2", "y2"),
    *("sigma", "support", "robots", "first_seen", "last_seen"),
)
COLUMNS = ("session", "seq", "stamp", "component", "x", "y", "theta")


_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def write_trajectory(trajectory: TrajectoryView) -> str:
    """Return a header and one row per scan, in processing order (s, m, rad; full precision).

    Component and pose of a scan that fitted nowhere are empty. A session whose name a spreadsheet
    would take for a formula has an apostrophe before it.
    """
    target = io.StringIO()
    writer = csv.writer(target, lineterminator="\n")
    writer.writerow(COLUMNS)
    for session, seq, stamp, component, pose in trajectory.rows():
        figures = ("", "", "") if pose is None else map(repr, pose)
        writer.writerow((_text(session), seq, repr(stamp), component or "", *figures))
    return target.getvalue()


def write_map(
    view: SiteView, component: str | None = None, bbox: BBox | None = None, site: str = ""
) -> str:
    """Return a header and one row per line of the map (m, s; full precision).

    `robots` are separated by spaces: their names hold none. Raises as `selection.select` does.
    """
    target = io.StringIO()
    writer = csv.writer(target, lineterminator="\n")
    writer.writerow(MAP_COLUMNS)
    for content in select(view, component, bbox):
        for w in content.lines:
            figures = [repr(v) for v in (w.x1, w.y1, w.x2, w.y2, w.sigma)]
            seen = (" ".join(w.robots), repr(w.first_seen), repr(w.last_seen))
            writer.writerow((w.id, w.component, *figures, w.support, *seen))
    return target.getvalue()


def _text(value: str) -> str:
    """Return a text that no spreadsheet takes for a formula."""
    return f"'{value}" if value[:1] in _FORMULA else value
