"""Sound lidars of every kind, simulated and real: the doctor has nothing to say of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.io.carmen import read_carmen
from lineloom_core.scan import Scan
from lineloom_lab.simulation import (
    Lidar,
    World,
    office_floor,
    round_hall,
    scanner_360,
    sick_lms200,
)

from tests.core.health.shown import CHEAP, DATA, Seen, drive, sent, shown, spoilt

SOUND = {
    "cheap": CHEAP,
    "half turn": sick_lms200(),
    "dense": scanner_360(),
    "exact": replace(CHEAP, range_sigma=0.0),
    "short": replace(CHEAP, range_max=3.5, range_sigma=0.02, rate_hz=5.0),
    "patchy": replace(CHEAP, dropout=0.3),
    "few beams": Lidar(-1.5, 0.06, 50, range_max=10.0, rate_hz=10.0),
}


@pytest.mark.parametrize("world", [office_floor(9), round_hall(1)], ids=lambda world: world.name)
@pytest.mark.parametrize("kind", SOUND)
def test_sound_lidars_are_left_in_peace(kind: str, world: World) -> None:
    assert shown(drive(lidar=SOUND[kind], world=world, reach=30.0, seconds=12.0))[1] == {}


def test_ranges_in_centimetres_are_no_code() -> None:
    """A lidar of one centimetre's resolution meets the same number many times."""
    assert shown(spoilt(lambda scan, _: sent(scan, np.round(scan.ranges, 2))))[1] == {}


@pytest.mark.parametrize("log", ["mit-csail/mit-csail.clf", "fr079/fr079.log"])
def test_real_logs_are_left_in_peace(log: str) -> None:
    path = DATA / log
    if not path.is_file():
        pytest.skip(f"no real data: {path} is missing")
    scans = list(read_carmen(path))[:1000]
    assert shown((scan, scan.odometry) for scan in scans)[1] == {}


@pytest.mark.parametrize("log", ["acapulco", "edmonton", "freiburg-101", "orebro", "seattle"])
def test_sparse_logs_are_left_in_peace(log: str) -> None:
    path = DATA / "sparse" / f"{log}.npz"
    if not path.is_file():
        pytest.skip(f"no real data: {path} is missing")
    held = np.load(path)

    def seen() -> Iterable[Seen]:
        for i, ranges in enumerate(held["scans"]):
            scan = Scan.checked(
                np.where(ranges == 0.0, np.nan, ranges),
                angle_min=float(held["angle_min"]),
                angle_increment=float(held["angle_increment"]),
                range_min=0.05,
                range_max=float(held["range_max"]),
                stamp=float(held["t"][i]),
            )
            yield (
                scan,
                Pose.from_array(held["ref"][i]) if np.isfinite(held["ref"][i]).all() else None,
            )

    assert shown(seen())[1] == {}
