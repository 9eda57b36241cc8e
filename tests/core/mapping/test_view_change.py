"""A change brings one view to the other, to the last bit, and says nothing that did not change."""

from __future__ import annotations

import itertools
import math
import pickle
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.site_view import (
    ComponentView,
    ConstraintView,
    KeyframeView,
    MapLine,
    PlaceView,
    RobotView,
    SiteView,
)
from lineloom_core.mapping.answers.table_change import Same, TableChange
from lineloom_core.mapping.answers.trajectories import Trajectories, Way, Whereabouts
from lineloom_core.mapping.answers.view_change import TABLES, ViewChange
from lineloom_core.mapping.belief.constraint_state import StateChange
from lineloom_core.mapping.facts.placed_scans import ScanBlock
from lineloom_core.mapping.facts.scan_name import ScanName


class _Site:
    """Makes views in which some entries come, change, go and change places."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.version = 0

    def number(self) -> float:
        """One of few, so that entries are often what they were."""
        return [0.0, -0.0, 1.5, math.nan, math.inf][self.rng.integers(5)]

    def ids(self) -> list[int]:
        picked = self.rng.choice(12, size=self.rng.integers(0, 12), replace=False).tolist()
        return sorted(picked) if self.rng.random() < 0.5 else picked

    def view(self) -> SiteView:
        self.version += 1
        x = self.number
        names = [f"r{i}" for i in self.ids()]
        return SiteView(
            version=self.version,
            robots={n: self.robot(n) for n in names},
            components=tuple(ComponentView(f"c{i}", ("a",), 3) for i in self.ids()),
            merged_into={f"c{i}": f"c{self.rng.integers(2)}" for i in self.ids()},
            trajectories=self.trajectories(names),
            lines=tuple(
                MapLine(f"l{i}", "c1", x(), x(), 1.0, 1.0, 0.1, 3, ("a",), 0.0, 1.0)
                for i in self.ids()
            ),
            keyframes=tuple(
                KeyframeView(f"k{i}", "a", "c1", "0", i, 0.0, Pose(x(), 0.0, 0.0))
                for i in self.ids()
            ),
            constraints=tuple(self.constraint(f"s{i}") for i in self.ids()),
            places=tuple(
                PlaceView(f"p{i}", "a", f"k{i}", (f"k{i}", f"k{i + 1}")) for i in self.ids()
            ),
        )

    def robot(self, name: str) -> RobotView:
        covariance = np.full((3, 3), self.number())
        pose = Pose(self.number(), 0.0, 0.0)
        return RobotView(name, "c1", pose, covariance, "tracking", 3, 1, 1.0, "0", 2)

    def constraint(self, name: str) -> ConstraintView:
        information = np.full((3, 3), self.number())
        checks, history = {"conflict": self.number()}, (StateChange(1, "accepted", "so"),)
        T, (a, b) = Pose(1.0, 0.0, 0.0), (ScanName("a", "0", i) for i in range(2))
        return ConstraintView(
            name, "loop", "accepted", "k0", "k1", T, information, "so", "near", a, b, checks,
            residual=self.number(), history=history,
        )  # fmt: skip

    def trajectories(self, names: list[str]) -> Trajectories:
        ways = {n: Way(int(self.rng.integers(3)), (), Pose.identity()) for n in names}
        blocks = tuple(
            ScanBlock(
                ("0",),
                np.zeros(2, dtype=np.int32),
                np.arange(2),
                np.zeros(2),
                np.zeros(2, dtype=np.int64),
                np.full((2, 3), self.number()),
            )
            for way in ways.values()
            for _ in range(way.blocks)
        )
        whereabouts = Whereabouts(
            np.full((1, 3), self.number()), np.zeros(1, dtype=np.int32), ("c1",)
        )
        return Trajectories(ways, blocks, whereabouts)


def _bits(value: Any) -> Any:
    """All of it to the last bit and in order, found without the code under test."""
    if is_dataclass(value):
        return [type(value), *(_bits(getattr(value, f.name)) for f in fields(value))]
    if isinstance(value, np.ndarray):
        return [value.dtype, value.shape, value.tobytes()]
    if isinstance(value, dict):
        return [_bits(item) for item in value.items()]
    if isinstance(value, tuple | list):
        return [type(value), *map(_bits, value)]
    return value.hex() if isinstance(value, float) else value


@pytest.fixture(scope="module")
def views() -> list[SiteView]:
    site = _Site(5)
    return [site.view() for _ in range(25)]


def test_a_change_applied_to_one_view_is_the_other_to_the_last_bit(views: list[SiteView]) -> None:
    for before, after in itertools.product(views, views):
        change = ViewChange.between(before, after)
        assert _bits(change.apply(before)) == _bits(after)


def test_between_a_view_and_itself_there_is_nothing(views: list[SiteView]) -> None:
    for view in views:
        twin: SiteView = pickle.loads(pickle.dumps(view))
        assert not ViewChange.between(view, view)
        assert not ViewChange.between(view, twin)
        assert ViewChange.between(view, twin).apply(view).lines is view.lines


def test_changes_one_after_another_are_one_change(views: list[SiteView]) -> None:
    held = views[0]
    for before, after in itertools.pairwise(views):
        held = ViewChange.between(before, after).apply(held)
        assert not ViewChange.between(held, after)
        whole = ViewChange.between(views[0], after).apply(views[0])
        assert not ViewChange.between(held, whole)


def test_only_what_is_new_or_not_what_it_was_is_told(views: list[SiteView]) -> None:
    told = dict.fromkeys(TABLES, 0)
    for before, after in itertools.pairwise(views):
        change = ViewChange.between(before, after)
        assert change.version == after.version
        known = {line.id: _bits(line) for line in before.lines}
        new = [line for line in after.lines if known.get(line.id) != _bits(line)]
        assert list(change.lines.new.values()) == new
        gone = [line.id for line in before.lines if line.id not in {now.id for now in after.lines}]
        assert list(change.lines.gone) == gone
        for name, table in change.tables().items():
            told[name] += len(table.new)
            assert all(type(entry) is TABLES[name] for entry in table.new.values())
    assert min(told.values()) > 0


def test_what_did_not_change_stays_the_same_object(views: list[SiteView]) -> None:
    for before, after in itertools.pairwise(views):
        known = {line.id: line for line in before.lines}
        change = ViewChange.between(before, after)
        for line in change.apply(before).lines:
            assert line is change.lines.new.get(line.id, known.get(line.id))
    moved = replace(views[-1], version=99, robots={})
    applied = ViewChange.between(views[-1], moved).apply(views[-1])
    assert applied.lines is views[-1].lines
    assert applied.trajectories is views[-1].trajectories


def test_what_comes_at_the_end_needs_no_order() -> None:
    before, after = {"a": 1, "b": 2, "c": 3}, {"a": 1, "c": 4, "d": 5}
    change = TableChange.between(before, after)
    assert change == TableChange({"c": 4, "d": 5}, ("b",))
    assert list(change.apply(before).items()) == list(after.items())
    assert TableChange.between(before, {"c": 3, "a": 1, "b": 2}).order == ("c", "a", "b")


def test_a_change_of_another_view_is_refused(views: list[SiteView]) -> None:
    before, after = {"a": 1, "b": 2}, {"b": 2, "a": 1}
    with pytest.raises(KeyError):
        TableChange.between(before, after).apply({"a": 1})
    apart = replace(views[0], trajectories={})
    with pytest.raises(TypeError, match="put together"):
        ViewChange.between(apart, views[1])
    fewer = ViewChange.between(views[0], views[1])
    with pytest.raises(ValueError, match="blocks"):
        fewer.with_tables({**fewer.tables(), "ways": TableChange()}).apply(views[0])


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        (0.0, -0.0, False),
        (math.nan, float("nan"), True),
        (1, 1.0, False),
        (1, True, False),
        ("a", "b", False),
        ((1, "a"), (1, "a"), True),
        (np.zeros(3), np.zeros(3), True),
        (np.zeros(3), np.zeros((3, 1)), False),
        (np.zeros(3), np.zeros(3, dtype=np.int64), False),
        (np.zeros(3), -np.zeros(3), False),
        (Pose(0.0, 1.0, 2.0), Pose(0.0, 1.0, 2.0), True),
        (Pose(0.0, 1.0, 2.0), Pose(-0.0, 1.0, 2.0), False),
    ],
)
def test_sameness_is_of_every_bit(one: object, other: object, same: bool) -> None:
    assert Same()(one, other) is same
    assert Same()({"in": [one]}, {"in": [other]}) is same
