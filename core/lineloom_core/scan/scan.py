"""A laser scan as `sensor_msgs/LaserScan` means it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose

MAX_BEAMS = 20_000
"""More beams than any 2D lidar has; a longer list is a mistake of the sender."""

_FULL_TURN_TOLERANCE_RAD = math.radians(5.0)


class InvalidScanError(ValueError):
    """A scan that cannot mean anything. `field` names what is wrong, `reason` says why."""

    def __init__(self, field: str, reason: str) -> None:
        super().__init__(f"{field}: {reason}")
        self.field = field
        self.reason = reason


@storable("scan")
@dataclass(frozen=True, eq=False)
class Scan:
    """One sweep. SI units and radians, in the laser's frame (REP-103).

    ranges: float64, shape (n,), C-contiguous. After REP-117: NaN = invalid measurement (unknown),
        +inf = no return, -inf = closer than the lidar can measure. Everything else lies in
        [range_min, range_max). Only finite values are evidence of anything.
    angle_min: direction of beam 0. angle_increment: never 0, negative for a clockwise sweep.
    stamp: seconds on the robot's own clock, time of the first beam.
    odometry: pose of the base in the robot's own `odom` frame, or None.
    """

    ranges: NDArray[np.float64]
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    stamp: float
    seq: int = 0
    session: str = "0"
    time_increment: float = 0.0
    scan_time: float = 0.0
    odometry: Pose | None = None

    @staticmethod
    def checked(
        ranges: ArrayLike,
        *,
        angle_min: float,
        angle_increment: float,
        range_min: float,
        range_max: float,
        stamp: float,
        seq: int = 0,
        session: str = "0",
        angle_max: float | None = None,
        time_increment: float = 0.0,
        scan_time: float = 0.0,
        odometry: Pose | None = None,
    ) -> Scan:
        """Build a scan from raw values, or raise InvalidScanError naming the field.

        `ranges` may hold anything a driver sends: NaN stays NaN; a value >= range_max becomes
        +inf; a value below range_min becomes -inf.
        """
        numbers = {
            "angle_min": angle_min,
            "angle_increment": angle_increment,
            "range_min": range_min,
            "range_max": range_max,
            "stamp": stamp,
            "time_increment": time_increment,
            "scan_time": scan_time,
        }
        for name, value in numbers.items():
            if not math.isfinite(value):
                raise InvalidScanError(name, "must be a finite number")
        _check_limits(range_min, range_max, time_increment, scan_time, seq)
        values = _as_numbers(ranges)
        _check_beams(values, angle_increment, angle_min, angle_max)
        if odometry is not None and not np.all(np.isfinite(odometry.to_array())):
            raise InvalidScanError("odometry", "x, y and theta must be finite numbers")
        with np.errstate(invalid="ignore"):
            values[values >= range_max] = np.inf
            values[values < range_min] = -np.inf
        values.setflags(write=False)
        return Scan(
            ranges=values,
            angle_min=angle_min,
            angle_increment=angle_increment,
            range_min=range_min,
            range_max=range_max,
            stamp=stamp,
            seq=seq,
            session=session,
            time_increment=time_increment,
            scan_time=scan_time,
            odometry=odometry,
        )

    def __len__(self) -> int:
        return int(self.ranges.shape[0])

    @property
    def angles(self) -> NDArray[np.float64]:
        """Directions of the beams [rad], shape (n,), not wrapped."""
        return np.float64(self.angle_min) + self.angle_increment * np.arange(
            len(self), dtype=np.float64
        )

    def counter_clockwise(self, *, inverted: bool = False) -> Scan:
        """Return the same sweep with a positive increment; `inverted` mirrors it first.

        Feature extraction relies on the counter-clockwise order (thesis §4.3).
        """
        angle_min, increment = self.angle_min, self.angle_increment
        if inverted:
            angle_min, increment = -angle_min, -increment
        if increment > 0:
            return replace(self, angle_min=angle_min, angle_increment=increment)
        last = angle_min + increment * (len(self) - 1)
        ranges = np.ascontiguousarray(self.ranges[::-1])
        ranges.setflags(write=False)
        return replace(self, ranges=ranges, angle_min=last, angle_increment=-increment)

    def points(self) -> NDArray[np.float64]:
        """Return the finite returns as points in the laser frame, shape (m, 2) [m] (§3.1.3)."""
        hit = np.isfinite(self.ranges)
        r, a = self.ranges[hit], self.angles[hit]
        return np.column_stack([r * np.cos(a), r * np.sin(a)])


def _as_numbers(ranges: ArrayLike) -> NDArray[np.float64]:
    """Return a copy as float64: the caller keeps its own."""
    try:
        return np.array(ranges, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidScanError("ranges", "must be a list of numbers") from None


def _check_limits(
    range_min: float, range_max: float, time_increment: float, scan_time: float, seq: int
) -> None:
    if range_min < 0.0:
        raise InvalidScanError("range_min", "must not be negative")
    if range_max <= range_min:
        raise InvalidScanError("range_max", "must be greater than range_min")
    if time_increment < 0.0:
        raise InvalidScanError("time_increment", "must not be negative")
    if scan_time < 0.0:
        raise InvalidScanError("scan_time", "must not be negative")
    if seq < 0:
        raise InvalidScanError("seq", "must not be negative")


def _check_beams(
    ranges: NDArray[np.float64], increment: float, angle_min: float, angle_max: float | None
) -> None:
    if ranges.ndim != 1 or ranges.shape[0] == 0:
        raise InvalidScanError("ranges", "must hold at least one value")
    if ranges.shape[0] > MAX_BEAMS:
        raise InvalidScanError("ranges", f"holds {ranges.shape[0]} values, more than {MAX_BEAMS}")
    if increment == 0.0:
        raise InvalidScanError("angle_increment", "must not be 0")
    if abs(angle_min) > 2.0 * math.tau:
        raise InvalidScanError("angle_min", "is more than two turns: is it in degrees?")
    sweep = abs(increment) * (ranges.shape[0] - 1)
    if sweep > math.tau + _FULL_TURN_TOLERANCE_RAD:
        raise InvalidScanError(
            "angle_increment",
            f"{ranges.shape[0]} beams at this increment sweep {math.degrees(sweep):.1f} degrees, "
            "more than a full turn",
        )
    if angle_max is not None:
        if not math.isfinite(angle_max):
            raise InvalidScanError("angle_max", "must be a finite number")
        expected = angle_min + increment * (ranges.shape[0] - 1)
        if abs(expected - angle_max) > 0.5 * abs(increment) * (1.0 + 1e-6):
            raise InvalidScanError(
                "angle_max",
                f"disagrees with {ranges.shape[0]} ranges: angle_min + (n - 1) * angle_increment "
                f"= {expected:.6f}",
            )
