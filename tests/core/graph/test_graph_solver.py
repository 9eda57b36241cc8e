"""The solver: right answers, the same bits, no crash."""

from __future__ import annotations

import hashlib
import math
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.graph import Edge, optimize, project_out_weak
from lineloom_core.graph.edge import chi_squared

from tests.core.graph.graphs import INFORMATION, dead_reckoning, laps


def rmse(poses: dict[int, Pose], truth: list[Pose]) -> float:
    return math.sqrt(sum(poses[i].distance(t) ** 2 for i, t in enumerate(truth)) / len(truth))


def fingerprint(poses: dict[int, Pose]) -> str:
    rows = np.array([poses[i].to_array() for i in sorted(poses)])
    return hashlib.sha256(rows.tobytes()).hexdigest()


def run_for_fingerprint() -> str:
    _, edges = laps(400, 60, seed=3)
    return fingerprint(optimize(dead_reckoning(400, edges), edges).poses)


def test_exact_measurements_are_met_exactly() -> None:
    truth, _ = laps(5, 0, 0)
    edges = [
        Edge(f"e{a}{b}", "loop", a, b, truth[a].between(truth[b]), INFORMATION, True)
        for a, b in [(0, 1), (1, 2), (2, 3), (3, 4), (0, 4), (1, 3)]
    ]
    rng = np.random.default_rng(1)
    start = {
        i: p if i == 0 else p @ Pose.from_array(rng.normal(0, 0.2, 3)) for i, p in enumerate(truth)
    }
    solution = optimize(start, edges)
    assert rmse(solution.poses, truth) < 1e-5
    assert max(solution.chi2.values()) < 1e-6


def test_loops_take_the_drift_out_even_when_a_third_are_wrong() -> None:
    truth, edges = laps(800, 90, seed=5, wrong=30)
    start = dead_reckoning(800, edges)
    solution = optimize(start, edges)
    assert rmse(solution.poses, truth) < 0.5 * rmse(start, truth)
    right = [solution.chi2[f"l{k}"] for k in range(60)]
    wrong = [solution.chi2[f"l{k}"] for k in range(60, 90)]
    assert max(right) < 30.0
    assert min(wrong) > 300.0
    assert max(solution.weights[f"l{k}"] for k in range(60, 90)) < 0.03
    assert all(solution.weights[f"s{i}"] == 1.0 for i in range(1, 800))


def test_chi2_is_the_squared_whitened_error() -> None:
    _, edges = laps(200, 10, seed=2)
    solution = optimize(dead_reckoning(200, edges), edges)
    np.testing.assert_allclose(
        list(solution.chi2.values()), chi_squared(edges, solution.poses), rtol=1e-12
    )


def test_same_bits_again_in_any_order_and_in_another_process() -> None:
    here = run_for_fingerprint()
    assert run_for_fingerprint() == here
    _, edges = laps(400, 60, seed=3)
    start = dead_reckoning(400, edges)
    shuffled = [edges[i] for i in np.random.default_rng(0).permutation(len(edges))]
    assert fingerprint(optimize(dict(reversed(start.items())), shuffled).poses) == here
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); "
        "import test_graph_solver as t; print(t.run_for_fingerprint())"
    )
    for hash_seed in ("1", "2"):
        there = subprocess.run(
            [sys.executable, "-c", code],
            env={"PYTHONHASHSEED": hash_seed, "PATH": ""},
            capture_output=True,
            text=True,
            check=True,
        )
        assert there.stdout.strip() == here


def test_components_do_not_touch_each_other() -> None:
    _, edges = laps(300, 30, seed=7)
    poses = dead_reckoning(300, edges)
    alone = optimize(poses, edges).poses
    offset = 1000
    twin = [
        Edge(e.id + "x", e.kind, e.node_a + offset, e.node_b + offset, e.T_a_b, INFORMATION, True)
        for e in edges[:120]
    ]
    both = {**poses, **{i + offset: poses[i] for i in range(121)}, 5000: Pose(9.0, 9.0, 1.0)}
    together = optimize(both, [*twin, *edges]).poses
    assert {i: together[i] for i in alone} == alone
    assert together[5000] == Pose(9.0, 9.0, 1.0)


def test_anchor_keeps_its_pose_exactly() -> None:
    _, edges = laps(200, 20, seed=4)
    poses = dead_reckoning(200, edges)
    solution = optimize(poses, edges, anchors=[77])
    assert solution.poses[77] == poses[77]
    assert solution.poses[0] != poses[0]
    with pytest.raises(ValueError, match="one component"):
        optimize(poses, edges, anchors=[1, 77])
    with pytest.raises(KeyError):
        optimize(poses, edges, anchors=[12345])


def test_unknown_node_is_named() -> None:
    edge = Edge("e", "loop", 0, 9, Pose.identity(), INFORMATION, True)
    with pytest.raises(KeyError):
        optimize({0: Pose.identity()}, [edge])


def test_weak_edges_slide_freely_and_hold_across() -> None:
    """Two nodes tied by a corridor edge only across; a third edge decides the way along."""
    weak = project_out_weak(np.diag([4.0, 2500.0, 40000.0]))
    edges = [
        Edge("corridor", "loop", 0, 1, Pose(1.0, 0.0, 0.0), weak, True),
        Edge("along", "sequential", 0, 1, Pose(1.7, 0.3, 0.0), np.diag([900.0, 1.0, 1.0]), False),
    ]
    solved = optimize({0: Pose.identity(), 1: Pose(0.5, 0.2, 0.1)}, edges).poses[1]
    assert solved.x == pytest.approx(1.7, abs=1e-3)
    assert solved.y == pytest.approx(0.0, abs=1e-3)
    only = optimize({0: Pose.identity(), 1: Pose(0.5, 0.2, 0.1)}, edges[:1]).poses[1]
    assert only.y == pytest.approx(0.0, abs=1e-3)
    assert abs(only.x - 0.5) < 0.1  # nothing pulls along the corridor


def test_a_long_chain_does_not_crash_on_a_small_stack() -> None:
    """COLAMD overflows here: the process would die (see solver)."""
    n = 20_000
    step = Pose(0.5, 0.0, 0.001)
    poses = {0: Pose.identity()}
    edges = []
    for i in range(1, n):
        poses[i] = poses[i - 1] @ step
        edges.append(Edge(f"s{i}", "sequential", i - 1, i, step, INFORMATION, False))
    edges.append(
        Edge(
            "loop",
            "loop",
            5,
            n - 5,
            poses[5].between(poses[n - 5]) @ Pose(0.3, 0.2, 0.0),
            INFORMATION,
            True,
        )
    )
    results: list[float] = []
    before = threading.stack_size(1 << 20)
    try:
        thread = threading.Thread(
            target=lambda: results.append(optimize(poses, edges).chi2["loop"])
        )
        thread.start()
        thread.join()
    finally:
        threading.stack_size(before)
    assert results
    assert results[0] < 1.0
