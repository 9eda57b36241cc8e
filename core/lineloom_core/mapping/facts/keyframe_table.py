"""What is asked of all keyframes at once, in columns: a few bytes of each, for ever."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.growing import GrowingArray
from lineloom_core.mapping.facts.keyframe import Keyframe


@storable(
    "keyframe-table",
    _names=dict[str, int],
    _robot=GrowingArray[np.int32],
    _session=GrowingArray[np.int32],
    _track=GrowingArray[np.int32],
    _seq=GrowingArray[np.int64],
    _gone=GrowingArray[np.bool_],
    _distrusted=GrowingArray[np.bool_],
)
class KeyframeTable:
    """Rows by keyframe id, from 0 on without a gap."""

    def __init__(self) -> None:
        self._names: dict[str, int] = {}
        self._robot = GrowingArray(np.int32)
        self._session = GrowingArray(np.int32)
        self._track = GrowingArray(np.int32)
        self._seq = GrowingArray(np.int64)
        self._gone = GrowingArray(np.bool_)
        self._distrusted = GrowingArray(np.bool_)

    def __len__(self) -> int:
        return len(self._robot)

    def add(self, keyframe: Keyframe) -> None:
        """Enter the next keyframe."""
        self._robot.append(self._number(keyframe.robot))
        self._session.append(self._number(keyframe.scan.session))
        self._track.append(keyframe.track)
        self._seq.append(keyframe.scan.seq)
        self._gone.append(False)
        self._distrusted.append(not keyframe.trusted)

    def is_here(self, keyframe: int) -> bool:
        """Whether a keyframe was entered, and its robot not forgotten."""
        return 0 <= keyframe < len(self) and not self._gone.rows[keyframe]

    def is_trusted(self, keyframe: int) -> bool:
        """Whether places may be made of a keyframe."""
        return not self._distrusted.rows[keyframe]

    def of(self, robot: str, session: str | None = None) -> NDArray[np.int64]:
        """Ids of a robot's keyframes, ascending; of one session or of all."""
        chosen = ~self._gone.rows & (self._robot.rows == self._names.get(robot, -1))
        if session is not None:
            chosen &= self._session.rows == self._names.get(session, -1)
        return np.flatnonzero(chosen)

    def on_track(self, keyframe: int) -> NDArray[np.int64]:
        """Ids of all keyframes on the same track, ascending."""
        same = self._track.rows == self._track.rows[keyframe]
        return np.flatnonzero(~self._gone.rows & same)

    def nearest(self, robot: str, session: str, seq: int) -> int | None:
        """The session's keyframe with the nearest sequence number, of two the older."""
        found = self.of(robot, session)
        if not len(found):
            return None
        return int(found[np.argmin(np.abs(self._seq.rows[found] - seq))])

    def distrust(self, keyframes: NDArray[np.int64]) -> None:
        """Let no place be made of these any more."""
        self._distrusted.rows[keyframes] = True

    def forget(self, keyframes: NDArray[np.int64]) -> None:
        """These are gone."""
        self._gone.rows[keyframes] = True

    def _number(self, name: str) -> int:
        return self._names.setdefault(name, len(self._names))
