"""Trajectories put together from facts and from where keyframes lie now."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_core.codec import decode, encode
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.trajectories import Trajectories, Way, Whereabouts
from lineloom_core.mapping.facts.placed_scans import BLOCK, PlacedScan, PlacedScans
from lineloom_core.mapping.facts.unplaced_scan import UnplacedScan

RNG = np.random.default_rng(4)
POSES = [Pose.from_array(row) for row in RNG.normal(size=(50, 3))]
COMPONENTS = RNG.integers(0, 3, size=50)
BASES = {"a": Pose(0.1, 0.2, 0.3), "b": Pose.identity(), "idle": Pose(1.0, 0.0, 0.0)}
LOST = UnplacedScan("0", 5, 0.5, 1)


def some_scans(seed: int, count: int) -> list[PlacedScan]:
    rng = np.random.default_rng(seed)
    return [
        PlacedScan(
            f"s{k // 700}",
            k,
            0.1 * k,
            int(rng.integers(50)),
            Pose.from_array(rng.normal(size=3)),
        )
        for k in range(count)
    ]


SCANS = {"a": some_scans(1, 2 * BLOCK + 10), "b": some_scans(2, BLOCK), "idle": []}


@pytest.fixture(scope="module")
def placed() -> dict[str, PlacedScans]:
    made = {name: PlacedScans() for name in SCANS}
    for name, scans in SCANS.items():
        for scan in scans:
            made[name].append(scan)
    return made


@pytest.fixture(scope="module")
def trajectories(placed: dict[str, PlacedScans]) -> Trajectories:
    blocks = {name: own.blocks() for name, own in placed.items()}
    keyframes = Whereabouts(
        np.array([p.to_array() for p in POSES]), COMPONENTS.astype(np.int32), ("c0", "c4", "c7")
    )
    unplaced = {"a": (LOST,), "b": (), "idle": ()}
    ways = {n: Way(len(blocks[n]), unplaced[n], BASES[n]) for n in SCANS}
    return Trajectories(ways, tuple(b for own in blocks.values() for b in own), keyframes)


def test_every_scan_is_where_the_slow_twin_has_it(trajectories: Trajectories) -> None:
    assert list(trajectories) == list(SCANS)
    for name, scans in SCANS.items():
        found = trajectories[name]
        assert found.seq.tolist() == [s.seq for s in scans]
        assert found.stamp.tolist() == [s.stamp for s in scans]
        assert found.session == tuple(s.session for s in scans)
        assert found.component == tuple(("c0", "c4", "c7")[COMPONENTS[s.keyframe]] for s in scans)
        twin = [POSES[s.keyframe] @ s.T_keyframe_laser @ BASES[name] for s in scans]
        expected = np.array([p.to_array() for p in twin]).reshape(-1, 3)
        np.testing.assert_allclose(found.poses[:, :2], expected[:, :2], atol=1e-12)
        np.testing.assert_allclose(np.cos(found.poses[:, 2] - expected[:, 2]), 1.0, atol=1e-12)
    assert trajectories["a"].unplaced == (LOST,)
    with pytest.raises(KeyError):
        trajectories["nobody"]


def test_full_blocks_stay_the_same_objects() -> None:
    placed = PlacedScans()
    before: tuple[object, ...] = ()
    for count, scan in enumerate(some_scans(3, 3 * BLOCK), start=1):
        placed.append(scan)
        if count % 500 == 0:
            blocks = placed.blocks()
            assert sum(len(b.seq) for b in blocks) == count == len(placed)
            full = [b for b in blocks if len(b.seq) == BLOCK]
            assert all(one is other for one, other in zip(full, before, strict=False))
            before = tuple(full)


def test_a_snapshot_holds_them_all(placed: dict[str, PlacedScans]) -> None:
    for name, scans in SCANS.items():
        again = decode(encode(placed[name]), PlacedScans)
        assert len(again) == len(scans)
        seqs = [seq for block in again.blocks() for seq in block.seq.tolist()]
        assert seqs == [s.seq for s in scans]
