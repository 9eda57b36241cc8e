"""What is believed of a site: keyframes seen so far, constraints, and the graph over them.

A function of the history gone through so far and of the verdicts upon it: `rebuild` makes it anew.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose
from lineloom_core.graph import Edge, PoseGraph
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.graph_drift import Drifts
from lineloom_core.mapping.belief.memory import Memory
from lineloom_core.mapping.belief.place_making import make_place
from lineloom_core.mapping.belief.resting import Resting
from lineloom_core.mapping.belief.track import Track
from lineloom_core.mapping.belief.verdicts import Verdicts
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.facts.drift import way_drift
from lineloom_core.mapping.facts.ids import Named, id_of
from lineloom_core.mapping.facts.keyframe import Keyframe, Step
from lineloom_core.places import Place


@storable(
    "site-map",
    config=MapperConfig,
    memory=Memory,
    verdicts=Verdicts,
    keyframes=dict[int, Keyframe],
    tracks=dict[str, Track],
    places=list[tuple[int, ...]],
    constraints=dict[str, Constraint],
    graph=PoseGraph,
    merged_into=dict[str, str],
    looped_tracks=dict[str, None],
    unsolved=dict[int, int],
    overlaps=dict[tuple[str, str], tuple[int, int, int]],
    now=int,
    resting=Resting,
)
class SiteMap:
    """Grows by one keyframe at a time (`append`); what follows from it is `advance`'s business."""

    def __init__(
        self,
        config: MapperConfig,
        memory: Memory | None = None,
        verdicts: Verdicts | None = None,
    ) -> None:
        self.config = config
        self.memory = memory or Memory(config.recognition)
        self.verdicts = verdicts or Verdicts()
        self.keyframes: dict[int, Keyframe] = {}
        self.tracks: dict[str, Track] = {}
        self.places: dict[int, Place] = {}
        self.constraints: dict[str, Constraint] = {}
        self.graph = PoseGraph()
        self.merged_into: dict[str, str] = {}
        self.looped_tracks: dict[str, None] = {}
        self.unsolved: dict[int, int] = {}
        """By component root: loops accepted since it was last solved."""
        self.overlaps: dict[tuple[str, str], tuple[int, int, int]] = {}
        """By pair of tracks since they met: steady points that both saw, those that one missed, and
        pairs of places compared (`contradictions`)."""
        self.now = 0
        """Version of the latest keyframe: when what is decided now is decided."""
        self.resting = Resting()
        self._track_of: dict[int, Track] = {}
        self._latest_track: dict[str, Track] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Places are functions of their keyframes and by far the largest part: left out."""
        state = {**self.__dict__, "places": [p.keyframes for p in self.places.values()]}
        for follows in ("_track_of", "_latest_track"):
            del state[follows]
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._track_of = {k: track for track in self.tracks.values() for k in track.keyframes}
        self._latest_track = {track.robot: track for track in self.tracks.values()}
        self.places = {}
        for members in state["places"]:
            self.add_place(members)

    def append(self, keyframe: Keyframe) -> Constraint | None:
        """Take the next keyframe of a track; return its step, None where a track begins.

        A step that was retracted cuts the track: what follows is a component of its own.
        """
        self.keyframes[keyframe.id] = keyframe
        self.now = keyframe.version
        step = keyframe.step
        if step is None or self._is_cut(keyframe, step):
            name = str(keyframe.track) if step is None else f"{keyframe.track}.{keyframe.id}"
            track = self.tracks[name] = Track(name, keyframe.robot)
            self._latest_track[keyframe.robot] = track
            track.append(keyframe.id, Pose.identity(), np.zeros((3, 3)))
            self._track_of[keyframe.id] = track
            self.graph.add_node(keyframe.id, Pose.identity())
            return None
        track = self._track_of[step.previous]
        T = step.T_previous_this
        track.append(keyframe.id, T, step.drift)
        self._track_of[keyframe.id] = track
        self.graph.add_node(keyframe.id, self.pose(step.previous) @ T)
        constraint = self._tracked(keyframe.id, step)
        self.add_constraint(constraint)
        return constraint

    def _is_cut(self, keyframe: Keyframe, step: Step) -> bool:
        before = self.keyframes[step.previous].scan_name
        return self.verdicts.cuts(self.id_of("step", keyframe.id), before, keyframe.scan_name)

    def step(self, keyframe: int) -> Constraint | None:
        """The step to a keyframe; None where a track begins, or the keyframe was let go."""
        if keyframe not in self.keyframes:
            return None
        return self.constraints.get(self.id_of("step", keyframe))

    def add_place(self, members: tuple[int, ...]) -> Place:
        """Add the place that these keyframes of one track show."""
        place = self.memory.places.get(members[-1])
        if place is None or place.keyframes != members:
            place = make_place(members, self.keyframes)
            self.memory.places[place.id] = place
        self.places[place.id] = place
        return place

    def track(self, keyframe: int) -> Track:
        """The track that a keyframe is on."""
        return self._track_of[keyframe]

    def is_latest(self, track: Track) -> bool:
        """Whether no later track of its robot is known: it may go on."""
        return self._latest_track[track.robot] is track

    def track_before(self, track: Track) -> Track | None:
        """The track that its robot was on before in the same session."""
        drive = self._drive(track)
        before = [t for t in self.tracks.values() if self._drive(t) == drive and t is not track]
        return before[-1] if before else None

    def has_strayed(self, track: Track) -> bool:
        """Whether its robot drove elsewhere before in the same session, and nobody knows where."""
        drive = self._drive(track)
        return any(
            self._drive(other) == drive and not self.same_component(other.kept[0], track.kept[0])
            for other in self.tracks.values()
            if other is not track
        )

    def same_track(self, a: int, b: int) -> bool:
        """Whether tracking alone links two keyframes."""
        return self._track_of[a] is self._track_of[b]

    def pose(self, keyframe: int) -> Pose:
        """T_map_laser of a keyframe in its component's frame, as the graph has it now."""
        holder, T_holder_keyframe = self.resting.on(keyframe)
        pose = self.graph.pose(holder)
        return pose if holder == keyframe else pose @ T_holder_keyframe

    def knows(self, keyframe: int) -> bool:
        """Whether a keyframe has been seen, kept or not."""
        return keyframe in self._track_of

    def component_root(self, keyframe: int) -> int:
        """The oldest keyframe of the component: its anchor and name giver."""
        return self.graph.component_root(self.resting.on(keyframe)[0])

    def component_id(self, keyframe: int) -> str:
        """Id of the keyframe's component: that of its oldest track."""
        return self.id_of("component", self.component_root(keyframe))

    def id_of(self, what: Named, *keyframes: int) -> str:
        """Id of what rests on these keyframes, which the map has not let go."""
        return id_of(what, *(self.keyframes[k].scan_name for k in keyframes))

    def same_component(self, a: int, b: int) -> bool:
        """Whether the relative pose of two keyframes is known."""
        return self.graph.connected(self.resting.on(a)[0], self.resting.on(b)[0])

    def are_kin(self, a: int, b: int) -> bool:
        """Whether one robot drove in the components of both keyframes in one session.

        What comes after a break in a robot's track is probably near, unless it was carried away.
        """
        of_a, of_b = ({self._drive(t) for t in self._tracks_with(k)} for k in (a, b))
        return not of_a.isdisjoint(of_b)

    def _tracks_with(self, keyframe: int) -> list[Track]:
        root = self.component_root(keyframe)
        return [t for t in self.tracks.values() if self.component_root(t.kept[0]) == root]

    def _drive(self, track: Track) -> tuple[str, str]:
        return track.robot, self.keyframes[track.kept[0]].scan.session

    def way_between(self, a: int, b: int) -> float:
        """Metres over which error may have grown between two keyframes of one component.

        The way driven on one track; across tracks, or where loops have closed, the error is that
        of the shorter way: a few times the distance.
        """
        return self._way(a, b, self.pose(a).distance(self.pose(b)))

    def _way(self, a: int, b: int, straight: float) -> float:
        around = 3.0 * straight + 5.0
        if not self.same_track(a, b):
            return around
        driven = self.driven_between(a, b)
        return min(driven, around) if self._track_of[a].id in self.looped_tracks else driven

    def driven_between(self, a: int, b: int) -> float:
        """Metres driven from one keyframe to another of the same track."""
        track = self._track_of[a]
        return abs(track.travelled[track.position(a)] - track.travelled[track.position(b)])

    def drifts(self, keyframes: Iterable[int]) -> Drifts:
        """How sure the relative poses of some keyframes of one component are.

        Ask for all that will be wanted at once: it takes nearly as long for two as for sixty.
        """
        tracks = {k: self._track_of[k] for k in keyframes}
        return Drifts(self.graph, tracks, self.looped_tracks)

    def drift(self, a: int, b: int) -> NDArray[np.float64]:
        """Covariance (3, 3) of T_a_b within one component, in the tangent at b."""
        return self.drifts((a, b))(a, b)

    def rough_drift(self, a: int, b: int) -> NDArray[np.float64]:
        """The same at a glance, by `way_between` and the mean rates of the two tracks.

        Too small where two maps have met at one end only: for prefilters alone.
        """
        first, last = self._track_of[a].drift_rates(), self._track_of[b].drift_rates()
        rates = 0.5 * (first[0] + last[0]), 0.5 * (first[1] + last[1])
        straight = self.pose(a).distance(self.pose(b))
        return way_drift(rates, self._way(a, b, straight), straight)

    def add_constraint(self, constraint: Constraint) -> None:
        """Remember a constraint; an accepted one goes into the graph."""
        if not constraint.history:
            constraint = constraint.moved_to(constraint.state, constraint.reason, self.now)
        self.constraints[constraint.id] = constraint
        in_graph = constraint.id in self.graph.edges
        if constraint.state == "accepted" and not in_graph:
            self.graph.add_edge(self._edge(constraint))
            if constraint.kind != "sequential":
                for keyframe in (constraint.keyframe_a, constraint.keyframe_b):
                    self.looped_tracks[self._track_of[keyframe].id] = None
        elif constraint.state != "accepted" and in_graph:
            self.graph.remove_edge(constraint.id)

    def move_component(self, keyframe: int, T_new_old: Pose) -> None:
        """Move the component of a keyframe rigidly: into the frame of the one it joins."""
        self.graph.move_component(keyframe, T_new_old)

    def optimise(self, keyframe: int) -> None:
        """Solve the component of a keyframe; its oldest keyframe stays where it is."""
        self.graph.optimise(keyframe)

    def settled(self) -> SiteMap:
        """The same at the optimum of all of its constraints; to look at, not to go on from."""
        rest = SiteMap.__new__(SiteMap)
        rest.__dict__.update({**self.__dict__, "graph": self.graph.settled()})
        return rest

    def places_in_component(self, keyframe: int) -> int:
        """Number of places in the component of a keyframe."""
        root = self.component_root(keyframe)
        return sum(1 for p in self.places.values() if self.component_root(p.anchor) == root)

    def nearby(self, keyframe: int, radius: float) -> list[tuple[int, float]]:
        """Keyframes of the same component within `radius` m, nearest first, with distances."""
        return self.graph.within(keyframe, radius)

    def places_around(self, keyframe: int, radius: float) -> list[Place]:
        """Places of the component anchored within `radius` m of a keyframe, in their order."""
        near = {k for k, _ in self.nearby(keyframe, radius)} | {keyframe}
        return [p for p in self.places.values() if p.anchor in near]

    def let_go(self, runs: Sequence[Sequence[int]]) -> None:
        """Take runs of successive keyframes of a track each out of the map.

        The steps over a run become one step; loops that end in it are given up. Its keyframes stay
        where they are, fixed to the one before them.
        """
        over = [found for run in runs if (found := self._lay_to_rest(run)) is not None]
        gone = [k for run in runs for k in run]
        for keyframe, step in over:
            self.keyframes[keyframe] = replace(self.keyframes[keyframe], step=step, joined=True)
        steps = [self._tracked(keyframe, step) for keyframe, step in over]
        for edge in self.graph.remove_nodes(gone, instead=[self._edge(c) for c in steps]):
            self.constraints.pop(edge.id, None)
        for k in gone:
            del self.keyframes[k]
        for constraint in steps:
            self.add_constraint(constraint)

    def _lay_to_rest(self, run: Sequence[int]) -> tuple[int, Step] | None:
        """Fix a run to what stays; return what comes after it and the one step over the run."""
        before, after = self._track_of[run[0]].let_go(run)
        holder = after if before is None else before
        assert holder is not None, "a track keeps at least one keyframe"
        here = self.pose(holder)
        for k in run:
            self.resting.lay(k, holder, here.between(self.pose(k)))
        if before is None or after is None:
            return None
        steps = (self.keyframes[k].step for k in (*run, after))
        return after, functools.reduce(Step.then, (step for step in steps if step is not None))

    def tidy(self) -> None:
        """Forget what rested on keyframes and places that are gone."""
        self.constraints = {
            name: c
            for name, c in self.constraints.items()
            if c.keyframe_a in self.keyframes
            and c.keyframe_b in self.keyframes
            and (c.state == "accepted" or c.place_a < 0 or self._has_places(c))
        }

    def _has_places(self, c: Constraint) -> bool:
        return c.place_a in self.places and c.place_b in self.places

    def _edge(self, constraint: Constraint) -> Edge:
        """The constraint as the graph takes it; a step's drift is as it was measured."""
        if constraint.kind != "sequential":
            return constraint.edge()
        step = self.keyframes[constraint.keyframe_b].step
        assert step is not None, "a tracked constraint without a step"
        drift = np.linalg.inv(step.drift)
        return replace(constraint.edge(), drift=0.5 * (drift + drift.T))

    def _tracked(self, keyframe: int, step: Step) -> Constraint:
        return Constraint(
            id=self.id_of("step", keyframe),
            kind="sequential",
            state="accepted",
            keyframe_a=step.previous,
            keyframe_b=keyframe,
            T_a_b=step.T_previous_this,
            information=step.information,
            reason="tracked from scan to scan",
            checks=step.checks,
        )
