"""A mapper for the service's own tests: quick, exact, and able to fail on demand.

It keeps a chain of hashes over everything it was fed, so two runs that differ in one bit or one
place in the order end in different views. Imported by worker processes under its plain name.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import os
import signal
import time
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from lineloom_core.check import Limit
from lineloom_core.codec import decode, encode
from lineloom_core.fusion.occupancy import Rays
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.evidence import (
    Evidence,
    JoinTrial,
    MatchedLines,
    RobotMove,
    RunnerUp,
    WhatIf,
)
from lineloom_core.mapping.answers.factor_graph import FactorGraph
from lineloom_core.mapping.answers.localisation import Localisation, PoseHypothesis
from lineloom_core.mapping.answers.site_view import (
    ComponentView,
    ConstraintView,
    KeyframeView,
    MapLine,
    RobotView,
    SiteView,
)
from lineloom_core.mapping.answers.trajectories import Trajectories, Way, Whereabouts
from lineloom_core.mapping.answers.view_change import EMPTY_VIEW, ViewChange
from lineloom_core.mapping.belief.claim import Claim
from lineloom_core.mapping.belief.constraint_state import StateChange
from lineloom_core.mapping.changes import Changes
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.facts.placed_scans import ScanBlock
from lineloom_core.mapping.facts.scan_name import ScanName
from lineloom_core.mapping.facts.unplaced_scan import UnplacedScan
from lineloom_core.mapping.snapshot import Snapshot
from lineloom_core.scan import Mount, Scan

RAISES, CRASHES, RAISES_ONCE, HANGS = 666.0, 667.0, 668.0, 669.0
"""Stamps of scans that make the mapper fail."""

UNSEEN, UNSAVED = 670.0, 671.0
"""Stamps of scans after which it can make no view, or no snapshot, until the next scan."""

SECONDS_PER_SCAN = float(os.environ.get("FAKE_MAPPER_SECONDS", "0"))
SEALED = 16
"""Scans in a chapter of its history."""

GENTLE = bool(os.environ.get("FAKE_MAPPER_GENTLE"))
"""Then it fails on scans only."""

ONCE_FILE = os.environ.get("FAKE_MAPPER_ONCE", "")


class FakeMapper:
    """Each robot drives straight on: scan n is at x = n. All robots are one component, `c1`,
    but those called `alone…`, which have their own.

    Its history is every scan it took, whoever was forgotten since, sealed in chapters.
    """

    def __init__(self, config: MapperConfig | None = None) -> None:
        # What it was made with shows in every line, and in how much a constraint counts.
        self._least_set = (config or MapperConfig()).join.least_set
        self._chain = b"" if self._least_set == 2 else bytes([self._least_set])
        self._version = 0
        self._latest = 0.0
        self._history: list[tuple[str, str, int, float]] = []
        self._forgotten: dict[str, int] = {}  # up to which length of the history
        self._scans: dict[str, list[tuple[str, int, float]]] = {}
        self._mounts: dict[str, Mount] = {}
        self._retracted: dict[str, int] = {}
        self._joined: dict[str, Claim] = {}

    def add(self, robot: str, scan: Scan) -> Changes:
        if SECONDS_PER_SCAN:
            time.sleep(SECONDS_PER_SCAN)
        self._version += 1
        self._latest = scan.stamp
        self._link(robot, repr((scan.session, scan.seq, scan.stamp)), scan.ranges.tobytes())
        if scan.stamp == HANGS:
            time.sleep(3600.0)
        if scan.stamp == RAISES:
            raise ValueError("this scan is cursed")
        if scan.stamp == CRASHES:
            os.kill(os.getpid(), signal.SIGSEGV)
        if scan.stamp == RAISES_ONCE and not Path(ONCE_FILE).exists():
            Path(ONCE_FILE).touch()
            raise MemoryError
        self._history.append((robot, scan.session, scan.seq, scan.stamp))
        self._scans.setdefault(robot, []).append((scan.session, scan.seq, scan.stamp))
        return Changes(placed=True)

    def set_mount(self, robot: str, mount: Mount) -> None:
        self._version += 1
        self._link(robot, repr(mount), b"")
        self._mounts[robot] = mount

    def note(self) -> None:
        self._version += 1

    def forget(self, robot: str) -> None:
        self._version += 1
        self._link(robot, "forget", b"")
        self._scans.pop(robot, None)
        self._forgotten[robot] = len(self._history)

    def retract(self, constraint: str | Claim) -> None:
        self._version += 1
        self._link("retract", repr(constraint))
        self._retracted[_name(constraint)] = self._version

    def restore(self, constraint: str | Claim) -> None:
        self._version += 1
        self._link("restore", repr(constraint))
        self._retracted.pop(_name(constraint), None)

    def join(self, claim: Claim) -> None:
        self._version += 1
        self._link("join", repr(claim))
        self._joined[claim.constraint] = claim

    def try_join(self, claim: Claim, guessed: bool) -> JoinTrial | None:
        known = [(r, s, n) for r, rows in self._scans.items() for s, n, _ in rows]
        ends = (claim.scan_a, claim.scan_b)
        if any((s.robot, s.session, s.seq) not in known for s in ends):
            return None
        if not guessed and claim.scan_a.robot.startswith("alone"):
            return None
        a, b = (_component(s.robot) for s in ends)
        return JoinTrial(
            claim.constraint, a, b, "0", "1", Pose(1.0, 2.0, 0.5),
            None if a == b else Pose(3.0, 4.0, 0.5), True, "said by an operator",
            ("walls stand in free space",), {"matched": 300.0}, self.explain("k0-1"),
        )  # fmt: skip

    def rays(self, component: str, settled: bool) -> Rays:
        """A lidar at the origin that sees five walls a metre to five metres ahead."""
        sweep = (-1.0, 0.5)
        ranges = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
        return Rays.of([np.zeros(3)], [sweep], [ranges])

    def explain(self, constraint: str) -> Evidence:
        if constraint == "k-rejected" and not GENTLE:
            raise ValueError("there is nothing to say")
        return Evidence(
            constraint=constraint,
            limits={"conflict": Limit(None, 0.1, True, "Points in free space", "share")},
            matched=(MatchedLines((0, 0, 1, 0), (0, 0, 1, 0.1), 1.0, 0.05, 0.1),),
            reference=np.array([[0.0, 0.0, 1.0, 0.0]]),
            current=np.array([[0.0, 0.0, 1.0, 0.1]]),
            conflicts=np.array([[0.5, 0.5]]),
            votes=12.0,
            runner_up=RunnerUp(1.0, 2.0, 0.5, 3.0),
            margin=0.4,
        )

    def what_if(self, constraint: str) -> WhatIf:
        robots = tuple(sorted(self._scans))
        return WhatIf(
            "restore" if constraint in self._retracted else "retract",
            constraint,
            {"c1": robots},
            {"c1": robots[:1], "c2": robots[1:]},
            tuple(RobotMove(r, "c1", "c1", 0.1 * i, 0.0) for i, r in enumerate(robots)),
        )

    def localise(self, scans: Sequence[Scan]) -> Localisation:
        seen = [i for i, scan in enumerate(scans) if np.isfinite(scan.ranges).any()]
        if not seen:
            return Localisation("unknown", "no scan shows anything")
        x = float(scans[seen[-1]].ranges[0])
        checks = {"evidence": 12.0, "margin": math.inf}
        best = PoseHypothesis("c1", Pose(x, 0.5, 0.1), np.diag([0.01, 0.01, math.inf]), 0.9, checks)
        return Localisation("unique", "it fits", seen[-1], (best,))

    def factors(self) -> FactorGraph:
        frames = tuple(self._keyframes())
        row = {k.id: i for i, k in enumerate(frames)}
        tied = [c for c in self._constraints(frames) if c.state == "accepted"]
        return FactorGraph(
            self._version,
            tuple(row),
            tuple(k.component for k in frames),
            np.array([k.pose.to_array() for k in frames]).reshape(-1, 3),
            np.array([(row[c.keyframe_a], row[c.keyframe_b]) for c in tied], np.int64).reshape(
                -1, 2
            ),
            np.array([c.T_a_b.to_array() for c in tied]).reshape(-1, 3),
            np.array([c.information for c in tied]).reshape(-1, 3, 3),
        )

    def settled(self) -> ViewChange:
        return ViewChange.between(EMPTY_VIEW, self.view(settled=True))

    def view(self, *, settled: bool = False) -> SiteView:
        if self._latest == UNSEEN:
            raise ValueError("there is nothing to see")
        keyframes = tuple(self._keyframes())
        robots = tuple(sorted(self._scans))
        components = sorted({_component(robot) for robot in robots})
        return SiteView(
            version=self._version,
            robots={robot: self._robot(robot) for robot in robots},
            components=tuple(
                ComponentView(c, tuple(r for r in robots if _component(r) == c), 1)
                for c in components
            ),
            merged_into={"c9": "c1"},
            trajectories=self._trajectories(robots),
            lines=tuple(self._lines(components)),
            keyframes=keyframes,
            constraints=tuple(self._constraints(keyframes)),
            settled=settled,
        )

    def snapshot(self, known: int = 0) -> Snapshot:
        if self._latest == UNSAVED:
            raise ValueError("this cannot be saved")
        end = len(self._history) // SEALED
        state = {**self.__dict__, "_history": self._history[end * SEALED :], "chapters": end}
        del state["_scans"]
        chapters = tuple(self._chapter(number) for number in range(known, end))
        return Snapshot(encode(state), known, chapters)

    @classmethod
    def resume(cls, snapshot: Snapshot) -> FakeMapper:
        mapper = cls()
        state = decode(snapshot.state, dict)
        if (snapshot.first, snapshot.end) != (0, state.pop("chapters")):
            raise ValueError(f"these are not its chapters: {snapshot.first} to {snapshot.end}")
        sealed = [row for chapter in snapshot.chapters for row in _unsealed(chapter)]
        mapper.__dict__.update(state)
        mapper._history = [*sealed, *mapper._history]
        for number, (robot, session, seq, stamp) in enumerate(mapper._history):
            if number >= mapper._forgotten.get(robot, 0):
                mapper._scans.setdefault(robot, []).append((session, seq, stamp))
        return mapper

    def _chapter(self, number: int) -> bytes:
        rows = self._history[number * SEALED : (number + 1) * SEALED]
        return zlib.compress(json.dumps(rows).encode())

    def _link(self, *parts: str | bytes) -> None:
        digest = hashlib.sha256(self._chain)
        for part in parts:
            digest.update(part.encode() if isinstance(part, str) else part)
        self._chain = digest.digest()

    def _robot(self, robot: str) -> RobotView:
        session, seq, stamp = self._scans[robot][-1]
        return RobotView(
            robot=robot,
            component=_component(robot),
            pose=Pose(float(len(self._scans[robot])), self._least_set - 2.0, 0.0),
            covariance=np.diag([0.01, 0.01, 0.001]),
            state="tracking",
            scans_processed=len(self._scans[robot]),
            keyframes=1,
            latest_stamp=stamp,
            latest_session=session,
            latest_seq=seq,
        )

    def _trajectories(self, robots: tuple[str, ...]) -> Trajectories:
        """Every robot's scans hang at a keyframe of its own at the origin."""
        lost = (UnplacedScan("0", 77, 99.5, 1),)
        return Trajectories(
            {r: Way(1, lost if r == "alone" else (), Pose.identity()) for r in robots},
            tuple(_block(keyframe, self._scans[robot]) for keyframe, robot in enumerate(robots)),
            Whereabouts(
                np.zeros((len(robots), 3)),
                np.arange(len(robots), dtype=np.int32),
                tuple(map(_component, robots)),
            ),
        )

    def _lines(self, components: list[str]) -> list[MapLine]:
        chain = self._chain.hex()
        return [
            MapLine(f"{chain}-{c}-{i}", c, i, 0.0, i + 1.0, 0.0, 0.01, 3, ("r",), 0.0, 1.0)
            for c in components
            for i in range(3)
        ]

    def _keyframes(self) -> list[KeyframeView]:
        return [
            KeyframeView(
                str(i), robot, _component(robot), *self._scans[robot][-1], Pose(1.0, 0.0, 0.0)
            )
            for i, robot in enumerate(sorted(self._scans))
        ]

    def _constraints(self, keyframes: tuple[KeyframeView, ...]) -> list[ConstraintView]:
        linked = [k for k in keyframes if k.component == "c1"]
        accepted = [
            ConstraintView(
                id=f"k{a.id}-{b.id}",
                kind="rendezvous",
                state="retracted" if f"k{a.id}-{b.id}" in self._retracted else "accepted",
                keyframe_a=a.id,
                keyframe_b=b.id,
                T_a_b=Pose(0.0, 0.0, 0.0),
                information=np.eye(3),
                reason="they met",
                origin="recognition",
                scan_a=_scan_name(a),
                scan_b=_scan_name(b),
                checks={"conflict": 0.02, "unknown": float("nan")},
                residual=0.5,
                history=(StateChange(1, "accepted", "they met"),),
            )
            for a, b in itertools.pairwise(linked)
        ]
        rejected = [
            ConstraintView(
                id="k-rejected",
                kind="loop",
                state="rejected",
                keyframe_a="0",
                keyframe_b="0",
                T_a_b=Pose(0.0, 0.0, 0.0),
                information=np.eye(3),
                reason="conflict",
                origin="near",
                scan_a=_scan_name(k),
                scan_b=_scan_name(k),
            )
            for k in keyframes[:1]
        ]
        said = [
            ConstraintView(
                id=name,
                kind="operator",
                state="retracted" if name in self._retracted else "accepted",
                keyframe_a="0",
                keyframe_b="0",
                T_a_b=claim.T_a_b,
                information=np.eye(3),
                reason="said by an operator",
                origin=claim.origin,
                scan_a=claim.scan_a,
                scan_b=claim.scan_b,
            )
            for name, claim in self._joined.items()
        ]
        rest = [c for c in rejected if c.id not in self._joined]
        return accepted + rest + said


def _unsealed(chapter: bytes) -> list[tuple[str, str, int, float]]:
    return [
        (str(r), str(s), int(n), float(t)) for r, s, n, t in json.loads(zlib.decompress(chapter))
    ]


def _block(keyframe: int, scans: list[tuple[str, int, float]]) -> ScanBlock:
    sessions = tuple(dict.fromkeys(s for s, _, _ in scans))
    return ScanBlock(
        sessions,
        np.array([sessions.index(s) for s, _, _ in scans], dtype=np.int32),
        np.array([n for _, n, _ in scans], dtype=np.int64),
        np.array([t for _, _, t in scans]),
        np.full(len(scans), keyframe),
        np.array([[i + 1.0, 0.0, 0.0] for i in range(len(scans))]),
    )


def _name(constraint: str | Claim) -> str:
    return constraint if isinstance(constraint, str) else constraint.constraint


def _scan_name(keyframe: KeyframeView) -> ScanName:
    return ScanName(keyframe.robot, keyframe.session, keyframe.seq)


def _component(robot: str) -> str:
    return f"c-{robot}" if robot.startswith("alone") else "c1"
