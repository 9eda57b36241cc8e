"""Where robots have been, put together when somebody asks.

How a scan lies to its keyframe is a fact; where keyframes lie changes with every optimisation. So
a view holds both, and shares the facts with the views before it: what it costs does not grow with
the scans ever taken.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose, se2
from lineloom_core.mapping.answers.site_view import TrajectoryView
from lineloom_core.mapping.facts.placed_scans import ScanBlock
from lineloom_core.mapping.facts.unplaced_scan import UnplacedScan


@storable("whereabouts")
@dataclass(frozen=True, eq=False, slots=True)
class Whereabouts:
    """Keyframes in the map, by id: also those that the map has let go.

    poses: (m, 3), T_map_laser in the component's frame, NaN where there is none. component: (m,),
    the number of each one's in `components`.
    """

    poses: NDArray[np.float64]
    component: NDArray[np.int32]
    components: tuple[str, ...]


@storable("way")
@dataclass(frozen=True, slots=True)
class Way:
    """One robot's. blocks: how many are its own; T_laser_base: where its base is."""

    blocks: int
    unplaced: tuple[UnplacedScan, ...]
    T_laser_base: Pose


@dataclass(frozen=True, eq=False)
class Trajectories(Mapping[str, TrajectoryView]):
    """By robot. blocks: of all robots, one robot after the other in the order of `ways`."""

    ways: dict[str, Way]
    blocks: tuple[ScanBlock, ...]
    keyframes: Whereabouts

    def __iter__(self) -> Iterator[str]:
        return iter(self.ways)

    def __len__(self) -> int:
        return len(self.ways)

    def __getitem__(self, robot: str) -> TrajectoryView:
        """Put a robot's trajectory together; takes time with its length."""
        way, blocks = self.ways[robot], self._blocks_of(robot)
        keyframe = np.concatenate([_NO_IDS, *(b.keyframe for b in blocks)])
        laser = se2.compose(
            self.keyframes.poses[keyframe], np.concatenate([_NO_POSES, *(b.steps for b in blocks)])
        )
        base = np.broadcast_to(way.T_laser_base.to_array(), laser.shape)
        return TrajectoryView(
            session=tuple(name for b in blocks for name in _named(b.sessions, b.session)),
            seq=np.concatenate([_NO_IDS, *(b.seq for b in blocks)]),
            stamp=np.concatenate([_NO_STAMPS, *(b.stamp for b in blocks)]),
            component=_named(self.keyframes.components, self.keyframes.component[keyframe]),
            poses=se2.compose(laser, base),
            unplaced=way.unplaced,
        )

    def _blocks_of(self, robot: str) -> tuple[ScanBlock, ...]:
        begin = 0
        for name, way in self.ways.items():
            if name == robot:
                return self.blocks[begin : begin + way.blocks]
            begin += way.blocks
        raise KeyError(robot)


_NO_IDS: NDArray[np.int64] = np.empty(0, dtype=np.int64)
_NO_STAMPS, _NO_POSES = np.empty(0), np.empty((0, 3))


NO_TRAJECTORIES = Trajectories({}, (), Whereabouts(_NO_POSES, np.empty(0, dtype=np.int32), ()))


def _named(names: tuple[str, ...], numbers: NDArray[np.int32]) -> tuple[str, ...]:
    return tuple(np.array(names, dtype=object)[numbers].tolist()) if len(numbers) else ()
