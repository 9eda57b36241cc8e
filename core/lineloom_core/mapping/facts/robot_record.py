"""What the mapper remembers of one robot."""

from __future__ import annotations

from dataclasses import dataclass, field

from lineloom_core.codec import storable
from lineloom_core.health import SensorDoctor
from lineloom_core.mapping.facts.placed_scans import PlacedScan, PlacedScans
from lineloom_core.mapping.facts.robot_state import RobotState
from lineloom_core.mapping.facts.scan_name import ScanName
from lineloom_core.mapping.facts.trackers import AnyTracker
from lineloom_core.mapping.facts.unplaced_scan import UnplacedScan
from lineloom_core.scan import Mount, Scan


@storable("robot-record")
@dataclass
class RobotRecord:
    """Everything about a robot that its next scan depends on."""

    name: str
    mount: Mount = field(default_factory=Mount)
    tracker: AnyTracker | None = None
    track: int | None = None
    """Number of the track that it is on."""
    last_keyframe: int | None = None
    """The track's latest."""
    last_named: ScanName | None = None
    """The latest scan of any track that became a keyframe."""
    state: RobotState = "starting"
    session: str | None = None
    sessions: dict[str, None] = field(default_factory=dict)
    """All sessions seen, in their order."""
    seq: int | None = None
    stamp: float | None = None
    processed: int = 0
    unplaced: list[UnplacedScan] = field(default_factory=list)
    placed: PlacedScans = field(default_factory=PlacedScans)
    latest: PlacedScan | None = None
    doctor: SensorDoctor = field(default_factory=SensorDoctor)
    distrusted: str = ""
    """Why nothing of its session may be joined with other maps; empty where all is well."""
    unmet: dict[str, str] = field(default_factory=dict)
    """Constraints that an operator's word is about, and that bind nothing here: to the session
    of its scans that has no keyframe."""

    def name_next(self, scan: Scan) -> ScanName:
        """The name of the scan that becomes the next keyframe."""
        last, number = self.last_named, (scan.session, scan.seq)
        repeat = last.repeat + 1 if last and (last.session, last.seq) == number else 0
        self.last_named = ScanName(self.name, *number, repeat)
        return self.last_named

    def leave_unplaced(self, scan: Scan) -> None:
        """Remember a scan that fits nowhere."""
        self.unplaced.append(UnplacedScan(scan.session, scan.seq, scan.stamp, len(self.placed)))

    def trust_again(self) -> None:
        """Begin anew: the lidar was mounted otherwise, or its driver restarted."""
        self.doctor, self.distrusted = SensorDoctor(), ""

    @property
    def health(self) -> tuple[str, ...]:
        """What an operator should know, in plain words, the worst first."""
        findings = [str(finding) for finding in self.doctor.findings()]
        if self.distrusted:
            findings.append(
                f"not-joined: this robot's map stays by itself because of {self.distrusted}"
            )
        findings += [
            f"no-effect: what was said of constraint {name} changes nothing: no keyframe was made "
            f"of its session {session!r}"
            for name, session in self.unmet.items()
        ]
        return tuple(findings)
