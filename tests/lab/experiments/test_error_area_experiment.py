"""Error area grows with the error that is injected (§6.3.1)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_lab.experiments.error_area_experiment import (
    SCAN_NUMBER,
    inject,
    run_error_area,
    shifted_by,
    turned_by,
)
from lineloom_lab.experiments.recording import closed_path
from lineloom_lab.experiments.settings import Settings


@pytest.mark.parametrize("which", [0, 1])
def test_area_grows_with_rotation_and_with_translation(which: int) -> None:
    contestant = Settings().contestants()[which]
    scan = closed_path(0, 23).scans[SCAN_NUMBER]
    turns = [turned_by(math.radians(d)) for d in (0.0, 1.0, 2.0, 4.0, 8.0)]
    shifts = [shifted_by(d) for d in (0.0, 0.05, 0.1, 0.2, 0.4)]
    for groups in (turns, shifts):
        means = [np.mean([a.error for a in group]) for group in inject(contestant, scan, groups)]
        assert means[0] == pytest.approx(0.0, abs=1e-9)
        assert np.all(np.diff(means) > 0.0)


def test_the_report_shows_both_curves() -> None:
    report = run_error_area(Settings(quick=True))
    for key in ("thesis", "default"):
        series, figures = report.series[key], report.figures_of[key]
        assert len(series["rotation_rad"]) == len(series["rotation_error_area_m2"]) == 10
        assert figures["area_at_5_degrees"] > 0.5
        assert figures["rising_to_10_cm"] >= 20
    assert {f.name for f in report.figures} == {"error-area", "error-area-scan"}
