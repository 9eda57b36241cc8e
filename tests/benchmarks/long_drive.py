"""How the cost of a scan, and of solving the graph, grows along one drive that goes on and on.

The Freiburg 079 log, forth and back again and forth; a robot that wanders through an office floor
where the data is missing. Nothing is let go, so that the map is as large as its number says.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import mean
from time import process_time
from unittest import mock

from lineloom_core.io.carmen import read_carmen
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.config import MapperConfig, ThinningConfig
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.scan import Scan
from lineloom_lab.simulation import SimulatedRobot, office_floor, sick_lms200

from tests.benchmarks.row import Row

_STAMP_S = 0.2
_KEEP_ALL = MapperConfig(thinning=ThinningConfig(most_alike=10**9))


@dataclass
class Solves:
    """Runs of `SiteMap.optimise`: how long each took, and the optimum of the same [s]."""

    runs: list[tuple[float, float]] = field(default_factory=list)
    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class Stretch:
    """What scans took around one keyframe [s], solving left aside, and what was solved there."""

    scans_s: list[float]
    solves: list[tuple[float, float]]


def growth_along_a_drive(data: Path, *, quick: bool) -> list[Row]:
    """Rows for the cost of a scan and of a solution at some keyframes of one drive."""
    marks = (20, 40) if quick else (100, 300, 1000, 3000)
    stretches = _drive(_scans(data), marks, around=10 if quick else 50)
    first = mean(stretches[marks[0]].scans_s)
    rows = [_scan(mark, stretches[mark], marks[0], first) for mark in marks[1:]]
    return rows + [_solution(mark, s.solves) for mark, s in stretches.items() if s.solves]


def _scan(mark: int, stretch: Stretch, first_mark: int, first_s: float) -> Row:
    return Row.of_times(
        f"scan, at keyframe {mark} of a drive, solving apart",
        mean(stretch.scans_s),
        round(1.5 * 1e3 * first_s, 2),
        f"at keyframe {first_mark}",
        first_s,
        f"mean of {len(stretch.scans_s)} scans",
    )


def _solution(mark: int, solves: list[tuple[float, float]]) -> Row:
    longest, batch = max(solves)
    return Row.of_times(
        f"graph, at keyframe {mark} of a drive",
        longest,
        60.0,
        "the whole at once (`settle`)",
        batch,
        f"the longest of {len(solves)} within some keyframes",
    )


def _drive(scans: Iterator[Scan], marks: tuple[int, ...], around: int) -> dict[int, Stretch]:
    """Map until the last of the marks is passed; what it took around each of them."""
    mapper, keyframes = SiteMapper(_KEEP_ALL), 0
    stretches = {mark: Stretch([], []) for mark in marks}
    with _watched() as solves:
        while keyframes < marks[-1] + around:
            solves.runs, solves.seconds = [], 0.0
            scan = next(scans)
            begin = process_time()
            changes = mapper.add("robot", scan)
            took = process_time() - begin - solves.seconds
            keyframes += changes.keyframe is not None
            for mark, stretch in stretches.items():
                if abs(keyframes - mark) <= around:
                    stretch.scans_s.append(took)
                    stretch.solves.extend(solves.runs)
    return stretches


@contextmanager
def _watched() -> Iterator[Solves]:
    """Have every solution of a site's graph timed, and what was solved remembered."""
    solves, optimise = Solves(), SiteMap.optimise

    def watched(site: SiteMap, keyframe: int) -> None:
        begin = process_time()
        optimise(site, keyframe)
        end = process_time()
        site.graph.settled()
        whole = process_time()
        solves.runs.append((end - begin, whole - end))
        solves.seconds += whole - begin

    with mock.patch.object(SiteMap, "optimise", watched):
        yield solves


def _scans(data: Path) -> Iterator[Scan]:
    """Scans without end and without odometry."""
    log = data / "fr079" / "fr079.log"
    if log.is_file():
        once = list(read_carmen(log))
        seen: Iterable[Scan] = itertools.chain.from_iterable(itertools.cycle((once, once[::-1])))
    else:
        world = office_floor(1)
        robot = SimulatedRobot.wandering("robot", world, lidar=sick_lms200(), duration_s=1e4)
        seen = (simulated.scan for simulated in robot.scans())
    for seq, scan in enumerate(seen):
        yield replace(scan, stamp=_STAMP_S * seq, seq=seq, odometry=None)
