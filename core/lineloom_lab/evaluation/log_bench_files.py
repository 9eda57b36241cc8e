"""The recorded logs of the benchmark: what lies in the folder of shared data.

NAME.npz and sparse/NAME.npz hold scans with an independent reference; tinyslam/*.dat none; field/
recordings as their owners keep them, some with NAME.pseudo.npz, the trajectory of a naive search.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.io import tinyslam
from lineloom_core.io.jsonl import record_from_json
from lineloom_core.io.rosbag import read_bag
from lineloom_core.scan import Mount, Scan
from numpy.typing import NDArray

from lineloom_lab.evaluation.log_bench_log import (
    BenchLog,
    Half,
    Recording,
    RigidPair,
    Trust,
    half_of,
    no_reference,
)

_RANGE_MIN_M = 0.02
_SURE_SCORE, _SURE_QUANTILE = 0.9, 0.05
_ODOMETRY = "-odometry"
_RIGID = {
    "three-lidars-one-robot": RigidPair("left_scan", "rear_scan", Pose(-0.938, 0.548, 2.349)),
}
"""How lidars are mounted, by the log's name."""


@dataclass(frozen=True, slots=True)
class LogFile:
    """A log as a file. pseudo: the naive trajectory of the same scans, where there is one."""

    name: str
    path: Path
    pseudo: Path | None = None

    @property
    def half(self) -> Half:
        """The half that its building belongs to."""
        return half_of(self.name)

    def load(self) -> BenchLog:
        """Read it. Raises ValueError, naming what is wrong, or OSError."""
        if self.path.suffix == ".npz":
            return BenchLog((_from_npz(self.path),), "reference")
        if self.path.suffix == ".bag":
            recordings = tuple(_from_bag(self.path))
        elif self.path.suffix == ".dat":
            scans = tuple(found.scan for found in tinyslam.read_log(self.path))
            recordings = (_bare("robot", scans),)
        else:
            recordings = (_bare("robot", tuple(_from_jsonl(self.path))),)
        if self.pseudo is None:
            return BenchLog(recordings, "none", _RIGID.get(self.name))
        return _with_pseudo(recordings, self.pseudo)


def log_files(folder: Path, *, odometry: bool = False) -> list[LogFile]:
    """Return the logs of a folder, those with an independent reference first.

    A recording NAME-odometry beside NAME is the same with odometry, and stands in for it with
    `odometry`. Raises FileNotFoundError where there is no log.
    """
    found = [LogFile(p.stem, p) for p in sorted(folder.glob("*.npz"))]
    found += [LogFile(p.stem, p) for p in sorted((folder / "sparse").glob("*.npz"))]
    found += [LogFile(f"tinyslam-{p.stem}", p) for p in sorted((folder / "tinyslam").glob("*.dat"))]
    field = folder / "field"
    found += [
        LogFile(_stem(p), p, _pseudo(field, _stem(p)))
        for p in sorted((*field.glob("*.bag"), *field.glob("*.jsonl.gz")), key=_stem)
    ]
    names = {log.name for log in found}
    twins = {n.removesuffix(_ODOMETRY): n for n in names if n.endswith(_ODOMETRY)}
    left_out = set(twins) if odometry else set(twins.values())
    kept = [log for log in found if log.name not in left_out]
    if not kept:
        raise FileNotFoundError(f"no logs (*.npz, sparse, tinyslam, field) in {folder}")
    return kept


def _from_npz(path: Path) -> Recording:
    """Read scans with a reference; ranges as they are posted: millimetres, 0 = invalid."""
    with np.load(path) as data:
        missing = {"scans", "angle_min", "angle_increment", "range_max", "t", "ref", "odom"}
        missing -= set(data.files)
        if missing:
            raise ValueError(f"{path}: {sorted(missing)[0]} is missing")
        ranges = data["scans"].astype(np.float64)
        angle_min, increment = float(data["angle_min"]), float(data["angle_increment"])
        range_max = float(data["range_max"])
        stamps, odometry, reference = data["t"], data["odom"], data["ref"].astype(np.float64)
    ranges = np.where(ranges > _RANGE_MIN_M, np.round(ranges, 3), np.nan)
    scans = tuple(
        Scan.checked(
            row,
            angle_min=angle_min,
            angle_increment=increment,
            range_min=_RANGE_MIN_M,
            range_max=range_max,
            stamp=float(t),
            seq=i,
            odometry=_pose(wheels),
        )
        for i, (row, t, wheels) in enumerate(zip(ranges, stamps, odometry, strict=True))
    )
    return Recording("robot", scans, reference)


def _pose(row: NDArray[np.float64]) -> Pose | None:
    return Pose(*map(float, row)) if np.isfinite(row).all() else None


def _from_bag(path: Path) -> Iterator[Recording]:
    for robot in read_bag(path):
        mount = robot.mount or Mount()
        reference = no_reference(len(robot.scans))
        yield Recording(robot.name or "robot", robot.scans, reference, mount.inverted)


def _from_jsonl(path: Path) -> Iterator[Scan]:
    with gzip.open(path, "rt", encoding="utf-8") as lines:
        for number, text in enumerate(lines, start=1):
            try:
                yield record_from_json(json.loads(text)).scan
            except ValueError as error:
                raise ValueError(f"{path}:{number}: {error}") from None


def _bare(robot: str, scans: tuple[Scan, ...]) -> Recording:
    return Recording(robot, scans, no_reference(len(scans)))


def _with_pseudo(recordings: tuple[Recording, ...], path: Path) -> BenchLog:
    """Add naive poses of the only recording's first scans; there may be none of the last ones."""
    with np.load(path) as data:
        poses, score = data["P"].astype(np.float64), data["SC"]
    only = recordings[0]
    missing = len(only.scans) - len(poses)
    if len(recordings) > 1 or missing < 0:
        raise ValueError(f"{path}: {len(poses)} poses for {len(only.scans)} scans of {only.robot}")
    trust: Trust = "pseudo" if np.quantile(score, _SURE_QUANTILE) > _SURE_SCORE else "doubtful"
    reference = np.vstack([poses, no_reference(missing)])
    return BenchLog((Recording(only.robot, only.scans, reference, only.inverted),), trust)


def _stem(path: Path) -> str:
    return path.name.removesuffix(".gz").rsplit(".", 1)[0]


def _pseudo(field: Path, name: str) -> Path | None:
    """Return the naive trajectory of a recording, or of the one that it is a variant of.

    Variants hold the same scans in the same order: with `time_increment`, with odometry, or with a
    person's beams cut out.
    """
    base = name.removesuffix("-time-increment").removesuffix(_ODOMETRY)
    base = base.replace("-no-person", "-person")
    path = field / f"{base}.pseudo.npz"
    return path if path.is_file() else None
