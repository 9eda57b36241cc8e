"""Checkpoints save time and change nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest
from lineloom_core.mapping import site_mapper
from lineloom_core.mapping.advance import contradicted_by_next
from lineloom_core.mapping.answers.site_view import ConstraintView, SiteView
from lineloom_core.mapping.belief.checkpoints import _stays
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.config import MapperConfig, ThinningConfig
from lineloom_core.mapping.facts.keyframe import Keyframe
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.simulation import Fleet, SimulatedScan, rooms, sick_lms200

from tests.core.mapping.drives import feed, fingerprint

OFTEN = MapperConfig(
    checkpoint_every=16, thinning=ThinningConfig(most_alike=2, radius=2.5, apart=12.0)
)
NEVER = replace(OFTEN, checkpoint_every=1_000_000)


@pytest.fixture(scope="module")
def log() -> list[SimulatedScan]:
    fleet = Fleet.touring(rooms(2), robots=2, seed=2, duration_s=80.0, lidar=sick_lms200())
    return list(fleet.scans())


@pytest.fixture(scope="module")
def mapped(log: list[SimulatedScan]) -> dict[str, SiteMapper]:
    """With checkpoints, and without any."""
    mappers = {"often": SiteMapper(OFTEN), "never": SiteMapper(NEVER)}
    for mapper in mappers.values():
        feed(mapper, log)
    return mappers


@pytest.fixture
def gone_through(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Keyframes that rebuilding goes through, as it does."""
    seen: list[int] = []

    def counted(site: SiteMap, keyframe: Keyframe) -> tuple[Constraint, ...]:
        seen.append(keyframe.id)
        return contradicted_by_next(site, keyframe)

    monkeypatch.setattr(site_mapper, "contradicted_by_next", counted)
    return seen


def accepted(view: SiteView) -> list[ConstraintView]:
    """All that may be retracted, the youngest last."""
    found = [c for c in view.constraints if c.state == "accepted"]
    return sorted(found, key=lambda c: latest_end(view, c))


def latest_end(view: SiteView, constraint: ConstraintView) -> int:
    """The number of its later keyframe."""
    number = {k.id: i for i, k in enumerate(view.keyframes)}
    return max(number[constraint.keyframe_a], number[constraint.keyframe_b])


def plain(mapper: SiteMapper) -> tuple[object, ...]:
    return fingerprint(mapper.view())


@pytest.mark.parametrize("age", [1, 25, 150])
def test_undo_and_redo_from_a_checkpoint_are_those_from_the_beginning(
    mapped: dict[str, SiteMapper], age: int, gone_through: list[int]
) -> None:
    often, never = mapped["often"], mapped["never"]
    assert plain(often) == plain(never)
    chosen = accepted(often.view())[-age]
    end, begun = latest_end(often.view(), chosen), []
    for act in (SiteMapper.retract, SiteMapper.restore):
        for mapper in (often, never):
            gone_through.clear()
            act(mapper, chosen.id)
            begun.append(gone_through[0])
        assert plain(often) == plain(never)
    assert begun[1] == begun[3] == 0
    assert end - 40 < begun[0] or begun[0] == 0
    if age == 1:
        assert begun[0] > 100


def test_asking_what_if_leaves_the_checkpoints_alone(mapped: dict[str, SiteMapper]) -> None:
    mapper = mapped["often"]
    before, count = plain(mapper), len(mapper._checkpoints)
    assert count > 1
    for constraint in accepted(mapper.view())[::-40]:
        assert mapper.what_if(constraint.id) is not None
    assert len(mapper._checkpoints) == count
    assert plain(mapper) == before


def test_checkpoints_get_sparser_with_age() -> None:
    """Of n made, a few times log n stay, and one that was let go is never wanted again."""
    for made in (10, 100, 1000, 5000):
        kept = [n for n in range(made) if _stays(n, made - n)]
        assert len(kept) <= 3 * (1 + made.bit_length() // 2)
        later = {n for n in range(made + 1) if _stays(n, made + 1 - n)} - {made}
        assert later <= set(kept)
        assert kept[-1] == made - 1
