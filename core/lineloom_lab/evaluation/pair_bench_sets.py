"""The pairs that matchers are benchmarked on: real files and simulated ones, by overlap."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan

from lineloom_lab.evaluation.log_bench_log import Half
from lineloom_lab.evaluation.pairs import Pair, Tier, load_pairs
from lineloom_lab.evaluation.simulated_pairs import SimulatedPair, simulated_pairs
from lineloom_lab.simulation import Lidar, scanner_360, sick_lms200, world_named

SIMULATED_WORLDS = ("office", "rooms", "corridors")
SIMULATED_SEED = 300
"""Far from the seeds that the score is calibrated on (`evaluation.calibration`)."""
PEOPLE = 8
OVERLAP_BINS = ((0.75, 1.01), (0.5, 0.75), (0.25, 0.5))
MOST_NEGATIVE_OVERLAP = 0.05
"""More of it, and two scans have something to be found however far apart they are: along one
corridor a lidar sees 30 m."""
GUESS_RADIUS_M = 0.4
GUESS_ANGLE_RAD = math.radians(10.0)
"""How far off a good guess is at most, as in the real files."""
_TRIES_PER_PAIR = 60


@dataclass(frozen=True, slots=True)
class BenchPair:
    """A pair, the group it is counted in, and a good guess of T_ref_cur for those that need one."""

    pair: Pair
    group: str
    guess: Pose


@dataclass(frozen=True, slots=True)
class LogOrigin:
    """The log that pairs were drawn from, the lidar it was recorded with or made into, its half."""

    log: str
    lidar: str
    half: Half


@dataclass(frozen=True, slots=True)
class BenchSet:
    """Pairs of one source. collection: sets of one collection are reported together."""

    name: str
    collection: str
    pairs: tuple[BenchPair, ...]
    origin: LogOrigin | None = None


def real_set(path: Path | str, limit: int | None = None) -> BenchSet:
    """Read a file of pairs with its guesses; `limit` keeps the first so many of each tier.

    Raises FileNotFoundError or ValueError as `load_pairs` does; a file without `guess` is refused.
    """
    loaded = load_pairs(path)
    with np.load(path, allow_pickle=False) as data:
        if "guess" not in data.files:
            raise ValueError(f"{path} is no file of pairs: it lacks guess")
        guesses = [Pose.from_array(row) for row in data["guess"].astype(np.float64)]
    rows = [BenchPair(p, p.tier, g) for p, g in zip(loaded.pairs, guesses, strict=True)]
    return BenchSet(loaded.name, "real", _first_of_each(rows, limit))


def real_sets(folder: Path | str, limit: int | None = None) -> tuple[BenchSet, ...]:
    """Read all files of pairs (*.npz) in a folder, by name. Raises FileNotFoundError if none."""
    files = sorted(Path(folder).glob("*.npz"))
    if not files:
        raise FileNotFoundError(f"{folder} holds no files of pairs (*.npz)")
    return tuple(real_set(file, limit) for file in files)


def simulated_sets(per_group: int, seed: int = SIMULATED_SEED) -> tuple[BenchSet, ...]:
    """Make up pairs of a 180 and of a 360 degree lidar, so many of each overlap bin and negatives.

    The same arguments give the same pairs. The worlds take turns; up to eight people stand about,
    elsewhere in the other scan.
    """
    lidars: tuple[tuple[str, Callable[[], Lidar]], ...] = (
        ("simulated-180", sick_lms200),
        ("simulated-360", scanner_360),
    )
    return tuple(_simulated_set(name, lidar(), per_group, seed) for name, lidar in lidars)


def overlap_share(reference: Scan, current: Scan, T_ref_cur: Pose) -> float:
    """Return the share of the current scan's points that the reference measured, too, 0..1.

    A point counts where the reference's beam in its direction ended within 0.2 m + 2 % of it.
    """
    points = T_ref_cur.transform(current.points())
    if len(points) == 0:
        return 0.0
    ranges = np.hypot(points[:, 0], points[:, 1])
    turn = np.arctan2(points[:, 1], points[:, 0]) - reference.angle_min
    beams = np.rint(turn % math.tau / reference.angle_increment).astype(np.int64)
    seen = beams < len(reference)
    measured = np.where(seen, reference.ranges[np.where(seen, beams, 0)], np.nan)
    with np.errstate(invalid="ignore"):
        same = np.abs(measured - ranges) < 0.2 + 0.02 * ranges
    return float(np.mean(same))


def _simulated_set(name: str, lidar: Lidar, per_group: int, seed: int) -> BenchSet:
    rng = np.random.default_rng([seed, lidar.beams])
    streams = [
        simulated_pairs(
            world_named(world, seed),
            lidar,
            np.random.default_rng([seed, lidar.beams, index]),
            _TRIES_PER_PAIR * per_group,
            people=PEOPLE,
        )
        for index, world in enumerate(SIMULATED_WORLDS)
    ]
    wanted = [_bin_name(low, high) for low, high in OVERLAP_BINS] + ["neg"]
    found: dict[str, list[BenchPair]] = {group: [] for group in wanted}
    for drawn in _in_turn(streams):
        row = _bench_pair(drawn, rng)
        if row is not None and len(found[row.group]) < per_group:
            found[row.group].append(row)
        if all(len(rows) == per_group for rows in found.values()):
            break
    return BenchSet(name, name, tuple(row for rows in found.values() for row in rows))


def _bench_pair(drawn: SimulatedPair, rng: np.random.Generator) -> BenchPair | None:
    """Sort a simulated pair by overlap; None for too little of it nearby or too much far away."""
    truth = drawn.T_reference_current
    guess = good_guess(truth, rng)
    overlap = overlap_share(drawn.reference, drawn.current, truth)
    if drawn.negative:
        if overlap > MOST_NEGATIVE_OVERLAP:
            return None
        pair = Pair(drawn.reference, drawn.current, "neg", truth, overlap)
        return BenchPair(pair, "neg", Pose.identity())
    for low, high in OVERLAP_BINS:
        if low <= overlap < high:
            pair = Pair(drawn.reference, drawn.current, _tier(truth), truth, overlap)
            return BenchPair(pair, _bin_name(low, high), guess)
    return None


def good_guess(truth: Pose, rng: np.random.Generator) -> Pose:
    """Return a pose up to 0.4 m and 10 degrees from the true one."""
    distance = GUESS_RADIUS_M * math.sqrt(float(rng.random()))
    bearing, turn = rng.uniform(-math.pi, math.pi), rng.uniform(-1.0, 1.0) * GUESS_ANGLE_RAD
    return Pose(
        truth.x + distance * math.cos(bearing),
        truth.y + distance * math.sin(bearing),
        truth.theta + float(turn),
    )


def _tier(truth: Pose) -> Tier:
    is_mid = math.hypot(truth.x, truth.y) < 1.5 and abs(truth.theta) <= math.pi / 3
    return "mid" if is_mid else "far"


def _bin_name(low: float, high: float) -> str:
    return f"{100 * low:.0f}-{min(100 * high, 100):.0f} %"


def _in_turn(streams: Sequence[Iterator[SimulatedPair]]) -> Iterator[SimulatedPair]:
    """Yield from each stream in turn until one runs dry."""
    for together in zip(*streams, strict=False):
        yield from together


def _first_of_each(rows: Sequence[BenchPair], limit: int | None) -> tuple[BenchPair, ...]:
    if limit is None:
        return tuple(rows)
    groups = dict.fromkeys(row.group for row in rows)
    return tuple(
        row for group in groups for row in islice((r for r in rows if r.group == group), limit)
    )
