"""All checks of one robot's sensor.

Steps for every scan: 1. `prepared`: what is known to be wrong and can be mended is mended (skew
from turning where the driver times its beams, beams that see the robot itself); 2. the scan is
mapped; 3. `examine`: every check looks at the scan and at how the robot moved.

The doctor is silent where nothing can be known. A mirrored lidar alone makes a consistent map:
only odometry or other robots' maps can tell. A frozen clock does not bend a map.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.health.beams import BeamCheck
from lineloom_core.health.bending import BendingCheck
from lineloom_core.health.breaks import BreakCheck
from lineloom_core.health.clock import ClockCheck, FrozenCheck
from lineloom_core.health.codes import CodeCheck
from lineloom_core.health.finding import Finding
from lineloom_core.health.identity import IdentityCheck
from lineloom_core.health.lengths import LengthCheck
from lineloom_core.health.no_lines import NoLinesCheck
from lineloom_core.health.noise import NoiseCheck
from lineloom_core.health.riding import RidingCheck
from lineloom_core.health.sample import Sample
from lineloom_core.health.sweep import SweepCheck
from lineloom_core.health.turning import TurningCheck
from lineloom_core.health.units import UnitsCheck
from lineloom_core.scan import Scan

_DEAF = {"units", "random", "frozen", "stuck", "constant", "no-returns", "angle-increment"}
_EXPLAINED_BY = {
    "breaks": {*_DEAF, "clock-jump", "two-sources"},
    "two-sources": _DEAF,
    "no-lines": _DEAF,
    "rides-along": {"self-hits"},
    "turn-scale": {"angle-increment"},
}
"""What is but a consequence of another finding is not told beside it."""


class Check(Protocol):
    """One thing that may be wrong."""

    def examine(self, sample: Sample) -> None:
        """Look at the next scan."""

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        ...


@storable("sensor-doctor")
@dataclass
class SensorDoctor:
    """The state of all checks: deterministic, storable, a few kilobytes."""

    units: UnitsCheck = field(default_factory=UnitsCheck)
    clock: ClockCheck = field(default_factory=ClockCheck)
    frozen: FrozenCheck = field(default_factory=FrozenCheck)
    turning: TurningCheck = field(default_factory=TurningCheck)
    beams: BeamCheck = field(default_factory=BeamCheck)
    bending: BendingCheck = field(default_factory=BendingCheck)
    sweep: SweepCheck = field(default_factory=SweepCheck)
    noise: NoiseCheck = field(default_factory=NoiseCheck)
    codes: CodeCheck = field(default_factory=CodeCheck)
    riding: RidingCheck = field(default_factory=RidingCheck)
    lengths: LengthCheck = field(default_factory=LengthCheck)
    breaks: BreakCheck = field(default_factory=BreakCheck)
    no_lines: NoLinesCheck = field(default_factory=NoLinesCheck)
    identity: IdentityCheck = field(default_factory=IdentityCheck)
    _pose: Pose | None = None
    _track: int | None = None
    _odometry: Pose | None = None
    _stamp: float | None = None

    def prepared(self, scan: Scan) -> Scan:
        """Return a scan, counter-clockwise, without what is known to be false in it."""
        if self.noise.blinds or self.frozen.blinds or self.lengths.blinds:
            return _without(scan, np.ones(len(scan), dtype=np.bool_))
        false = self.codes.mask(scan.ranges, scan.angle_increment)
        own = self.beams.own
        if own is not None and len(own) == len(scan):
            false |= own
        false |= self.riding.mask(scan.ranges)
        return _without(scan, false) if false.any() else scan

    def timed(self, scan: Scan) -> Scan:
        """Return a scan, as it came, with its beams timed in seconds.

        Where nobody times them, bent walls may have told: negative if the last beam is the first.
        """
        scan = self.sweep.mended(scan)
        per_rad = self.bending.sweep_s_per_rad
        if scan.time_increment or not per_rad:
            return scan
        return replace(scan, time_increment=per_rad * abs(scan.angle_increment))

    def examine(
        self, scan: Scan, features: ScanFeatures, pose: Pose | None, track: int | None
    ) -> None:
        """Look at a scan as it came, counter-clockwise.

        features: of the scan as it was mapped. pose: T_track_laser in the track of that number,
        None where tracking failed.
        """
        step = rolled = None
        if pose is not None and self._pose is not None and track == self._track:
            step = self._pose.between(pose)
        if scan.odometry is not None and self._odometry is not None:
            rolled = self._odometry.between(scan.odometry)
        elapsed = 0.0 if self._stamp is None else scan.stamp - self._stamp
        placed = pose is not None
        began = placed and track != self._track
        sample = Sample(scan, features, step, rolled, elapsed, placed, began)
        for check in self._checks():
            check.examine(sample)
        self.bending.time_the_beams(self.sweep.usual_s)
        self._pose, self._track = pose, track if placed else self._track
        self._odometry, self._stamp = scan.odometry, scan.stamp

    def findings(self) -> tuple[Finding, ...]:
        """What is wrong now, errors first."""
        found = [finding for check in self._checks() for finding in check.findings()]
        names = {finding.name for finding in found}
        found = [f for f in found if not names & _EXPLAINED_BY.get(f.name, set())]
        order = {"error": 0, "warning": 1, "note": 2}
        return tuple(sorted(found, key=lambda finding: order[finding.severity]))

    @property
    def follows(self) -> bool:
        """Whether most scans have a place beside the ones before: else a pose means nothing."""
        return not self.breaks.is_hopeless

    @property
    def trustworthy(self) -> bool:
        """Whether the geometry may be right: false once it is certainly wrong."""
        return all(finding.severity != "error" for finding in self.findings())

    def _checks(self) -> tuple[Check, ...]:
        return (
            self.units,
            self.sweep,
            self.clock,
            self.frozen,
            self.noise,
            self.codes,
            self.riding,
            self.beams,
            self.lengths,
            self.turning,
            self.bending,
            self.identity,
            self.breaks,
            self.no_lines,
        )


def _without(scan: Scan, false: NDArray[np.bool_]) -> Scan:
    ranges = np.where(false, np.nan, scan.ranges)
    ranges.setflags(write=False)
    return replace(scan, ranges=ranges)


def without_skew(scan: Scan, turn_rate: float, *, inverted: bool = False) -> Scan:
    """Return a scan as if the robot had stood still at the time of its first beam.

    Turning at `turn_rate` [rad/s] during the sweep shifts beam i by i * time_increment * turn_rate:
    which is another increment, no more. Unchanged where the beams are not timed.
    """
    if scan.time_increment == 0.0 or turn_rate == 0.0:
        return scan
    shift = turn_rate * scan.time_increment
    return replace(scan, angle_increment=scan.angle_increment + (-shift if inverted else shift))
