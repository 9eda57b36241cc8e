"""One table of checks: every figure has its row, every row its figure, parameter and words."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.check import Check, Checks
from lineloom_core.checks import (
    DOUBTED,
    JOINED,
    LOCALISED,
    NEAR_LOOP,
    RECOGNISED,
    TABLES,
    TRACKED,
    WIDE_LOOP,
)
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.parameters import effective
from lineloom_lab.simulation import Fleet, rooms, scanner_360

from tests.core.mapping.drives import mapped
from tests.docs.checks_page import PAGE, page, parameters_of

CORE = Path(__file__).parents[2] / "core" / "lineloom_core"
UNITS = {
    "", "share", "m", "rad", "s", "σ", "1/m²", "intervals",
    "points", "objects", "places", "constraints",
}  # fmt: skip
ROWS = [pytest.param(t, row, id=f"{t.section}.{row.name}") for t in TABLES for row in t.rows]


@pytest.fixture(scope="module")
def mapper() -> SiteMapper:
    """Two robots that go round the same rooms."""
    fleet = Fleet.touring(rooms(0), robots=2, duration_s=60.0, lidar=scanner_360())
    return mapped(list(fleet.scans()))


def measured() -> set[str]:
    """Names under which the core puts a figure down, the table itself aside."""
    names: set[str] = set()
    for path in CORE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            keys: list[ast.expr | None] = []
            if isinstance(node, ast.Dict):
                keys = list(node.keys)
            elif isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store):
                keys = [node.slice]
            names |= {str(k.value) for k in keys if isinstance(k, ast.Constant)}
    return names


def test_every_row_has_a_figure() -> None:
    assert sorted({row.name for t in TABLES for row in t.rows} - measured()) == []


def test_every_figure_has_a_row(mapper: SiteMapper) -> None:
    constraints = mapper.view().constraints
    assert {c.kind for c in constraints} == {"sequential", "loop", "rendezvous"}
    for c in constraints:
        evidence = mapper.explain(c.id)
        assert evidence is not None
        assert evidence.limits.keys() == c.checks.keys(), c.id
    scans = [k.scan for k in list(mapper._site.keyframes.values())[:6]]
    (best, *_) = mapper.localise(scans).hypotheses
    assert best.limits.keys() == best.checks.keys() == {row.name for row in LOCALISED.rows}


def test_every_figure_of_a_table_is_really_shown(mapper: SiteMapper) -> None:
    """But those of second thoughts, which nothing gives rise to here (see their own tests)."""
    shown = {name for c in mapper.view().constraints for name in c.checks}
    tables = (TRACKED, NEAR_LOOP, RECOGNISED, WIDE_LOOP, JOINED)
    assert sorted({row.name for t in tables for row in t.rows} - shown) == []


@pytest.mark.parametrize(("checks", "row"), ROWS)
def test_a_row_says_what_it_is_and_what_it_is_held_to(checks: Checks, row: Check) -> None:
    assert row.means
    assert row.unit in UNITS
    parameter = row.at_least or row.at_most
    assert not (row.at_least and row.at_most), "one way"
    if row.name != "kin":  # which never speaks against anything
        held = bool(parameter or row.weighed)
        assert held == bool(row.objection), "who can object says why, and nobody else"
    assert bool(row.told) == (row.adjusted is not None)
    if parameter:
        told = effective(parameters_of(checks))[parameter]
        assert row.unit == told.unit


def test_a_name_stands_once_in_what_one_constraint_is_held_to() -> None:
    for way in ((TRACKED, DOUBTED), (NEAR_LOOP, DOUBTED), (RECOGNISED, WIDE_LOOP, JOINED, DOUBTED)):
        names = [row.name for t in way for row in t.rows]
        assert len(set(names)) == len(names)


def test_the_first_check_that_speaks_against_gives_the_reason() -> None:
    config = MapperConfig().join
    good = {"set_size": 2.0, "set_evidence": 20.0, "set_missing": 0.08, "doubt": config.most_false}
    assert JOINED.objection(config, good) == ""
    bad = {**good, "set_missing": 0.09, "set_size": 1.0}
    assert JOINED.objection(config, bad) == "too few constraints agree"
    worse = {**good, "set_missing": 0.09, "doubt": 0.4}
    assert "missing for the other (9.0%)" in JOINED.objection(config, worse)
    assert JOINED.objection(config, {**good, "doubt": 0.031}) == "it may be false (3.1%)"


def test_many_at_once_are_judged_as_each_alone() -> None:
    config = MapperConfig()
    rng = np.random.default_rng(3)
    strain = {"strain_m": rng.uniform(0.0, 1.0, 300), "strain_rad": rng.uniform(0.0, 0.24, 300)}
    common = {"fit": rng.uniform(0.3, 0.9, 300)}
    for checks, part, columns in (
        (DOUBTED, config.doubt, strain),
        (NEAR_LOOP, config.near_loops, common),
    ):
        rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
        alone = [checks.against(part, row) is not None for row in rows]
        assert checks.against_each(part, columns).tolist() == alone
        assert 50 < sum(alone) < 250
    at_the_limit = {"strain_m": np.array([config.doubt.most_strain])}
    assert DOUBTED.against_each(config.doubt, at_the_limit).tolist() == [False]


def test_a_step_is_held_to_more_after_a_gap_and_to_less_where_the_lidar_is_noisy() -> None:
    config = MapperConfig().tracker
    step = {"fit": 0.3, "conflict_share": 0.25, "gap": 1.0, "noise": 1.0}
    held = TRACKED.limits(config, step)
    assert (held["fit"].holds, held["conflict_share"].holds) == (True, False)
    noisy = TRACKED.limits(config, {**step, "noise": 2.0})
    assert noisy["conflict_share"].at_most == config.noisy_conflict
    late = TRACKED.limits(config, {**step, "gap": 4.0})
    assert (late["fit"].at_least, late["conflict_share"].at_most) == (0.5, 0.1)


def test_the_page_is_what_the_table_says() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "python -m tests.docs.checks_page"
