"""Scan features that the kernels are tried on."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_core.features import ScanFeatures, extract_features
from lineloom_core.geometry import Pose
from lineloom_lab.evaluation.simulated_pairs import simulated_pairs
from lineloom_lab.simulation import Lidar, scanner_360, sick_lms200, world_named

from tests.core.matching import slow_twins as slow

FeaturePair = tuple[ScanFeatures, ScanFeatures, Pose]


def telling_pairs(lidar: Lidar, count: int, seed: int) -> list[FeaturePair]:
    """Features of pairs of scans of a furnished floor that have at least six walls in common."""
    world, rng = world_named("office", seed), np.random.default_rng(seed)
    found: list[FeaturePair] = []
    for p in simulated_pairs(world, lidar, rng, 50 * count, negative_share=0.0, reach=1.5):
        ref, cur = extract_features(p.reference), extract_features(p.current)
        T = p.T_reference_current
        if len(slow.lying(ref.lines, cur.lines, T, 0.09, 0.12, 0.3)) >= 6:
            found.append((ref, cur, T))
        if len(found) == count:
            break
    return found


@pytest.fixture(scope="session")
def feature_pairs() -> list[FeaturePair]:
    """Features of reference and current scan, and where the current one really is."""
    return telling_pairs(sick_lms200(), 3, 3) + telling_pairs(scanner_360(), 1, 4)
