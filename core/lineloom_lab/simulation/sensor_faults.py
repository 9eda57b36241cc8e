"""What goes wrong in lidars and their drivers: each fault turns a sound scan into a faulty one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.simulation.robot import SimulatedScan

Fault = Callable[[Scan], Scan]


def faulty(scans: Iterable[SimulatedScan], fault: Fault) -> Iterator[SimulatedScan]:
    """Pass every scan through a fault."""
    for simulated in scans:
        yield replace(simulated, scan=fault(simulated.scan))


def in_millimetres(scan: Scan) -> Scan:
    """Ranges and limits a thousand times too large."""
    return replace(
        scan,
        ranges=_fixed(1000.0 * scan.ranges),
        range_min=1000.0 * scan.range_min,
        range_max=1000.0 * scan.range_max,
    )


def reversed_beams(scan: Scan) -> Scan:
    """Beams in the wrong order: a mirror image."""
    return replace(scan, ranges=_fixed(scan.ranges[::-1]), angle_min=_mirrored_start(scan))


def with_increment(share: float) -> Fault:
    """Claims an increment `share` times the true one."""
    return lambda scan: replace(scan, angle_increment=share * scan.angle_increment)


def with_own_part(bearing: float, width: float, reach: float) -> Fault:
    """A part of the robot in the beams within `width` about `bearing` [rad], `reach` m away."""

    def fault(scan: Scan) -> Scan:
        inside = _within(scan, bearing, width)
        return replace(scan, ranges=_fixed(np.where(inside, reach, scan.ranges)))

    return fault


def with_blocked_sector(bearing: float, width: float) -> Fault:
    """Nothing valid ever comes from the beams within `width` about `bearing` [rad]."""

    def fault(scan: Scan) -> Scan:
        inside = _within(scan, bearing, width)
        return replace(scan, ranges=_fixed(np.where(inside, np.nan, scan.ranges)))

    return fault


def with_frozen_clock(every: int) -> Fault:
    """The clock only moves on with every so-and-so-manieth scan."""
    state = {"count": 0, "stamp": 0.0}

    def fault(scan: Scan) -> Scan:
        if state["count"] % every == 0:
            state["stamp"] = scan.stamp
        state["count"] += 1
        return replace(scan, stamp=state["stamp"])

    return fault


def frozen_from(index: int) -> Fault:
    """From the scan of that index on, its ranges are sent again and again."""
    kept: list[Scan] = []

    def fault(scan: Scan) -> Scan:
        if len(kept) <= index:
            kept.append(scan)
        return replace(scan, ranges=kept[-1].ranges)

    return fault


def _within(scan: Scan, bearing: float, width: float) -> NDArray[np.bool_]:
    off = np.abs(np.remainder(scan.angles - bearing + math.pi, math.tau) - math.pi)
    inside: NDArray[np.bool_] = off <= 0.5 * width
    return inside


def _mirrored_start(scan: Scan) -> float:
    return -(scan.angle_min + (len(scan) - 1) * scan.angle_increment)


def _fixed(ranges: NDArray[np.float64]) -> NDArray[np.float64]:
    values = np.ascontiguousarray(ranges)
    values.setflags(write=False)
    return values
