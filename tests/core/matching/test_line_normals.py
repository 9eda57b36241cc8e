"""Points of a wall take the wall's normal."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_core.features import ScanFeatures, extract_features
from lineloom_core.features._kernels import FIRST, LAST, OFFSET, THETA
from lineloom_core.matching import _registration_kernels as fast
from lineloom_lab.simulation import FreeSpace, Lidar, scanner_360, sick_lms200, world_named
from numpy.typing import NDArray

Floats = NDArray[np.float64]
REACH = 0.06


def slow_line_normals(features: ScanFeatures) -> Floats:
    """Each point looks for the last line whose beams span its own and on which it lies."""
    normals = features.normals()
    for k, (point, beam) in enumerate(zip(features.points, features.beams, strict=True)):
        for line in features.lines:
            left = np.array([-np.sin(line[THETA]), np.cos(line[THETA])])
            spanned = line[FIRST] <= beam <= line[LAST]
            if spanned and abs(left @ point - line[OFFSET]) < REACH:
                normals[k] = left
    return normals


@pytest.mark.parametrize("lidar", [sick_lms200(), scanner_360()], ids=["180", "360"])
def test_normals_are_those_of_the_lines(lidar: Lidar) -> None:
    world, rng = world_named("office", 3), np.random.default_rng(3)
    space = FreeSpace.of(world)
    changed = 0
    for _ in range(5):
        features = extract_features(lidar.scan(world, space.random_pose(rng), rng))
        found = features.normals()
        bare = found.copy()
        fast.line_normals(features.points, features.beams, features.lines, found)
        np.testing.assert_allclose(found, slow_line_normals(features), atol=1e-12)
        changed += int(np.count_nonzero(np.abs(found - bare).max(axis=1) > 1e-6))
        # Still towards the sensor, still of unit length (or none at all).
        length = np.hypot(found[:, 0], found[:, 1])
        assert np.all((np.abs(length - 1.0) < 1e-9) | (length == 0.0))
        assert np.einsum("ij,ij->i", found, features.points).max() <= 1e-9
    assert changed > 100
