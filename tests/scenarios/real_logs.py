"""Real logs, what they must come to, and how far from the references a map may be."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.io.carmen import read_carmen
from lineloom_core.scan import Scan
from lineloom_lab.evaluation import trajectory_error
from numpy.typing import NDArray

DATA = Path(__file__).parents[3] / "shared" / "data"
REFERENCES = ("ref_flirt", "ref_gfs")
"""Two independent ones; they disagree with each other by about 0.1 m."""


@dataclass(frozen=True, slots=True)
class RealLog:
    """A recorded drive. most_rmse, most_off [m]: what a map may be off by, after alignment."""

    name: str
    log: Path
    reference: Path
    scans: int
    most_rmse: float
    most_off: float = 1.0

    def require(self) -> None:
        """Skip where the data is not there."""
        if not self.log.is_file() or not self.reference.is_file():
            pytest.skip(f"no real data: {self.log.parent} is missing")

    def read(self, *, odometry: bool = False) -> list[Scan]:
        """All scans, without their odometry unless asked; `seq` is the row in the reference."""
        scans = list(read_carmen(self.log))
        return scans if odometry else [replace(scan, odometry=None) for scan in scans]

    def check(self, seqs: NDArray[np.int64], poses: NDArray[np.float64]) -> None:
        """Assert that nearly all scans were placed, and rightly; poses in one frame, (n, 3)."""
        estimate = np.full((self.scans, 3), np.nan)
        estimate[seqs] = poses
        assert np.isfinite(estimate[:, 0]).mean() > 0.99
        with np.load(self.reference) as references:
            for name in REFERENCES:
                error = trajectory_error(estimate, references[name])
                assert error.n > 400
                assert error.rmse <= self.most_rmse, f"{self.name} against {name}: {error}"
                assert error.max <= self.most_off, f"{self.name} against {name}: {error}"


CSAIL = RealLog(
    "MIT CSAIL",
    DATA / "mit-csail" / "mit-csail.clf",
    DATA / "mit-csail" / "reference.npz",
    scans=1988,
    most_rmse=0.12,
)
FR079 = RealLog(
    "Freiburg 079",
    DATA / "fr079" / "fr079.log",
    DATA / "fr079" / "reference.npz",
    scans=4791,
    most_rmse=0.1,
)
