"""What lies between two views: every change once, and nothing where nothing changed."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
from lineloom import wire
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.site_view import (
    ComponentView,
    ConstraintView,
    KeyframeView,
    MapLine,
    RobotView,
    SiteView,
)
from lineloom_core.mapping.answers.view_change import EMPTY_VIEW
from lineloom_core.mapping.facts.scan_name import ScanName
from lineloom_service.events.difference import MOST_LINES_LISTED, events_between


def _line(name: str, x: float = 0.0, component: str = "c1") -> MapLine:
    return MapLine(name, component, x, 0.0, x + 1.0, 0.0, 0.01, 3, ("a",), 0.0, 1.0)


def _robot(name: str, scans: int, component: str = "c1", **changes: Any) -> RobotView:
    pose, covariance = Pose(float(scans), 0.0, 0.0), np.eye(3)
    robot = RobotView(name, component, pose, covariance, "tracking", scans, 1, 1.0, "0", scans - 1)
    return replace(robot, **changes)


def _constraint(name: str, state: Any, a: int = 0, b: int = 1) -> ConstraintView:
    scans = (ScanName("ab"[a], "0", 0), ScanName("ab"[b], "0", 0))
    return ConstraintView(
        name, "rendezvous", state, str(a), str(b), Pose(0, 0, 0), np.eye(3), "because",
        "recognition", *scans,
    )  # fmt: skip


def _keyframes(**component_of: str) -> tuple[KeyframeView, ...]:
    return tuple(
        KeyframeView(str(i), robot, component, "0", 0, 0.0, Pose(0, 0, 0))
        for i, (robot, component) in enumerate(component_of.items())
    )


APART = replace(
    EMPTY_VIEW,
    settled=False,
    version=7,
    robots={"a": _robot("a", 3), "b": _robot("b", 4, "c2")},
    components=(ComponentView("c1", ("a",), 1), ComponentView("c2", ("b",), 1)),
    lines=(_line("l1"), _line("l2", component="c2")),
    keyframes=_keyframes(a="c1", b="c2"),
    constraints=(_constraint("k1", "candidate"),),
)
JOINED = replace(
    APART,
    version=9,
    robots={"a": _robot("a", 3), "b": _robot("b", 6)},
    components=(ComponentView("c1", ("a", "b"), 2),),
    merged_into={"c2": "c1"},
    lines=(_line("l1"), _line("l2", 5.0)),
    keyframes=_keyframes(a="c1", b="c1"),
    constraints=(_constraint("k1", "accepted"),),
)


def _by_type(old: SiteView, new: SiteView) -> dict[str, list[dict[str, Any]]]:
    found: dict[str, list[dict[str, Any]]] = {}
    for event in events_between(old, new, 1.5):
        assert (event.version, event.at) == (new.version, 1.5)
        assert wire.Event.model_validate_json(event.model_dump_json()).root == event
        found.setdefault(event.type, []).append(event.model_dump(exclude={"version", "at"}))
    return found


def test_nothing_happened() -> None:
    for view in (EMPTY_VIEW, APART, JOINED):
        assert events_between(view, replace(view, version=view.version + 1), 0.0) == []


def test_that_a_map_has_settled_is_told_once_even_where_nothing_moved() -> None:
    rests = replace(APART, settled=True)
    (told,) = _by_type(APART, rests)["map"]
    assert told == {
        "type": "map", "changed": [], "removed": [], "complete": True, "settled": True
    }  # fmt: skip
    assert _by_type(rests, rests) == _by_type(rests, APART) == {}
    moved = replace(rests, lines=(_line("l1", 0.002), *APART.lines[1:]))
    assert set(_by_type(APART, moved)) == {"map"}
    assert _by_type(APART, moved)["map"][0]["changed"] == ["l1"]


def test_a_merge_tells_its_cause_first() -> None:
    assert list(_by_type(APART, JOINED)) == [
        *("scan", "constraint", "component-merged", "map", "robot")
    ]
    found = _by_type(APART, JOINED)
    (merged,) = found["component-merged"]
    assert merged == {
        "type": "component-merged",
        "component": "c2",
        "merged_into": "c1",
        "robots": ["a", "b"],
        "constraints": ["k1"],
    }
    (constraint,) = found["constraint"]
    assert (constraint["was"], constraint["state"]) == ("candidate", "accepted")
    assert (constraint["robot_a"], constraint["robot_b"]) == ("a", "b")
    (scan,) = found["scan"]
    assert (scan["robot"], scan["added"], scan["processed"]) == ("b", 2, 6)
    told = {"changed": ["l2"], "removed": [], "complete": True, "settled": False}
    assert found["map"] == [{"type": "map", **told}]
    (robot,) = found["robot"]
    assert (robot["robot"], robot["component"]) == ("b", "c1")


def test_a_merge_undone_is_a_split() -> None:
    found = _by_type(JOINED, replace(APART, version=10))
    assert found["component-split"] == [
        {"type": "component-split", "component": "c2", "split_from": "c1", "robots": ["b"]}
    ]
    assert "component-merged" not in found


def test_a_split_under_a_new_name_is_known_by_its_keyframes() -> None:
    split = replace(
        JOINED,
        version=10,
        components=(ComponentView("c1", ("a",), 1), ComponentView("c8", ("b",), 1)),
        merged_into={"c2": "c1"},
        keyframes=_keyframes(a="c1", b="c8"),
    )
    (found,) = _by_type(JOINED, split)["component-split"]
    assert (found["component"], found["split_from"]) == ("c8", "c1")


def test_a_new_component_is_no_split() -> None:
    assert set(_by_type(EMPTY_VIEW, APART)) == {"scan", "constraint", "map", "robot"}


def test_a_chain_of_merges_ends_at_the_last_survivor() -> None:
    chained = replace(JOINED, merged_into={"c3": "c2", "c2": "c1"})
    assert [e["merged_into"] for e in _by_type(APART, chained)["component-merged"]] == ["c1", "c1"]
    later = replace(chained, version=12, merged_into={**chained.merged_into, "c4": "c3"})
    assert [e["component"] for e in _by_type(chained, later)["component-merged"]] == ["c4"]


def test_a_forgotten_robot_takes_its_lines_and_constraints_along() -> None:
    alone = replace(
        APART,
        version=8,
        robots={"a": APART.robots["a"]},
        components=APART.components[:1],
        lines=APART.lines[:1],
        keyframes=APART.keyframes[:1],
        constraints=(),
    )
    found = _by_type(APART, alone)
    assert [(e["robot"], e["forgotten"]) for e in found["robot"]] == [("b", True)]
    assert [(e["state"], e["robot_b"]) for e in found["constraint"]] == [("removed", "b")]
    assert found["map"][0]["removed"] == ["l2"]


def test_a_robot_that_started_anew_counts_from_nothing() -> None:
    again = replace(APART, version=9, robots={**APART.robots, "b": _robot("b", 1, "c5")})
    (scan,) = _by_type(APART, again)["scan"]
    assert (scan["robot"], scan["added"], scan["processed"]) == ("b", 1, 1)


def test_more_lines_than_can_be_listed() -> None:
    many = replace(APART, lines=tuple(_line(f"m{i}") for i in range(MOST_LINES_LISTED + 1)))
    (event,) = _by_type(APART, many)["map"]
    told = {"changed": [], "removed": [], "complete": False, "settled": False}
    assert event == {"type": "map", **told}


def test_the_difference_of_lines_is_all_of_it() -> None:
    rng = np.random.default_rng(4)
    views = [EMPTY_VIEW]
    for version in range(1, 30):
        names = rng.choice(40, size=rng.integers(0, 30), replace=False)
        lines = tuple(_line(f"l{n}", float(rng.integers(0, 3))) for n in names)
        views.append(replace(EMPTY_VIEW, version=version, lines=lines))
    held: dict[str, MapLine] = {}
    for old, new in itertools.pairwise(views):
        now = {line.id: line for line in new.lines}
        for event in _by_type(old, new).get("map", []):
            held.update({name: now[name] for name in event["changed"]})
            for name in event["removed"]:
                del held[name]
        assert held == now
