"""The optimum of a whole component: right answers, the same bits, no crash."""

from __future__ import annotations

import math
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.geometry import Pose, se2
from lineloom_core.graph import Edge, project_out_weak
from lineloom_core.graph.growth import Growth
from lineloom_core.graph.solver import settle
from numpy.typing import NDArray

from tests.core.graph import dense_twins
from tests.core.graph.graphs import INFORMATION, dead_reckoning, laps, random_component


def component_of(poses: dict[int, Pose], edges: list[Edge]) -> Growth:
    return Growth.of(np.array(list(poses)), se2.stack(poses.values()), edges)


def rmse(poses: NDArray[np.float64], truth: list[Pose]) -> float:
    off = poses[:, :2] - se2.stack(truth)[:, :2]
    return math.sqrt(float((off**2).sum(axis=1).mean()))


def run_for_bits() -> str:
    _, edges = laps(400, 60, seed=3)
    return settle(component_of(dead_reckoning(400, edges), edges), 0)[0].tobytes().hex()


@pytest.mark.parametrize("seed", range(8))
def test_it_is_the_dense_optimum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 20))
    component, _ = random_component(rng, count, int(rng.integers(0, count)), wrong=seed % 3)
    held = int(rng.integers(count))
    found, twin = settle(component, held)[0], dense_twins.optimum(component, held)
    assert np.abs(se2.between(twin, found)).max() < 1e-5
    np.testing.assert_array_equal(found[held], component.poses[held])


def test_exact_measurements_are_met_exactly() -> None:
    rng = np.random.default_rng(5)
    component, truth = random_component(rng, 40, 30, noise=0.0)
    off = se2.compose(truth, rng.normal(0.0, (0.1, 0.1, 0.03), truth.shape))
    off[7] = truth[7]
    found = settle(replace(component, poses=off), 7)[0]
    np.testing.assert_allclose(se2.between(truth, found), 0.0, atol=1e-7)


def test_loops_take_the_drift_out_even_when_a_third_are_wrong() -> None:
    truth, edges = laps(800, 90, seed=5, wrong=30)
    component = component_of(dead_reckoning(800, edges), edges)
    found = settle(component, 0)[0]
    assert rmse(found, truth) < 0.5 * rmse(component.poses, truth)
    chi2 = dict(zip(component.names, dense_twins.chi2(component, found), strict=True))
    assert max(chi2[f"l{k}"] for k in range(60)) < 30.0
    assert min(chi2[f"l{k}"] for k in range(60, 90)) > 300.0


def test_the_order_of_the_nodes_does_not_matter_and_ids_are_ascending() -> None:
    component, _ = random_component(np.random.default_rng(4), 30, 20)
    order = np.random.default_rng(0).permutation(30)
    turned = replace(component, ids=component.ids[order], poses=component.poses[order])
    assert settle(turned, 3)[0].tobytes() == settle(component, 3)[0].tobytes()


def test_same_bits_again_and_in_another_process() -> None:
    here = run_for_bits()
    assert run_for_bits() == here
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parents[3])!r}); "
        "import tests.core.graph.test_graph_solver as t; print(t.run_for_bits())"
    )
    there = subprocess.run(
        [sys.executable, "-c", code],
        env={"PYTHONHASHSEED": "1", "PATH": "", "PYTHONPATH": ":".join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert there.stdout.strip() == here


def test_a_poor_start_is_left_to_damping() -> None:
    """Loops that start metres off: Gauss-Newton may overshoot, the answer must not suffer."""
    for seed in range(12):
        rng = np.random.default_rng(seed)
        component, _ = random_component(rng, 40, 12)
        poses = se2.compose(component.poses, rng.normal(0.0, (4.0, 4.0, 1.5), (40, 3)))
        off = replace(component, poses=poses)
        found = settle(off, 0)[0]
        assert np.isfinite(found).all()
        assert dense_twins.cost(off, found) <= dense_twins.cost(off, poses)


def test_weak_edges_slide_freely_and_hold_across() -> None:
    """Two nodes tied by a corridor edge only across; a third edge decides the way along."""
    weak = project_out_weak(np.diag([4.0, 2500.0, 40000.0]))
    edges = [
        Edge("corridor", "loop", 0, 1, Pose(1.0, 0.0, 0.0), weak, True),
        Edge("along", "sequential", 0, 1, Pose(1.7, 0.3, 0.0), np.diag([900.0, 1.0, 1.0]), False),
    ]
    start = {0: Pose.identity(), 1: Pose(0.5, 0.2, 0.1)}
    solved = settle(component_of(start, edges), 0)[0][1]
    assert solved[0] == pytest.approx(1.7, abs=1e-3)
    assert solved[1] == pytest.approx(0.0, abs=1e-3)
    only = settle(component_of(start, edges[:1]), 0)[0][1]
    assert only[1] == pytest.approx(0.0, abs=1e-3)
    assert abs(only[0] - 0.5) < 0.1  # nothing pulls along the corridor


def test_one_node_stays() -> None:
    alone = component_of({4: Pose(1.0, 2.0, 0.5)}, [])
    np.testing.assert_array_equal(settle(alone, 4)[0], [[1.0, 2.0, 0.5]])


def test_a_long_chain_does_not_crash_on_a_small_stack() -> None:
    n = 20_000
    _, edges = laps(n, 0, seed=1)
    poses = dead_reckoning(n, edges)
    end = poses[5].between(poses[n - 5]) @ Pose(0.3, 0.2, 0.0)
    edges.append(Edge("loop", "loop", 5, n - 5, end, INFORMATION, True))
    component = component_of(poses, edges)
    results: list[NDArray[np.float64]] = []
    before = threading.stack_size(1 << 20)
    try:
        thread = threading.Thread(target=lambda: results.append(settle(component, 0)[0]))
        thread.start()
        thread.join()
    finally:
        threading.stack_size(before)
    assert dense_twins.chi2(component, results[0])[-1] < 1.0
