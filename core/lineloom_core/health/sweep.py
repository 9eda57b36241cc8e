"""Times in another unit than seconds: stamps, `time_increment` and `scan_time`.

A lidar that turns once between two scans cannot take longer for its beams than from one stamp to
the next, whatever it is; scans that are lost on the way only make that longer. A stamp counts
seconds: as many as since 1970 are ten digits, and a robot that drives at a millimetre a second has
a clock in milliseconds.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace

from lineloom_core.codec import storable
from lineloom_core.health.finding import Finding
from lineloom_core.health.sample import Sample
from lineloom_core.scan import Scan

_WINDOW = 31
_LEAST_GAPS = 10
_TOO_LONG, _TOO_LONG_SCAN = 1.5, 3.0
_UNITS = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}
_LEAST_COVERED = 0.05
_YEAR_5138 = 1e11
_PAUSE_S, _SLOW, _LEAST_WAY_M = 20.0, 0.02, 0.5
_JUMP_S, _BACK_S, _TOLD = 86_400.0, 10.0, 200


@storable("sweep-check")
@dataclass
class SweepCheck:
    """The last time steps that went forward [s], and how far the robot drove meanwhile [m].

    jump: the last one that no robot waits for [s], and how many scans ago.
    """

    gaps: deque[float] = field(default_factory=lambda: deque(maxlen=_WINDOW))
    ways: deque[float] = field(default_factory=lambda: deque(maxlen=_WINDOW))
    stamp: float = 0.0
    increment_s: float = 0.0
    sweep_s: float = 0.0
    scan_time: float = 0.0
    jump: tuple[float, int] = (0.0, 0)

    def mended(self, scan: Scan) -> Scan:
        """Return a scan with its beams timed in seconds, or not at all where that cannot be."""
        sweep = scan.time_increment * (len(scan) - 1)
        if sweep == 0.0 or not self.gaps or sweep <= _TOO_LONG * self.usual_s:
            return scan
        unit = self._unit(sweep)
        return replace(scan, time_increment=0.0 if unit is None else scan.time_increment / unit)

    @property
    def usual_s(self) -> float:
        """What passes from scan to scan [s], 0 before it is known."""
        return sorted(self.gaps)[len(self.gaps) // 2] if self.gaps else 0.0

    def examine(self, sample: Sample) -> None:
        """Look at the next scan's times."""
        scan, gap = sample.scan, sample.elapsed_s
        known, self.stamp = self.stamp != 0.0, scan.stamp
        self.increment_s, self.scan_time = scan.time_increment, scan.scan_time
        self.sweep_s = scan.time_increment * (len(scan) - 1)
        self.jump = (self.jump[0], self.jump[1] + 1)
        if gap > 0.0:
            self.gaps.append(gap)
            self.ways.append(sample.moved_m)
        if known and len(self.gaps) >= _LEAST_GAPS and not -_BACK_S <= gap <= self._longest():
            self.jump = (gap, 0)

    def _longest(self) -> float:
        return max(_JUMP_S, 1000.0 * self.usual_s)

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        if len(self.gaps) < _LEAST_GAPS:
            return []
        stamps = self._stamps()
        # Nothing can be measured by a clock that is wrong itself.
        return [stamps] if stamps else [*self._increment(), *self._scan_time(), *self._jumped()]

    def _stamps(self) -> Finding | None:
        gap, way = self.usual_s, sum(self.ways)
        if abs(self.stamp) > _YEAR_5138:
            said = f"a stamp of {self.stamp:.3g} s is thousands of years from now"
            power = 3 * round((math.log10(abs(self.stamp)) - 9.0) / 3.0)
            unit = _UNITS.get(10.0**power, "another unit")
        elif gap > _PAUSE_S and way > _LEAST_WAY_M and way < _SLOW * sum(self.gaps):
            said = f"stamps are {gap:.3g} s apart, and {way:.1f} m were driven in {len(self.gaps)}"
            unit = _UNITS[1e3 if gap < 2e3 else 1e6 if gap < 2e6 else 1e9]
        else:
            return None
        return Finding(
            "stamp-units",
            "warning",
            f"{said}: stamps are in {unit}, it seems; send seconds. Speeds and turning during the "
            "sweep are not known meanwhile",
        )

    def _increment(self) -> list[Finding]:
        if self.sweep_s <= _TOO_LONG * self.usual_s:
            return []
        unit = self._unit(self.sweep_s)
        it_is = "is wrong and not used; send seconds from beam to beam, or 0"
        if unit is not None:
            it_is = f"is in {_UNITS[unit]}, it seems, and is taken so; send seconds"
        return [
            Finding(
                "time-increment",
                "warning",
                f"time_increment {self.increment_s:.4g} makes a sweep of {self.sweep_s:.3g} s, yet "
                f"scans are {self.usual_s:.3g} s apart: it {it_is}",
            )
        ]

    def _scan_time(self) -> list[Finding]:
        if self.scan_time <= _TOO_LONG_SCAN * self.usual_s or self._unit(self.scan_time) is None:
            return []
        return [
            Finding(
                "scan-time",
                "note",
                f"scan_time is {self.scan_time:.4g}, yet scans are {self.usual_s:.3g} s apart: "
                "send seconds, or 0. The map does not depend on it",
            )
        ]

    def _jumped(self) -> list[Finding]:
        gap, ago = self.jump
        if gap == 0.0 or ago > _TOLD:
            return []
        way = "on" if gap > 0.0 else "back"
        return [
            Finding(
                "clock-jump",
                "warning",
                f"stamps jumped {way} by {abs(gap):.0f} s {ago} scans ago within one session: the "
                "robot's clock was set, it seems; the track breaks there. Set the clock before "
                "the driver starts, or begin another session",
            )
        ]

    def _unit(self, seconds: float) -> float | None:
        """The one power of a thousand by which a time is too long; None where none explains it."""
        for unit in _UNITS:
            if _LEAST_COVERED * self.usual_s < seconds / unit <= _TOO_LONG * self.usual_s:
                return unit
        return None
