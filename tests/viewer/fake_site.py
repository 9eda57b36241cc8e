"""A site in two parts, as the service would answer it: for what the page does with any answer."""

from __future__ import annotations

import math
from typing import Any

SITE = "fake"
ROOM = [(0.0, 0.0, 6.0, 0.0), (6.0, 0.0, 6.0, 4.0), (6.0, 4.0, 0.0, 4.0), (0.0, 4.0, 0.0, 0.0)]
STEPS = 12
T_C0_C1 = (7.0, 1.0, math.pi / 2)
"""How c1 lies in c0, once that is known."""


class FakeSite:
    """Two robots, each in a room of its own, and what could join them."""

    def __init__(self) -> None:
        self.version = 40
        self.settled = True
        self.joined = False
        self.trouble: str | None = None
        self.remaking: dict[str, Any] | None = None
        self.plan: dict[str, dict[str, float]] | None = None
        """T_plan_map of the components that have a place in the floor plan."""
        self.constraints = [_candidate("p5-17"), _candidate("p3-15"), _rejected("p1-20")]

    def join(self) -> None:
        """Believe the candidates: c1 becomes part of c0."""
        self._turn("candidate", "accepted", "2 constraints agree")
        self.joined = True
        self.version += 1

    def act(self, identity: str, action: str) -> dict[str, Any]:
        """Retract or restore a constraint; the components follow."""
        constraint = next(c for c in self.constraints if c["id"] == identity)
        state = "retracted" if action == "retract" else "accepted"
        if action == "confirm":
            constraint["kind"] = "operator"
        constraint.update(state=state, reason=f"{action}ed by an operator")
        self.version += 1
        self.joined = any(c["state"] == "accepted" for c in self.constraints)
        return constraint

    def try_join(self) -> dict[str, Any]:
        """Answer what laying c1 on c0 would come to."""
        x, y, theta = T_C0_C1
        of = evidence(_candidate("o-said"))
        return {
            "constraint": "o-said",
            "component_a": "c0",
            "component_b": "c1",
            "keyframe_a": "k0",
            "keyframe_b": "k1",
            "T_a_b": {"x": 1.0, "y": 0.5, "theta": 0.25},
            "T_components": {"x": x, "y": y, "theta": theta},
            "fits": True,
            "reason": "said by an operator; against it: walls stand in free space",
            "objections": ["walls stand in free space"],
            "checks": of["checks"],
            "limits": of["limits"],
            "matched": of["matched"],
            "conflicts": of["conflicts"],
        }

    def say(self, said: dict[str, Any]) -> dict[str, Any]:
        """Believe an operator: c1 becomes part of c0."""
        made = _candidate("o-said")
        made.update(kind="operator", state="accepted", reason="said by an operator")
        made["T_a_b"] = said["T_a_b"]
        self.constraints.append(made)
        self.joined = True
        self.version += 1
        return made

    def what_if(self, identity: str, action: str) -> dict[str, Any]:
        """Answer who would move."""
        others = [c for c in self.constraints if c["state"] == "accepted" and c["id"] != identity]
        parts = action == "retract" and not others
        whole = [{"id": "c0", "robots": ["ada", "bob"]}]
        parted = [{"id": "c0", "robots": ["ada"]}, {"id": "c1", "robots": ["bob"]}]
        return {
            "action": action,
            "constraint": identity,
            "version": self.version,
            "components_before": whole,
            "components_after": parted if parts else whole,
            "robots": [
                _move("ada", 0.0, "c0"),
                _move("bob", None, "c1") if parts else _move("bob", 0.12, "c0"),
            ],
        }

    def site(self) -> dict[str, Any]:
        """`GET /v1/sites/{site}`."""
        counts: dict[str, int] = {}
        for constraint in self.constraints:
            counts[constraint["state"]] = counts.get(constraint["state"], 0) + 1
        return {
            "site": SITE,
            "version": self.version,
            "settled": self.settled,
            "idle": True,
            "scans": {"accepted": 40, "processed": 40, "pending": 0, "skipped": 0},
            "robots": ["ada", "bob"],
            "components": self._components(),
            "merged_into": {"c1": "c0"} if self.joined else {},
            "constraints": {"rendezvous": counts},
            "trouble": self.trouble,
            "remaking": self.remaking,
        }

    def _of_view(self) -> dict[str, Any]:
        return {"site": SITE, "version": self.version, "settled": self.settled}

    def told(self) -> dict[str, dict[str, Any]]:
        """What events tell of as it is now: one for each thing that is not as it was."""
        told = {
            c["id"]: {"type": "constraint", "kind": c["kind"], "state": c["state"]}
            for c in self.constraints
        }
        kind = "component-merged" if self.joined else "component-split"
        return told | {"c1": {"type": kind, "component": "c1"}}

    def floorplan(self, plan: dict[str, dict[str, float]]) -> dict[str, Any]:
        """`GET …/floorplan`."""
        places = [
            {
                "component": c["id"],
                "verdict": "registered" if c["id"] in plan else "none",
                "reason": "" if c["id"] in plan else "too little is seen of it",
                "T_plan_map": plan.get(c["id"]),
            }
            for c in self._components()
        ]
        return {"site": SITE, "version": self.version, "components": places}

    def differences(self, component: str) -> dict[str, Any]:
        """`GET …/floorplan/differences`."""
        missing = {"x1": 4.0, "y1": 5.0, "x2": 4.0, "y2": 11.0, "line": None}
        return {"component": component, "missing": [missing], "new": []}

    def map(self) -> dict[str, Any]:
        """`GET …/map`."""
        lines = [self._line(i, "c0", "ada", wall) for i, wall in enumerate(ROOM)]
        lines += [self._line(10 + i, "c1", "bob", wall) for i, wall in enumerate(ROOM)]
        components = [{"id": c["id"], "robots": c["robots"]} for c in self._components()]
        return {**self._of_view(), "components": components, "lines": lines}

    def changes(self, since: int) -> dict[str, Any]:
        """`GET …/map?since=`: the whole map, as from a service that has just begun."""
        return self.map() | {"full": True, "since": since, "removed": []}

    def robots(self) -> dict[str, Any]:
        """`GET …/robots`."""
        robots = [self._robot("ada", "c0"), self._robot("bob", "c1")]
        return {"site": SITE, "version": self.version, "robots": robots}

    def graph(self) -> dict[str, Any]:
        """`GET …/graph`."""
        nodes = [
            *(self._keyframe(i, "ada", "c0", i) for i in range(STEPS)),
            *(self._keyframe(STEPS + i, "bob", "c1", i) for i in range(STEPS)),
        ]
        ways = [
            *range(STEPS - 1),
            *range(STEPS, 2 * STEPS - 1),
        ]
        edges = [
            {"source": f"k{i}", "target": f"k{i + 1}", "key": f"s{i}", "kind": "sequential"}
            for i in ways
        ]
        submaps = [
            {"id": "a", "robot": "ada", "anchor": "k2", "keyframes": [f"k{i}" for i in range(5)]},
            {"id": "b", "robot": "bob", "anchor": "k14", "keyframes": ["k12", "k13", "k14", "k15"]},
        ]
        summary = {**self._of_view(), "submaps": submaps}
        return {"graph": summary, "nodes": nodes, "edges": edges}

    def trajectory(self, robot: str) -> dict[str, Any]:
        """`GET …/robots/{robot}/trajectory`."""
        nodes = self.graph()["nodes"]
        poses = [node for node in nodes if node["robot"] == robot]
        return {"robot": robot, "version": self.version, "poses": poses}

    def _components(self) -> list[dict[str, Any]]:
        if self.joined:
            return [{"id": "c0", "robots": ["ada", "bob"], "keyframes": 2 * STEPS}]
        return [
            {"id": "c0", "robots": ["ada"], "keyframes": STEPS},
            {"id": "c1", "robots": ["bob"], "keyframes": STEPS},
        ]

    def _placed(self, component: str, x: float, y: float, theta: float) -> dict[str, Any]:
        if component == "c1" and self.joined:
            tx, ty, turn = T_C0_C1
            c, s = math.cos(turn), math.sin(turn)
            x, y, theta = tx + c * x - s * y, ty + s * x + c * y, theta + turn
            component = "c0"
        return {"component": component, "x": x, "y": y, "theta": theta}

    def _line(
        self, number: int, component: str, robot: str, wall: tuple[float, float, float, float]
    ) -> dict[str, Any]:
        start = self._placed(component, wall[0], wall[1], 0.0)
        end = self._placed(component, wall[2], wall[3], 0.0)
        return {
            "id": f"l{number}",
            "component": start["component"],
            **{"x1": start["x"], "y1": start["y"], "x2": end["x"], "y2": end["y"]},
            "sigma": 0.004,
            "support": 3 + number,
            "robots": [robot],
            "first_seen": 1000.0 + number % 10,
            "last_seen": 1011.0,
        }

    def _robot(self, name: str, component: str) -> dict[str, Any]:
        placed = self._placed(component, 4.0, 2.0, 0.5)
        covariance = [[0.04, 0.01, 0.0], [0.01, 0.02, 0.0], [0.0, 0.0, 0.001]]
        pose = {key: placed[key] for key in ("x", "y", "theta")} | {"covariance": covariance}
        return {
            "robot": name,
            "site": SITE,
            "component": placed["component"],
            "pose": pose,
            "state": "tracking",
            "scans": {"accepted": 20, "processed": 20, "pending": 0, "skipped": 0},
            "keyframes": STEPS,
            "latest_stamp": 1011.0,
            "latest_session": "0",
            "latest_seq": 19,
            "mount": None,
            "health": ["the lidar sees nothing to the left"] if name == "bob" else [],
        }

    def _keyframe(self, number: int, robot: str, component: str, step: int) -> dict[str, Any]:
        placed = self._placed(component, 1.0 + step / 4, 2.0, 0.0)
        stamp = {"session": "0", "seq": step, "stamp": 1000.0 + step}
        return {"id": f"k{number}", "robot": robot, **stamp, **placed}

    def _turn(self, before: str, after: str, reason: str) -> None:
        for constraint in self.constraints:
            if constraint["state"] == before:
                constraint.update(state=after, reason=reason)


