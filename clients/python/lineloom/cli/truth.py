"""How right a merge is: the robots' trajectories against the simulator's truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

from rich.table import Table

from lineloom.cli.failure import CommandError, Exit
from lineloom.client import Client
from lineloom.wire import Robot

Row = tuple[float, float, float]


@dataclass(frozen=True)
class PairError:
    """Both trajectories, aligned as one body to the truth. Metres."""

    robots: tuple[str, str]
    rmse: float
    max: float


@dataclass
class Truth:
    """True poses by robot and seq, and the errors of a map against them."""

    poses: dict[str, dict[int, Row]] = field(default_factory=dict)

    def note(self, robot: str, seq: int, pose: Row) -> None:
        """Remember where a scan was really taken."""
        self.poses.setdefault(robot, {})[seq] = pose

    def errors(self, client: Client, site: str, component: str) -> list[PairError]:
        """Return the error of each pair of robots in the component."""
        rows = {robot: self._rows(client, site, robot, component) for robot in sorted(self.poses)}
        return [
            self._pair(a, b, rows[a], rows[b])
            for a, b in combinations(rows, 2)
            if rows[a] and rows[b]
        ]

    def _rows(self, client: Client, site: str, robot: str, component: str) -> list[tuple[Row, Row]]:
        known = self.poses[robot]
        return [
            (pose, known[scan.seq])
            for scan in client.trajectory(site, robot).poses
            if scan.component == component and scan.seq in known and (pose := scan.pose)
        ]

    @staticmethod
    def _pair(
        a: str, b: str, rows_a: Sequence[tuple[Row, Row]], rows_b: Sequence[tuple[Row, Row]]
    ) -> PairError:
        import numpy as np
        from lineloom_lab.evaluation.trajectory import trajectory_error

        both = np.array([*rows_a, *rows_b])
        error = trajectory_error(both[:, 0], both[:, 1])
        return PairError((a, b), error.rmse, error.max)


def common_component(robots: Sequence[Robot]) -> str | None:
    """Return the component that all robots are in, or None where they are not in one."""
    components = {robot.component for robot in robots}
    return components.pop() if len(components) == 1 else None


def table(errors: Sequence[PairError]) -> Table:
    """Return the errors for people."""
    shown = Table("robots", "rmse [m]", "max [m]", box=None, padding=(0, 2, 0, 0))
    for error in errors:
        shown.add_row(" + ".join(error.robots), f"{error.rmse:.3f}", f"{error.max:.3f}")
    return shown


def not_merged(groups: Mapping[str | None, Sequence[str]]) -> CommandError:
    """Return the error of robots that did not come together."""
    parts = "; ".join(", ".join(robots) for robots in groups.values())
    return CommandError(
        f"the robots did not come together: {len(groups)} components ({parts}). "
        "Let them drive longer with --duration",
        Exit.NEGATIVE,
    )
