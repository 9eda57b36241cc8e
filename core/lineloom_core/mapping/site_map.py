"""The site's shared memory: keyframes, tracks, places, constraints and the graph over them."""

from __future__ import annotations

from bisect import bisect_left
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.graph import PoseGraph, optimize
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.constraint import Constraint
from lineloom_core.mapping.keyframe import Keyframe
from lineloom_core.mapping.place_making import make_place
from lineloom_core.mapping.positions import Positions
from lineloom_core.mapping.robot_record import Track
from lineloom_core.places import Place


class SiteMap:
    """Keyframes are numbered in the order they were made, tracks and places likewise."""

    def __init__(self, config: MapperConfig) -> None:
        self.config = config
        self.keyframes: dict[int, Keyframe] = {}
        self.tracks: dict[int, Track] = {}
        self.places: dict[int, Place] = {}
        self.constraints: dict[str, Constraint] = {}
        self.graph = PoseGraph()
        self.merged_into: dict[str, str] = {}
        self.looped_tracks: dict[int, None] = {}
        self.alias: dict[tuple[int, int], float] = {}
        """By pair of places: how much of one could be mistaken for the other (`distinctive`)."""
        self._positions = Positions()
        self._numbers = {"keyframe": 0, "track": 0, "place": 0, "constraint": 0}

    def __getstate__(self) -> dict[str, Any]:
        """Places are functions of their keyframes and by far the largest part: left out."""
        return {**self.__dict__, "places": [(p.id, p.keyframes) for p in self.places.values()]}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.places = {
            number: make_place(number, members, self.keyframes)
            for number, members in state["places"]
        }

    def number(self, what: str) -> int:
        """The next free number for a keyframe, track, place or constraint."""
        self._numbers[what] += 1
        return self._numbers[what] - 1

    def pose(self, keyframe: int) -> Pose:
        """T_map_laser of a keyframe in its component's frame, as the graph has it now."""
        return self.graph.nodes[keyframe]

    def component_root(self, keyframe: int) -> int:
        """The oldest keyframe of the component: its anchor and name giver."""
        return self.graph.component_root(keyframe)

    def component_id(self, keyframe: int) -> str:
        """Stable id of the keyframe's component: that of its oldest track."""
        return f"c{self.keyframes[self.component_root(keyframe)].track}"

    def same_component(self, a: int, b: int) -> bool:
        """Whether the relative pose of two keyframes is known."""
        return self.graph.connected(a, b)

    def way_between(self, a: int, b: int) -> float:
        """Metres over which error may have grown between two keyframes of one component.

        The way driven on one track; across tracks, or where loops have closed, the error is that
        of the shorter way: a few times the distance.
        """
        straight = self.pose(a).distance(self.pose(b))
        around = 3.0 * straight + 5.0
        ka, kb = self.keyframes[a], self.keyframes[b]
        if ka.track != kb.track:
            return around
        driven = self.driven_between(a, b)
        return min(driven, around) if ka.track in self.looped_tracks else driven

    def driven_between(self, a: int, b: int) -> float:
        """Metres driven from one keyframe to another of the same track."""
        track = self.tracks[self.keyframes[a].track]
        return abs(self._travelled(track, a) - self._travelled(track, b))

    def drift(self, a: int, b: int) -> NDArray[np.float64]:
        """Covariance (3, 3) of T_a_b within one component, in the tangent at b."""
        if a == b:
            return np.zeros((3, 3))
        join = self.config.join
        way = self.way_between(a, b)
        theta = join.drift_rate[1] * way
        across = join.drift_rate[0] * way + 0.5 * theta * self.pose(a).distance(self.pose(b))
        return np.diag([across**2, across**2, theta**2])

    def add_constraint(self, constraint: Constraint) -> None:
        """Remember a constraint; an accepted one goes into the graph."""
        self.constraints[constraint.id] = constraint
        in_graph = constraint.id in self.graph.edges
        if constraint.state == "accepted" and not in_graph:
            self.graph.add_edge(constraint.edge())
            if constraint.kind != "sequential":
                for keyframe in (constraint.keyframe_a, constraint.keyframe_b):
                    self.looped_tracks[self.keyframes[keyframe].track] = None
        elif constraint.state != "accepted" and in_graph:
            self.graph.remove_edge(constraint.id)

    def new_constraint_id(self) -> str:
        """The next constraint id."""
        return f"k{self.number('constraint')}"

    def add_node(self, keyframe: int, pose: Pose) -> None:
        """Put a keyframe into the graph at T_map_laser."""
        self.graph.add_node(keyframe, pose)
        self._positions.add(keyframe, pose)

    def move_component(self, keyframe: int, T_new_old: Pose) -> None:
        """Move the component of a keyframe rigidly: into the frame of the one it joins."""
        self.graph.move_component(keyframe, T_new_old)
        self._positions.reset(self.graph.nodes)

    def optimise(self, keyframe: int) -> None:
        """Solve the component of a keyframe; its oldest keyframe stays where it is."""
        nodes, edges = self.graph.component_subgraph(keyframe)
        solution = optimize(nodes, edges, anchors=(min(nodes),))
        self.graph.set_poses(solution.poses)
        self._positions.reset(self.graph.nodes)

    def forget(self, robot: str) -> None:
        """Remove a robot's keyframes, tracks and places, and every constraint that touches them."""
        gone = {k.id for k in self.keyframes.values() if k.robot == robot}
        for keyframe in sorted(gone):
            self.graph.remove_node(keyframe)
            del self.keyframes[keyframe]
        self._positions.reset(self.graph.nodes)
        self.tracks = {t.id: t for t in self.tracks.values() if t.robot != robot}
        self.places = {p.id: p for p in self.places.values() if p.track in self.tracks}
        self.alias = {
            (a, b): e for (a, b), e in self.alias.items() if a in self.places and b in self.places
        }
        self.constraints = {
            c.id: c
            for c in self.constraints.values()
            if c.keyframe_a not in gone and c.keyframe_b not in gone
        }
        self.looped_tracks = {t: None for t in self.looped_tracks if t in self.tracks}
        alive = {self.component_id(k) for k in self.keyframes}
        self.merged_into = {
            a: b for a, b in self.merged_into.items() if a not in alive and b in alive
        }

    def places_in_component(self, keyframe: int) -> int:
        """Number of places in the component of a keyframe."""
        root = self.component_root(keyframe)
        return sum(1 for p in self.places.values() if self.component_root(p.anchor) == root)

    def nearby(self, keyframe: int, radius: float) -> list[tuple[int, float]]:
        """Keyframes of the same component within `radius` m, nearest first, with distances."""
        root = self.component_root(keyframe)
        return [
            (other, distance)
            for other, distance in self._positions.within(self.pose(keyframe), radius)
            if other != keyframe and self.component_root(other) == root
        ]

    def neighbours_on_track(self, keyframe: int, reach: int) -> list[int]:
        """The keyframe and up to `reach` before and after it on its track, itself first."""
        chain = self.tracks[self.keyframes[keyframe].track].keyframes
        where = _position(chain, keyframe)
        around = chain[max(where - reach, 0) : where + reach + 1]
        return sorted(around, key=lambda k: (abs(_position(chain, k) - where), k))

    def _travelled(self, track: Track, keyframe: int) -> float:
        return track.travelled[_position(track.keyframes, keyframe)]


def _position(chain: list[int], keyframe: int) -> int:
    """Index of a keyframe in its chain, which ascends."""
    return bisect_left(chain, keyframe)
