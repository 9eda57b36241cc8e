"""What the robots' scans gave, whatever is believed of it: the keyframes in their order.

Tracking never asks what is known of other robots, so a keyframe is a fact. All beliefs, that is
constraints, merges and poses, are a function of the history and of the verdicts upon it, and can
be had again by `rebuild`.
"""

from __future__ import annotations

from dataclasses import replace

from lineloom_core.mapping.keyframe import Keyframe


class History:
    """Keyframes and tracks are numbered in the order they were made; numbers are never reused."""

    def __init__(self) -> None:
        self.keyframes: dict[int, Keyframe] = {}
        self._tracks = 0
        self._next = 0

    def new_track(self) -> int:
        """The next track's number."""
        self._tracks += 1
        return self._tracks - 1

    def new_keyframe(self) -> int:
        """The next keyframe's id."""
        self._next += 1
        return self._next - 1

    def add(self, keyframe: Keyframe) -> None:
        """Append a keyframe."""
        self.keyframes[keyframe.id] = keyframe

    def distrust(self, robot: str, session: str) -> None:
        """Mark all keyframes of a robot's session: its lidar's geometry is wrong."""
        for k, f in self.keyframes.items():
            if f.robot == robot and f.scan.session == session:
                self.keyframes[k] = replace(f, trusted=False)

    def forget(self, robot: str) -> None:
        """Drop a robot's keyframes."""
        self.keyframes = {k: f for k, f in self.keyframes.items() if f.robot != robot}

    def around(self, keyframe: Keyframe, reach: int) -> list[Keyframe]:
        """The keyframe and up to `reach` before and after it on its track, nearest first."""
        chain = [f for f in self.keyframes.values() if f.track == keyframe.track]
        where = chain.index(keyframe)
        nearest = sorted(range(len(chain)), key=lambda i: (abs(i - where), i))
        return [chain[i] for i in nearest if abs(i - where) <= reach]