def _candidate(identity: str) -> dict[str, Any]:
    a, b = (f"k{part}" for part in identity[1:].split("-"))
    return {
        "id": identity,
        "kind": "rendezvous",
        "state": "candidate",
        "keyframe_a": a,
        "keyframe_b": b,
        "robot_a": "ada",
        "robot_b": "bob",
        "T_a_b": {"x": 5.0, "y": 0.4, "theta": 1.57},
        "information": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        "reason": "waits for more that agree",
        "checks": {"overlap": 8.4, "conflict_share": 0.03, "margin": 0.4},
        "consistency_set": ["p5-17", "p3-15"],
        "residual": None,
        "history": [{"version": 12, "state": "candidate", "reason": "two places look alike"}],
    }


def _rejected(identity: str) -> dict[str, Any]:
    return _candidate(identity) | {
        "state": "rejected",
        "reason": "walls of one place stand in free space of the other",
        "checks": {"overlap": 6.1, "conflict_share": 0.31, "margin": 0.2},
        "consistency_set": [],
    }


def evidence(constraint: dict[str, Any]) -> dict[str, Any]:
    """Return what `GET …/constraints/{id}` adds to a constraint of the list."""
    share = constraint["checks"]["conflict_share"]
    return constraint | {
        "limits": {
            "overlap": {
                **{"at_least": 3.0, "at_most": None, "holds": True},
                **{"means": "Common wall", "unit": "m"},
            },
            "conflict_share": {
                **{"at_least": None, "at_most": 0.12, "holds": share <= 0.12},
                **{"means": "Share in free space", "unit": "share"},
            },
            "margin": {
                **{"at_least": None, "at_most": None, "holds": True},
                **{"means": "Margin to runner-up", "unit": "share"},
            },
        },
        "matched": [
            {
                "reference": list(wall),
                "current": [end + 0.05 for end in wall],
                "overlap": 4.0,
                "distance": 0.05,
                "angle": 0.0,
            }
            for wall in ROOM
        ],
        "conflicts": [[3.0, 1.0 + 0.1 * i] for i in range(5)],
        "votes": 31.5,
        "runner_up": {"x": 1.0, "y": 2.0, "theta": -1.57, "evidence": 12.0},
        "margin": 0.4,
    }


def _move(robot: str, moved_m: float | None, after: str) -> dict[str, Any]:
    return {
        "robot": robot,
        "moved_m": moved_m,
        "turned_rad": None if moved_m is None else moved_m / 10,
        "component_before": "c0",
        "component_after": after,
    }
