"""A run of tracking without a break."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Track:
    """Keyframes that hang together by themselves, in their order.

    id: the track's number; where a retracted step cut it, the second part's first keyframe is
    added to it, as in "3.57".
    """

    id: str
    robot: str
    keyframes: list[int] = field(default_factory=list)
    travelled: list[float] = field(default_factory=list)
    """Distance driven up to each keyframe [m]."""
    last_place_at: float = 0.0
    """Distance driven when the last place was made [m]."""

    def append(self, keyframe: int, step: float) -> None:
        """Add the next keyframe, `step` metres further on."""
        self.travelled.append(self.travelled[-1] + step if self.travelled else 0.0)
        self.keyframes.append(keyframe)
