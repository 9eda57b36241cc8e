"""Whether two maps of the same scans are one: told by trajectories made by hand."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_lab.evaluation.log_bench_judge import PlacedRobot
from lineloom_lab.evaluation.log_bench_sameness import same_share

WAY = np.column_stack([0.5 * np.arange(20), 0.1 * np.arange(20) ** 2, np.zeros(20)])


def placed(poses: np.ndarray, components: str) -> list[PlacedRobot]:
    """One robot; a letter per scan names its component, a dot means unplaced."""
    names = np.array([name.replace(".", "") for name in components])
    return [PlacedRobot("r", poses, names, np.full_like(poses, np.nan))]


def test_a_map_in_another_frame_is_the_same() -> None:
    turned = np.column_stack([-WAY[:, 1] + 7.0, WAY[:, 0] - 1.0, WAY[:, 2] + np.pi / 2])
    assert same_share(placed(WAY, 20 * "a"), placed(turned, 20 * "b")) == 1.0


def test_poses_elsewhere_and_scans_lost_are_not_the_same() -> None:
    moved = WAY.copy()
    moved[3, 0] += 0.5
    share = same_share(placed(WAY, 20 * "a"), placed(moved, "a" * 19 + "."))
    assert share == pytest.approx(18 / 20)


def test_a_map_in_pieces_is_the_same_as_far_as_its_largest() -> None:
    pieces = placed(WAY, "a" * 12 + "b" * 8)
    assert same_share(placed(WAY, 20 * "a"), pieces) == pytest.approx(12 / 20)
    # The other way round each piece lies as it should.
    assert same_share(pieces, placed(WAY, 20 * "a")) == 1.0


def test_nothing_placed_has_no_share_and_other_scans_cannot_be_compared() -> None:
    assert same_share(placed(WAY, 20 * "."), placed(WAY, 20 * "a")) is None
    with pytest.raises(ValueError, match="same scans"):
        same_share(placed(WAY, 20 * "a"), placed(WAY[:9], 9 * "a"))
