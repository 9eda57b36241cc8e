"""Displacement and error area on the straight run (§6.3.2)."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_lab.experiments.settings import Settings
from lineloom_lab.experiments.straight_run_experiment import (
    PairAreas,
    run_straight_run,
    sample_pairs,
)


def test_the_sample_is_of_different_pairs_over_all_displacements() -> None:
    sample = sample_pairs(200, 500, 1)
    assert len(set(sample)) == len(sample) == 500
    assert all(0 <= i < j < 200 for i, j in sample)
    apart = np.array([j - i for i, j in sample])
    thirds = np.histogram(apart, bins=[0, 67, 133, 200])[0]
    assert thirds.min() > 100
    assert sample == sample_pairs(200, 500, 1)


def test_bins_leave_out_what_is_unknown() -> None:
    displacement = np.array([0.1, 0.2, 0.3, 0.6])
    area = np.array([1.0, 3.0, np.nan, 5.0])
    areas = PairAreas(displacement, area, area, area)
    centres, means = areas.binned(area, 0.25)
    assert centres == pytest.approx([0.125, 0.625])
    assert means == pytest.approx([2.0, 5.0])
    known = np.isfinite(area)
    expected = np.polyfit(displacement[known], area[known], 1)[0]
    assert areas.slope(area) == pytest.approx(expected)


def test_both_matchers_find_the_way_along_the_whole_run() -> None:
    report = run_straight_run(Settings(quick=True))
    assert report.parameters["run_m"] == 18.65
    for key in ("thesis", "default"):
        found = report.figures_of[key]
        assert found["first_right"] > 0.9
        assert found["all_right"] > 0.9
        assert 0.0 < found["all_area_mean"] < 0.2
    assert "sample of 150" in report.to_markdown()
