"""Keyframes that were let go (`thinning`): each lies fixed to one of its track that stayed."""

from __future__ import annotations

from lineloom_core.geometry import Pose


class Resting:
    """Where they lie. What they rest on may be let go later: they move on with it."""

    def __init__(self) -> None:
        self._on: dict[int, tuple[int, Pose]] = {}
        self._held_by: dict[int, list[int]] = {}

    def __contains__(self, keyframe: int) -> bool:
        return keyframe in self._on

    def __len__(self) -> int:
        return len(self._on)

    def lay(self, keyframe: int, holder: int, T_holder_keyframe: Pose) -> None:
        """Lay a keyframe, and all that rest on it, on another one that stays."""
        moving = self._held_by.pop(keyframe, [])
        for other in moving:
            self._on[other] = holder, T_holder_keyframe @ self._on[other][1]
        self._on[keyframe] = holder, T_holder_keyframe
        self._held_by.setdefault(holder, []).extend([*moving, keyframe])

    def on(self, keyframe: int) -> tuple[int, Pose]:
        """What a keyframe rests on and T_holder_keyframe; itself if it was not let go."""
        return self._on.get(keyframe, (keyframe, Pose.identity()))
