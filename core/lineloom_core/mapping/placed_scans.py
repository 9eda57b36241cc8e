"""All scans of a robot that have a pose, in the order of their processing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.graph.growing import GrowingArray


@dataclass(frozen=True, slots=True)
class PlacedScan:
    """A processed scan, fixed to the keyframe it was tracked against."""

    session: str
    seq: int
    stamp: float
    keyframe: int
    T_keyframe_laser: Pose


class PlacedScans:
    """Columns, not objects: every scan for ever has a row, of 56 bytes."""

    def __init__(self) -> None:
        self._names: dict[str, int] = {}
        self._session = GrowingArray(np.int64)
        self._seq = GrowingArray(np.int64)
        self._stamp = GrowingArray(np.float64)
        self._keyframe = GrowingArray(np.int64)
        self._steps = GrowingArray(np.float64, (3,))

    def __len__(self) -> int:
        return len(self._seq)

    def append(self, scan: PlacedScan) -> None:
        """Add one."""
        T = scan.T_keyframe_laser
        self._session.append(self._names.setdefault(scan.session, len(self._names)))
        self._seq.append(scan.seq)
        self._stamp.append(scan.stamp)
        self._keyframe.append(scan.keyframe)
        self._steps.append((T.x, T.y, T.theta))

    @property
    def sessions(self) -> tuple[str, ...]:
        """Session of each scan."""
        return names_of(list(self._names), self._session.rows)

    @property
    def seq(self) -> NDArray[np.int64]:
        """Sequence number of each scan, shape (n,); a copy."""
        return self._seq.rows.copy()

    @property
    def stamps(self) -> NDArray[np.float64]:
        """Stamp of each scan on its robot's clock [s], shape (n,); a copy."""
        return self._stamp.rows.copy()

    @property
    def keyframes(self) -> NDArray[np.int64]:
        """Keyframe that each scan is fixed to, shape (n,)."""
        return self._keyframe.rows

    @property
    def steps(self) -> NDArray[np.float64]:
        """T_keyframe_laser of each scan as x, y, theta, shape (n, 3)."""
        return self._steps.rows


def names_of(names: list[str], numbers: NDArray[np.int64]) -> tuple[str, ...]:
    """The name for each number."""
    return tuple(np.array(names, dtype=object)[numbers].tolist()) if names else ()
