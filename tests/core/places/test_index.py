"""The shortlist of places: its laws, its slow twin, and that it finds what it should."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.places import Place, PlaceIndex
from lineloom_core.places import _index_kernels as kernels
from lineloom_core.places import index as place_index
from lineloom_lab.simulation import sick_lms200
from numpy.typing import NDArray

from tests.core.places.conftest import Stretch, of_one_line, office_stretches

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def many() -> list[Stretch]:
    return office_stretches(sick_lms200(), 16)


def lying_twin(ref: Array, cur: Array, pose: Array, reach: float, cos_gate: float) -> float:
    """`lying_length` with points instead of formulas for the overlap: a centimetre apart."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    R = np.array([[c, -s], [s, c]])
    total = 0.0
    for j in cur:
        a, b, v = R @ j[:2] + pose[:2], R @ j[2:4] + pose[:2], R @ j[4:6]
        best = 0.0
        for i in ref:
            u = i[4:6]
            off = abs(u[0] * (a + b)[1] / 2 - u[1] * (a + b)[0] / 2 - i[6])
            if u @ v < cos_gate or off > reach:
                continue
            along = np.linspace(u @ a, u @ b, 2000)
            inside = (along >= u @ i[:2]) & (along <= u @ i[:2] + i[7])
            best = max(best, inside.mean() * abs(u @ (b - a)) * (1 - 0.5 * off / reach))
        total += best
    return total


def test_lying_length_agrees_with_its_slow_twin(many: list[Stretch]) -> None:
    rng = np.random.default_rng(1)
    for stretch in many[:4]:
        ref = kernels.short_lines(stretch.forth.place.lines)
        cur = kernels.short_lines(stretch.again.place.lines)
        true = stretch.forth.T_world_anchor.between(stretch.again.T_world_anchor).to_array()
        for pose in (true, true + rng.normal(0.0, (0.2, 0.2, 0.05))):
            found = kernels.lying_length(ref, cur, pose, 0.4, 0.985)
            assert found == pytest.approx(lying_twin(ref, cur, pose, 0.4, 0.985), abs=0.1)


def test_corners_are_where_two_lines_meet(many: list[Stretch]) -> None:
    lines = many[0].forth.place.lines
    corners = kernels.corners_of(lines, 0.6, 0.5, 80)
    assert 5 < len(corners) <= 80
    assert np.all(np.diff(corners[:, 7]) <= 0.0)  # heaviest first
    starts, u = lines[:, :2], np.column_stack([np.cos(lines[:, 4]), np.sin(lines[:, 4])])
    for x, y, *_, kind, _weight in corners.tolist():
        across = (y - starts[:, 1]) * u[:, 0] - (x - starts[:, 0]) * u[:, 1]
        assert np.count_nonzero(np.abs(across) < 1e-6) >= 2
        assert 0 <= kind < 9


def test_a_place_is_likest_to_itself_and_to_its_second_visit(many: list[Stretch]) -> None:
    index = PlaceIndex()
    places = [s.forth.place for s in many]
    for k, stretch in enumerate(many):
        to_itself = index.likeness(stretch.forth.place, places)
        assert int(np.argmax(to_itself)) == k
    ranks = []
    for k, stretch in enumerate(many):
        seen_again = index.likeness(stretch.again.place, places)
        ranks.append(int(np.count_nonzero(seen_again > seen_again[k])))
    assert np.mean(np.array(ranks) < 4) >= 0.9


def test_the_answer_does_not_depend_on_what_else_is_known(many: list[Stretch]) -> None:
    full, fresh = PlaceIndex(), PlaceIndex()
    places = [s.forth.place for s in many]
    for place in places:
        full.add(place)
    asked, some = many[3].again.place, places[2:9]
    a, b = full.likeness(asked, some), fresh.likeness(asked, some)
    assert a.tobytes() == b.tobytes()
    turned_round = full.likeness(asked, some[::-1])
    assert turned_round[::-1].tobytes() == a.tobytes()


def test_what_was_forgotten_takes_no_room_and_changes_no_answer(
    many: list[Stretch], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(place_index, "_FEW", 2)
    index, places = PlaceIndex(), [s.forth.place for s in many]
    asked, kept, gone = many[3].again.place, places[9:], places[:9]
    index.likeness(asked, places)
    for place in gone:
        index.forget(place.id)
    assert len(index) < len(places)
    assert index.likeness(asked, kept).tobytes() == PlaceIndex().likeness(asked, kept).tobytes()
    back = index.likeness(asked, places)
    assert back.tobytes() == PlaceIndex().likeness(asked, places).tobytes()


def test_a_shortlist_keeps_the_order_and_all_where_there_are_few(many: list[Stretch]) -> None:
    index, places = PlaceIndex(), [s.forth.place for s in many]
    asked = many[5].again.place
    assert index.shortlist(asked, places, 16) == places
    short = index.shortlist(asked, places, 4)
    assert len(short) == 4
    numbers = [places.index(p) for p in short]
    assert numbers == sorted(numbers)
    best = np.argsort(-index.likeness(asked, places), kind="stable")[:4]
    assert sorted(best.tolist()) == numbers
    assert index.shortlist(asked, [], 4) == []


def test_a_place_without_corners_is_like_nothing(many: list[Stretch]) -> None:
    whole: Place = many[0].forth.place
    bare = of_one_line(whole)
    index = PlaceIndex()
    assert index.likeness(bare, [whole]).tolist() == [0.0]
    assert index.likeness(whole, [bare]).tolist() == [0.0]
