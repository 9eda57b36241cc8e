"""Scans of two sources in one stream: two lidars of a robot, or two robots under one name.

Each scan is held against the last ones of the sources that the stream seems to have. One source
goes on from its own last scan; where scans go back and forth between two that do not look alike,
each is followed by itself.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose
from lineloom_core.health import _kernels as kernels
from lineloom_core.health.finding import Finding, Severity
from lineloom_core.health.sample import Sample
from lineloom_core.scan import Scan

_SECTORS = 72
_SHIFTS = 6
_FAR_M = 1.5
"""Two ranges differ by no more than this: what comes into view counts so."""

_LEAST_COMMON = _SECTORS // 4

_LEAST_APART_M = 0.12
_NEARER = 0.4
"""The other source's last scan is nearer than this share of how far the one before is."""

_ALIKE_M = 0.4
_JUMP_M = 1.0
_WINDOW = 150
_LEAST_BACK = 3
_SURE_BACK = 6
"""From one to the other and back. After spoilt scans all switches go to the same source."""

_STALE = 40
"""Scans after which a source that did not go on is none."""


@storable("scan-source")
@dataclass
class _Source:
    """profile: mean range of each sector, NaN without any. age: scans since it went on."""

    number: int
    profile: NDArray[np.float64]
    odometry: Pose | None
    age: int = 0


@storable("identity-check")
@dataclass
class IdentityCheck:
    """Sources, the one that went on last first; of the last scans, which went on from another.

    switches: to which source's number each scan went over, 0 where the last one goes on; jumps:
    how many of the last ones went where the odometry did as well.
    """

    sources: list[_Source] = field(default_factory=list)
    switches: deque[int] = field(default_factory=lambda: deque(maxlen=_WINDOW))
    jumps: deque[bool] = field(default_factory=lambda: deque(maxlen=_SURE_BACK))
    numbered: int = 0

    def examine(self, sample: Sample) -> None:
        """Look at the next scan."""
        scan = sample.scan
        profile = _profile(scan)
        if np.count_nonzero(np.isfinite(profile)) < _SECTORS // 6:
            return
        for source in self.sources:
            source.age += 1
        self.sources = [s for s in self.sources if s.age <= _STALE]
        found = self._goes_on(profile)
        switched = found is not None and found is not self.sources[0]
        if found is not None and switched:
            self.jumps.append(_jumps(scan.odometry, self.sources[0].odometry, found.odometry))
        if found is None:
            self.numbered += 1
        number = self.numbered if found is None else found.number
        self.switches.append(number if switched else 0)
        rest = [source for source in self.sources if source is not found]
        self.sources = [_Source(number, profile, scan.odometry), *rest][:2]

    def _goes_on(self, profile: NDArray[np.float64]) -> _Source | None:
        """Return which source the scan goes on from, None: it begins another one."""
        if not self.sources:
            return None
        apart = [_apart(profile, source.profile) for source in self.sources]
        if apart[0] < _LEAST_APART_M:
            return self.sources[0]
        if len(apart) > 1 and apart[1] < min(_ALIKE_M, _NEARER * apart[0]):
            return self.sources[1]
        return None if apart[0] > 2.0 * _LEAST_APART_M else self.sources[0]

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        to = [number for number in self.switches if number]
        back = sum(a == c != b for a, b, c in zip(to, to[1:], to[2:], strict=False))
        if back < _LEAST_BACK:
            return []
        said = (
            f"{len(to)} of the last {len(self.switches)} scans go on from an earlier one, "
            "not from the scan before, which looks different: two sources send in turn. "
        )
        if 2 * sum(self.jumps) > _SURE_BACK:
            said += (
                "Their odometry goes back and forth as well, so two robots send under this name: "
                "give each its own"
            )
        else:
            said += (
                "Two lidars of one robot (send each as a robot of its own), or two robots under "
                "one name (give each its own)"
            )
        severity: Severity = "error" if back >= _SURE_BACK else "warning"
        return [Finding("two-sources", severity, said)]


def _jumps(now: Pose | None, last: Pose | None, other: Pose | None) -> bool:
    """Whether the odometry as well goes on from the other's and not from the last one's."""
    if now is None or last is None or other is None:
        return False
    away = math.hypot(now.x - last.x, now.y - last.y)
    return away > _JUMP_M and math.hypot(now.x - other.x, now.y - other.y) < _NEARER * away


def _profile(scan: Scan) -> NDArray[np.float64]:
    """Return the mean range in each sector around the lidar [m]."""
    found: NDArray[np.float64] = kernels.profile(
        scan.ranges, scan.angle_min, scan.angle_increment, _SECTORS
    )
    return found


def _apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return how far two profiles are apart, turned so that they fit best [m].

    Where both see something: of a scan that lost some of its beams the rest is what it was.
    """
    return float(kernels.profiles_apart(a, b, _SHIFTS, _FAR_M, _LEAST_COMMON))
