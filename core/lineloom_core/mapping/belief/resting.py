"""Keyframes that were let go (`thinning`): each lies fixed to one of its track that stayed."""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose

_NOTHING = -1
_HERE = Pose.identity()


@storable("resting", holder=NDArray[np.int64], poses=NDArray[np.float64])
class Resting:
    """Where they lie. What they rest on may be let go later: they move on with it.

    Columns by keyframe id, for a map that is driven in all day lets go of nearly everything.
    """

    def __init__(self) -> None:
        self._holder = array("q")
        self._poses = array("d")  # three each
        self._held_by: dict[int, array[int]] = {}
        self._count = 0

    def __getstate__(self) -> dict[str, Any]:
        poses = np.array(self._poses, dtype=np.float64).reshape(-1, 3)
        return {"holder": np.array(self._holder, dtype=np.int64), "poses": poses}

    def __setstate__(self, state: dict[str, Any]) -> None:
        holder, poses = state["holder"], state["poses"]
        if poses.shape != (len(holder), 3):
            raise ValueError(f"{len(holder)} keyframes rest, with poses of shape {poses.shape}")
        self._holder, self._poses = array("q", holder.tobytes()), array("d", poses.tobytes())
        self._held_by = {}
        resting = np.flatnonzero(holder != _NOTHING)
        for keyframe, on in zip(resting.tolist(), holder[resting].tolist(), strict=True):
            self._held_by.setdefault(on, array("q")).append(keyframe)
        self._count = len(resting)

    def __contains__(self, keyframe: int) -> bool:
        return keyframe < len(self._holder) and self._holder[keyframe] != _NOTHING

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
        # Asked for every pose of the map: no function is called where nothing rests.
        if keyframe >= len(self._holder) or self._holder[keyframe] == _NOTHING:
            return keyframe, _HERE
        return self._holder[keyframe], self._pose(keyframe)

    def rows(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """Ids of all that rest, ascending, of what they rest on, and T_holder_keyframe, (n, 3)."""
        holder = np.array(self._holder, dtype=np.int64)
        resting = np.flatnonzero(holder != _NOTHING)
        return resting, holder[resting], np.array(self._poses).reshape(-1, 3)[resting]

    def _put(self, keyframe: int, holder: int, pose: Pose) -> None:
        missing = keyframe + 1 - len(self._holder)
        self._holder.extend([_NOTHING] * missing)
        self._poses.extend([0.0] * (3 * missing))
        self._holder[keyframe] = holder
        self._poses[3 * keyframe : 3 * keyframe + 3] = array("d", (pose.x, pose.y, pose.theta))

    def _pose(self, keyframe: int) -> Pose:
        return Pose(*self._poses[3 * keyframe : 3 * keyframe + 3])
