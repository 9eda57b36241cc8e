"""Other lidars made of the one that recorded a scan: fewer beams, less reach, more noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from lineloom_core.scan import Scan
from numpy.typing import NDArray

AS_RECORDED = "as recorded"


@dataclass(frozen=True, slots=True)
class DerivedLidar:
    """A lidar by name, and what it would have made of a scan; random numbers are its own."""

    name: str
    of: Callable[[Scan, np.random.Generator], Scan]


def _with_ranges(scan: Scan, ranges: NDArray[np.float64]) -> Scan:
    ranges = np.ascontiguousarray(ranges)
    ranges.setflags(write=False)
    return replace(scan, ranges=ranges)


def _recorded(scan: Scan, rng: np.random.Generator) -> Scan:
    return scan


def _every(step: int) -> DerivedLidar:
    def thinned(scan: Scan, rng: np.random.Generator) -> Scan:
        fewer = _with_ranges(scan, scan.ranges[::step])
        return replace(fewer, angle_increment=step * scan.angle_increment)

    return DerivedLidar(f"1 of {step} beams", thinned)


def _reaching(metres: float) -> DerivedLidar:
    def cut(scan: Scan, rng: np.random.Generator) -> Scan:
        if scan.range_max <= metres:
            return scan
        near = _with_ranges(scan, np.where(scan.ranges < metres, scan.ranges, np.nan))
        return replace(near, range_max=metres)

    return DerivedLidar(f"{metres:.0f} m", cut)


def _seeing(degrees: float) -> DerivedLidar:
    def cut(scan: Scan, rng: np.random.Generator) -> Scan:
        kept = int(math.radians(degrees) / abs(scan.angle_increment)) + 1
        first = max((len(scan) - kept) // 2, 0)
        narrow = _with_ranges(scan, scan.ranges[first : first + kept])
        return replace(narrow, angle_min=scan.angle_min + first * scan.angle_increment)

    return DerivedLidar(f"{degrees:.0f}°", cut)


def _noisier(sigma: float) -> DerivedLidar:
    def shaken(scan: Scan, rng: np.random.Generator) -> Scan:
        noise = rng.normal(0.0, sigma, len(scan))
        known = np.isfinite(scan.ranges)
        moved = np.clip(scan.ranges + noise, scan.range_min, np.nextafter(scan.range_max, 0.0))
        return _with_ranges(scan, np.where(known, moved, scan.ranges))

    return DerivedLidar(f"+ {1e3 * sigma:.0f} mm", shaken)


def _losing(share: float) -> DerivedLidar:
    def holed(scan: Scan, rng: np.random.Generator) -> Scan:
        return _with_ranges(scan, np.where(rng.random(len(scan)) < share, np.nan, scan.ranges))

    return DerivedLidar(f"− {100 * share:.0f} % of beams", holed)


RECORDED = DerivedLidar(AS_RECORDED, _recorded)
DERIVED = (
    _every(2), _every(4), _reaching(6.0), _reaching(10.0), _reaching(30.0), _seeing(90.0),
    _seeing(57.0), _noisier(0.01), _noisier(0.03), _losing(0.05), _losing(0.3),
)  # fmt: skip
