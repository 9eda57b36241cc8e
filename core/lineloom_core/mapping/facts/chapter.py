"""A stretch of a site's history that is over: keyframes, and what came of comparing their places.

As bytes it is a fourth of what it takes in memory. Nothing in it ever changes.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import CodecError, decode, encode, inflate
from lineloom_core.mapping.facts.keyframe import Keyframe
from lineloom_core.places import Recognition

Pair = tuple[int, int]

_Content = tuple[list[Keyframe], list[int], bytes, dict[Pair, Recognition]]
_NO_RANGES = np.empty(0)
_LEVEL = 1


@dataclass(frozen=True, eq=False, slots=True)
class Chapter:
    """keyframes: in their order. recognitions: by ids of the two places, the later one in here."""

    keyframes: tuple[Keyframe, ...]
    recognitions: dict[Pair, Recognition]

    def pack(self) -> bytes:
        """Return it as bytes."""
        bare = [replace(f, scan=replace(f.scan, ranges=_NO_RANGES)) for f in self.keyframes]
        lengths, planes = _planes([f.scan.ranges for f in self.keyframes])
        content = (bare, lengths, planes, self.recognitions)
        return zlib.compress(encode(content), _LEVEL)

    @staticmethod
    def unpack(data: bytes) -> Chapter:
        """Return what was packed, bit for bit. Raises CodecError for anything else."""
        bare, lengths, planes, recognitions = decode(inflate(data), _Content)
        keyframes = tuple(
            replace(f, scan=replace(f.scan, ranges=ranges))
            for f, ranges in zip(bare, _ranges(lengths, planes), strict=True)
        )
        return Chapter(keyframes, recognitions)


def _planes(ranges: Sequence[NDArray[np.float64]]) -> tuple[list[int], bytes]:
    """First bytes of all numbers, then all second ones, and so on: lidars' have many zeros."""
    together = np.concatenate([*ranges, _NO_RANGES])
    return [len(r) for r in ranges], together.view(np.uint8).reshape(-1, 8).T.tobytes()


def _ranges(lengths: Sequence[int], planes: bytes) -> list[NDArray[np.float64]]:
    if min(lengths, default=0) < 0 or 8 * sum(lengths) != len(planes):
        raise CodecError(f"ranges of {sum(lengths)} beams have {len(planes)} bytes")
    turned = np.frombuffer(planes, dtype=np.uint8).reshape(8, -1).T
    together: NDArray[np.float64] = np.ascontiguousarray(turned).view(np.float64).ravel()
    # Copies: one that stays must not hold all the others.
    parts = [part.copy() for part in np.split(together, np.cumsum(lengths, dtype=int))[:-1]]
    for part in parts:
        part.setflags(write=False)
    return parts
