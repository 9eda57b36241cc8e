"""Stages tell how long they took, to whoever listens; otherwise they are as without."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import pytest
from lineloom_core import timing
from lineloom_core.geometry import Pose
from lineloom_core.graph import PoseGraph


@pytest.fixture(autouse=True)
def _nobody_listens_afterwards() -> Iterator[None]:
    yield
    timing.listen(None)


@timing.timed("halve")
def halve(value: int, *, strict: bool = False) -> float:
    """Half of it."""
    if strict and value % 2:
        raise ValueError("odd")
    return value / 2


def test_a_stage_is_the_function_it_was() -> None:
    told: list[tuple[str, float]] = []
    assert halve(4) == 2.0
    timing.listen(lambda stage, seconds: told.append((stage, seconds)))
    assert halve(4, strict=True) == 2.0
    with pytest.raises(ValueError, match="odd"):
        halve(3, strict=True)
    assert [stage for stage, _ in told] == ["halve", "halve"]
    assert all(0.0 <= seconds < 1.0 for _, seconds in told)
    assert halve.__doc__ == "Half of it."
    timing.listen(None)
    halve(4)
    assert len(told) == 2


def test_the_solver_is_a_stage() -> None:
    runs: Counter[str] = Counter()
    timing.listen(lambda stage, _: runs.update([stage]))
    graph = PoseGraph()
    graph.add_node(0, Pose(0.0, 0.0, 0.0))
    graph.optimise(0)
    assert runs == {"optimise": 1}
