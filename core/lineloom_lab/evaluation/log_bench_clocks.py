"""Clocks that a robot may have: the same scans with other stamps must give the same map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from lineloom_core.scan import Scan
from numpy.typing import NDArray

TRUE_CLOCK = "true"
_STEADY_S = 0.1
_SEED = 14

Array = NDArray[np.float64]


def _constant(stamps: Array) -> Array:
    steady: Array = stamps[0] + _STEADY_S * np.arange(len(stamps))
    return steady


def _stopped(stamps: Array) -> Array:
    return np.full_like(stamps, stamps[0])


def _jittered(stamps: Array) -> Array:
    """Stamps off by up to a usual step either way: some are nearly equal, some go back."""
    steps = np.diff(stamps)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else _STEADY_S
    return stamps + np.random.default_rng(_SEED).uniform(-usual, usual, len(stamps))


def _scaled(factor: float, stamps: Array) -> Array:
    scaled: Array = stamps[0] + factor * (stamps - stamps[0])
    return scaled


_CLOCKS: dict[str, tuple[float, Callable[[Array], Array]]] = {
    TRUE_CLOCK: (1.0, lambda stamps: stamps),
    "constant": (1.0, _constant),
    "stopped": (1.0, _stopped),
    "jittered": (1.0, _jittered),
    **{f"x{factor:g}": (factor, partial(_scaled, factor)) for factor in (0.3, 3.0, 20.0)},
}

CLOCK_NAMES = tuple(_CLOCKS)
"""As recorded; a scan every 0.1 s whatever was recorded; all stamps equal; off by up to a usual
step; running too slow or too fast."""


def with_clock(scans: Sequence[Scan], clock: str) -> tuple[Scan, ...]:
    """Return the scans of one robot as its clock would have stamped them; one clock, one answer.

    A clock that runs too fast also measures a sweep as longer. Raises KeyError for an unknown one.
    """
    factor, restamp = _CLOCKS[clock]
    stamps = restamp(np.array([scan.stamp for scan in scans], dtype=np.float64))
    return tuple(
        replace(
            scan,
            stamp=stamp,
            time_increment=factor * scan.time_increment,
            scan_time=factor * scan.scan_time,
        )
        for scan, stamp in zip(scans, stamps.tolist(), strict=True)
    )
