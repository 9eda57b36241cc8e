"""The closed path through a running service: posted, waited for, read back."""

from __future__ import annotations

import secrets
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from lineloom.cli.console import note
from lineloom.cli.failure import CommandError, Exit
from lineloom.cli.patience import patient, require_ready
from lineloom.client import Client
from lineloom.wire import MapAnswer, TrajectoryPose

if TYPE_CHECKING:
    import numpy as np
    from lineloom_core.geometry import Pose
    from lineloom_lab.experiments import Report, Settings
    from lineloom_lab.experiments.recording import Recording
    from lineloom_lab.experiments.served_path import Answered
    from numpy.typing import NDArray

ROBOT = "robot"
MATCHERS = {"thesis": "thesis", "default": "lineloom"}
"""Who takes part, to the value of the mapper's parameter `matcher`."""


@dataclass(frozen=True)
class Service:
    """Where, how long to wait at the end [s], and how many scans if not the experiment's own."""

    url: str
    token: str | None
    timeout: float
    scans: int | None

    def run(self, name: str, settings: Settings) -> Report:
        """Run one experiment, a new site for each matcher; the sites stay to be looked at."""
        from lineloom_lab.experiments.served_path import ServedPath
        from lineloom_lab.experiments.served_report import served_report

        recording = self._recording(name, settings)
        runs = []
        with Client(self.url, token=self.token, retry=patient()) as client:
            require_ready(client)
            for c in settings.contestants():
                site = f"{name}-{len(recording)}-{c.key}-{secrets.token_hex(3)}"
                note(f"{name}: {c.label}, site {site} …")
                answered = _answered(client, site, MATCHERS[c.key], recording, self.timeout)
                runs.append(ServedPath(c.key, c.label, c.colour, recording, answered))
        return served_report(name, settings.seed, runs)

    def _recording(self, name: str, settings: Settings) -> Recording:
        from lineloom_lab.experiments.path_experiment import QUICK_SHARE
        from lineloom_lab.experiments.recording import (
            CLOSED_PATH_SCANS,
            SPARSE_PATH_SCANS,
            closed_path,
        )

        usual = {"closed-path": CLOSED_PATH_SCANS, "sparse-path": SPARSE_PATH_SCANS}
        if name not in usual:
            known = " and ".join(usual)
            raise CommandError(f"{name} does not run through a service: {known} do", Exit.USAGE)
        part = settings.quick and name == "closed-path" and self.scans is None
        share = QUICK_SHARE if part else 1.0
        return closed_path(settings.seed, self.scans or usual[name], share)


def _answered(
    client: Client, site: str, matcher: str, recording: Recording, timeout: float
) -> Answered:
    from lineloom_lab.experiments.served_path import Answered

    client.set_config(site, {"matcher": matcher})
    begin = time.monotonic()
    answer = client.post_scans(site, ROBOT, recording.scans)
    if answer.rejected:
        raise CommandError(
            f"the service refused {len(answer.rejected)} scans: {answer.rejected[0]}"
        )
    client.wait_until_idle(site, timeout)
    seconds = time.monotonic() - begin
    placed = {pose.seq: pose for pose in client.trajectory(site, ROBOT).poses}
    found = [placed[scan.seq] for scan in recording.scans]
    poses = tuple(_pose(at) for at in found)
    return Answered(tuple(at.component for at in found), poses, _lines(client.map(site)), seconds)


def _pose(at: TrajectoryPose) -> Pose | None:
    from lineloom_core.geometry import Pose

    return None if at.pose is None else Pose(*at.pose)


def _lines(found: MapAnswer) -> dict[str, NDArray[np.float64]]:
    import numpy as np

    rows: dict[str, list[tuple[float, ...]]] = {}
    for line in found.lines:
        rows.setdefault(line.component, []).append((line.x1, line.y1, line.x2, line.y2))
    return {component: np.array(lines) for component, lines in rows.items()}
