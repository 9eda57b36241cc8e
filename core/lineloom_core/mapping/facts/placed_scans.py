"""All scans of a robot that have a pose, in the order of their processing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose
from lineloom_core.growing import GrowingArray

BLOCK = 1024
"""Scans in a block; small enough for the last one to be written again with every view."""


@storable("placed-scan")
@dataclass(frozen=True, slots=True)
class PlacedScan:
    """A processed scan, fixed to the keyframe it was tracked against."""

    session: str
    seq: int
    stamp: float
    keyframe: int
    T_keyframe_laser: Pose


@storable("scan-block")
@dataclass(frozen=True, eq=False, slots=True)
class ScanBlock:
    """Up to `BLOCK` placed scans one after another, in columns of n; a full one never changes.

    session: number of each scan's in `sessions`. steps: (n, 3), T_keyframe_laser as x, y, theta.
    """

    sessions: tuple[str, ...]
    session: NDArray[np.int32]
    seq: NDArray[np.int64]
    stamp: NDArray[np.float64]
    keyframe: NDArray[np.int64]
    steps: NDArray[np.float64]


@storable(
    "placed-scans",
    _full=list[ScanBlock],
    _names=dict[str, int],
    _session=GrowingArray[np.int32],
    _seq=GrowingArray[np.int64],
    _stamp=GrowingArray[np.float64],
    _keyframe=GrowingArray[np.int64],
    _steps=GrowingArray[np.float64],
)
class PlacedScans:
    """Columns, not objects: every scan for ever has a row, of 52 bytes."""

    def __init__(self) -> None:
        self._full: list[ScanBlock] = []
        self._names: dict[str, int] = {}
        self._begin()

    def _begin(self) -> None:
        self._session = GrowingArray(np.int32)
        self._seq = GrowingArray(np.int64)
        self._stamp = GrowingArray(np.float64)
        self._keyframe = GrowingArray(np.int64)
        self._steps = GrowingArray(np.float64, (3,))

    def __len__(self) -> int:
        return BLOCK * len(self._full) + len(self._seq)

    def append(self, scan: PlacedScan) -> None:
        """Add one."""
        T = scan.T_keyframe_laser
        self._session.append(self._names.setdefault(scan.session, len(self._names)))
        self._seq.append(scan.seq)
        self._stamp.append(scan.stamp)
        self._keyframe.append(scan.keyframe)
        self._steps.append((T.x, T.y, T.theta))
        if len(self._seq) == BLOCK:
            self._full.append(self._last())
            self._begin()

    def find(self, session: str, seq: int) -> PlacedScan | None:
        """The placed scan of a number; None where there is none."""
        number = self._names.get(session, -1)
        for b in self.blocks():
            rows = np.flatnonzero((b.session == number) & (b.seq == seq))
            if len(rows):
                i = int(rows[0])
                T = Pose(*b.steps[i].tolist())
                return PlacedScan(session, seq, float(b.stamp[i]), int(b.keyframe[i]), T)
        return None

    def blocks(self) -> tuple[ScanBlock, ...]:
        """All scans; full blocks are the same objects each time."""
        return (*self._full, self._last()) if len(self._seq) else tuple(self._full)

    def _last(self) -> ScanBlock:
        return ScanBlock(
            tuple(self._names),
            self._session.rows.copy(),
            self._seq.rows.copy(),
            self._stamp.rows.copy(),
            self._keyframe.rows.copy(),
            self._steps.rows.copy(),
        )
