"""Keyframes that were let go (`thinning`): each lies fixed to one of its track that stayed."""

from __future__ import annotations

from array import array

import numpy as np

from lineloom_core.geometry import Pose
from lineloom_core.graph.growing import GrowingArray

_NOTHING = -1


class Resting:
    """Where they lie. What they rest on may be let go later: they move on with it.

    Columns by keyframe id, for a map that is driven in all day lets go of nearly everything.
    """

    def __init__(self) -> None:
        self._holder = GrowingArray(np.int64)
        self._poses = GrowingArray(np.float64, (3,))
        self._held_by: dict[int, array[int]] = {}
        self._count = 0

    def __contains__(self, keyframe: int) -> bool:
        return keyframe < len(self._holder) and self._holder.rows[keyframe] != _NOTHING

    def __len__(self) -> int:
        return self._count

    def lay(self, keyframe: int, holder: int, T_holder_keyframe: Pose) -> None:
        """Lay a keyframe, and all that rest on it, on another one that stays."""
        moving = self._held_by.pop(keyframe, array("q"))
        for other in moving:
            self._put(other, holder, T_holder_keyframe @ self._pose(other))
        if keyframe not in self:
            self._count += 1
        self._put(keyframe, holder, T_holder_keyframe)
        moving.append(keyframe)
        self._held_by.setdefault(holder, array("q")).extend(moving)

    def on(self, keyframe: int) -> tuple[int, Pose]:
        """What a keyframe rests on and T_holder_keyframe; itself if it was not let go."""
        if keyframe not in self:
            return keyframe, Pose.identity()
        return int(self._holder.rows[keyframe]), self._pose(keyframe)

    def _put(self, keyframe: int, holder: int, pose: Pose) -> None:
        while len(self._holder) <= keyframe:
            self._holder.append(_NOTHING)
            self._poses.append(0.0)
        self._holder.rows[keyframe] = holder
        self._poses.rows[keyframe] = pose.to_array()

    def _pose(self, keyframe: int) -> Pose:
        return Pose(*self._poses.rows[keyframe].tolist())
