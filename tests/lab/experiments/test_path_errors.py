"""The four errors of §6.2 against poses worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_lab.experiments.path_errors import path_errors


def test_the_right_path_has_no_error() -> None:
    poses = [Pose(0.0, 0.0, 3.0), Pose(1.0, 2.0, -3.0), Pose(-1.0, 0.5, 0.2)]
    errors = path_errors(poses, poses)
    for values in (errors.rotation, errors.translation, errors.global_translation):
        assert values == pytest.approx(np.zeros(2), abs=1e-12)
    assert errors.right() == 2


def test_one_wrong_turn_is_charged_once_between_scans_and_ever_after_globally() -> None:
    true = [Pose(float(i), 0.0, 0.0) for i in range(4)]
    # The second scan is taken for turned by 90 degrees, all steps after it are right.
    wrong = [Pose(0.0, 0.0, 0.0), Pose(1.0, 0.0, math.pi / 2)]
    wrong += [wrong[-1] @ Pose(1.0, 0.0, 0.0), wrong[-1] @ Pose(2.0, 0.0, 0.0)]
    errors = path_errors(wrong, true)
    assert np.degrees(errors.rotation) == pytest.approx([90.0, 0.0, 0.0])
    assert np.degrees(errors.global_rotation) == pytest.approx([90.0, 90.0, 90.0])
    assert errors.translation == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    assert errors.translation_as_printed == pytest.approx([0.0, math.sqrt(2), math.sqrt(2)])
    assert errors.global_translation == pytest.approx([0.0, math.sqrt(2), 2 * math.sqrt(2)])
    assert errors.right() == 2


def test_rotations_go_the_short_way_round() -> None:
    true = [Pose(0.0, 0.0, 0.0), Pose(0.0, 0.0, math.radians(179.0))]
    estimate = [Pose(0.0, 0.0, 0.0), Pose(0.0, 0.0, math.radians(-179.0))]
    assert np.degrees(path_errors(estimate, true).rotation) == pytest.approx([2.0])


def test_counts_must_agree() -> None:
    with pytest.raises(ValueError, match="1 estimated poses for 2"):
        path_errors([Pose.identity()], [Pose.identity()] * 2)
