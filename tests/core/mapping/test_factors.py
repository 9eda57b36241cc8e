"""What a mapper believes is what gtsam has: every accepted constraint a factor."""

from __future__ import annotations

from pathlib import Path

import gtsam
import numpy as np
import pytest
from lineloom_core.geometry import se2
from lineloom_core.io.g2o import write_graph
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.simulation import Fleet, rooms, sick_lms200

from tests.core.mapping.drives import fingerprint, mapped

_WAITING = 6
"""Small loops wait until there are so many (`advance`)."""


@pytest.fixture(scope="module")
def mapper() -> SiteMapper:
    """Two robots that have met."""
    fleet = Fleet.touring(rooms(2), robots=2, seed=2, duration_s=50.0, lidar=sick_lms200())
    return mapped(list(fleet.scans()))


def test_every_accepted_constraint_is_a_factor_or_about_to_be_one(mapper: SiteMapper) -> None:
    view, graph = mapper.view(), mapper._site.graph
    accepted = {c.id: c for c in view.constraints if c.state == "accepted"}
    assert len(view.components) == 1
    assert accepted.keys() == graph.edges.keys()
    waiting = accepted.keys() - graph.factors()
    assert graph.factors() <= accepted.keys()
    assert sum(accepted[name].kind == "loop" for name in waiting) < _WAITING
    assert not any(accepted[name].kind == "rendezvous" for name in waiting)
    graph.optimise(0)
    assert graph.factors() == accepted.keys()


def test_g2o_has_the_factors_that_the_map_rests_on(mapper: SiteMapper, tmp_path: Path) -> None:
    view = mapper.view(settled=True)
    file = tmp_path / "graph.g2o"
    file.write_text(write_graph(mapper.factors()))
    factors, values = gtsam.readG2o(str(file), False)
    assert factors.size() == sum(c.state == "accepted" for c in view.constraints)
    assert values.size() == len(view.keyframes)


def test_the_settled_view_is_near_and_changes_nothing(mapper: SiteMapper) -> None:
    before = mapper.snapshot()
    plain, settled = mapper.view(), mapper.view(settled=True)
    off = se2.between(*(se2.stack(k.pose for k in v.keyframes) for v in (plain, settled)))
    assert 0.0 < np.abs(off).max() < 0.05
    assert mapper.snapshot() == before
    assert fingerprint(SiteMapper.resume(before).view(settled=True)) == fingerprint(settled)
