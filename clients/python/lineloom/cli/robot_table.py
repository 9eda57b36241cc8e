"""Robots as a table for people."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from lineloom.wire import Robot


def robot_table(robots: Sequence[Robot]) -> Table:
    """Return one row for each robot: where it is, and what is wrong with it."""
    table = Table("robot", "component", "state", "x", "y", "theta", "scans", "health", box=None)
    for robot in robots:
        pose = robot.pose
        where = ("", "", "") if pose is None else (f"{v:.2f}" for v in (pose.x, pose.y, pose.theta))
        table.add_row(
            robot.robot,
            robot.component or "",
            robot.state,
            *where,
            str(robot.scans.processed),
            "; ".join(robot.health) or "well",
        )
    return table
