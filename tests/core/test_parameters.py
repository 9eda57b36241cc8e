"""Every parameter says what it is, and none can be what it cannot be."""

from __future__ import annotations

import math
from typing import Any

import pytest
from lineloom_core.mapping.config import JoinConfig, MapperConfig, config_from
from lineloom_core.parameters import Choice, ParameterError, by_name, effective, values

PARAMETERS = dict(by_name(effective(MapperConfig())))


def test_every_parameter_has_a_meaning_and_a_default_that_can_be() -> None:
    assert len(PARAMETERS) > 120, "the search for parameters is broken"
    assert [name for name, p in PARAMETERS.items() if not p.meaning] == []
    words = {name: p for name, p in PARAMETERS.items() if isinstance(p, Choice)}
    numbers = {name: p for name, p in PARAMETERS.items() if name not in words}
    assert [name for name, p in numbers.items() if not p.least <= p.default <= p.most] == []
    assert [name for name, p in numbers.items() if p.whole != isinstance(p.value, int)] == []
    assert {name: (p.default, p.choices) for name, p in words.items()} == {
        "matcher": ("lineloom", ("lineloom", "thesis"))
    }


def test_what_differs_from_the_default_shows() -> None:
    shown = dict(by_name(effective(MapperConfig(join=JoinConfig(least_set=5)))))
    changed = {name: (p.value, p.default) for name, p in shown.items() if p.value != p.default}
    assert changed == {"join.least_set": (5, 2)}


def test_the_default_of_a_part_is_that_of_its_place() -> None:
    assert PARAMETERS["recognition.least_explained"].default == 5.0
    assert PARAMETERS["localise.recognition.least_explained"].default == 3.0


def test_a_config_is_what_its_values_say() -> None:
    config = MapperConfig(join=JoinConfig(least_set=5), chapter=8)
    assert config_from(values(config)) == config
    assert config_from({}) == MapperConfig()


def test_what_is_not_given_is_the_base_s() -> None:
    base = MapperConfig(chapter=8)
    found = config_from({"join": {"least_evidence": 80}}, base)
    assert (found.chapter, found.join.least_evidence) == (8, 80.0)
    assert isinstance(found.join.least_evidence, float)


@pytest.mark.parametrize(
    ("given", "name", "reason"),
    [
        ({"join": {"least_sett": 3}}, "join.least_sett", "not a parameter"),
        ({"joint": {}}, "joint", "not a parameter"),
        ({"join": 3}, "join", "by name"),
        ({"join": {"least_set": 0}}, "join.least_set", "from 1 to"),
        ({"join": {"least_set": 2.5}}, "join.least_set", "whole number"),
        ({"join": {"least_set": True}}, "join.least_set", "a number"),
        ({"join": {"distinctive": math.nan}}, "join.distinctive", "from 0.001"),
        ({"join": {"least_evidence": math.inf}}, "join.least_evidence", "to 1000 m"),
        ({"tracker": {"least_fit": 1.5}}, "tracker.least_fit", "from 0 to 1"),
        ({"chapter": "many"}, "chapter", "a number, not 'many'"),
        ({"chapter": {"of": 3}}, "chapter", "a number"),
        ({"localise": {"recognition": {"cell": 0}}}, "localise.recognition.cell", "from 0.02"),
        ({"matcher": "karto"}, "matcher", "lineloom or thesis, not 'karto'"),
        ({"matcher": 3}, "matcher", "lineloom or thesis, not 3"),
        ({"persistence": {"near": 0.5}}, "persistence.near", "persistence.far only 0.3"),
        ({"persistence": {"far": 0.1}}, "persistence.far", "persistence.near already 0.15"),
    ],
)
def test_what_cannot_be_is_refused_by_name(given: dict[str, Any], name: str, reason: str) -> None:
    with pytest.raises(ParameterError, match=reason) as refused:
        config_from(given)
    assert list(refused.value.wrong) == [name]
    assert name in str(refused.value)


def test_all_that_is_wrong_is_named() -> None:
    given = {
        "join": {"least_sett": 3, "least_set": 4, "distinctive": 0},
        "chapter": 8.5,
        "persistence": {"near": 0.5},
        "recognition": {"cell": "wide", "half": 0.5},
        "tracker": 3,
    }
    with pytest.raises(ParameterError) as refused:
        config_from(given)
    assert {name: reason.split()[0] for name, reason in refused.value.wrong.items()} == {
        "join.least_sett": "is",
        "join.distinctive": "has",
        "chapter": "has",
        "recognition.cell": "has",
        "tracker": "has",
        "persistence.near": "is",
    }
    assert all(
        f"{name}: {reason}" in str(refused.value) for name, reason in refused.value.wrong.items()
    )
