"""The benchmark of merging: on maps whose marks are known, and as a command."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lineloom.cli.app import app
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.site_view import (
    ComponentView,
    ConstraintView,
    KeyframeView,
    SiteView,
    TrajectoryView,
)
from lineloom_core.mapping.config import JoinConfig, MapperConfig
from lineloom_core.mapping.facts.scan_name import ScanName
from lineloom_core.scan import Scan
from lineloom_lab.evaluation.merge_bench import CaseResult, run_case, run_merge_bench
from lineloom_lab.evaluation.merge_bench_buildings import UNDECIDABLE, building_classes
from lineloom_lab.evaluation.merge_bench_cases import MergeCase, full_cases
from lineloom_lab.evaluation.merge_bench_fleets import BenchFleet, BenchRobot, bench_fleet
from lineloom_lab.evaluation.merge_bench_judge import Judge, PoseFigures
from lineloom_lab.evaluation.merge_bench_overlap import LEAST_SHARED_WAY_M, overlap_of
from lineloom_lab.evaluation.merge_bench_report import meets_goal, rows_of, to_json, to_markdown
from lineloom_lab.simulation import SimulatedRobot, SimulatedScan, corridors, sick_lms200
from lineloom_lab.simulation.building import Building
from typer.testing import CliRunner

FLOOR = Building.ordinary(corridors(1))
LOWER = [(3.0, 1.2), (27.0, 1.2)]
UPPER = [(4.0, FLOOR.world.bounds[3] - 1.2), (22.0, FLOOR.world.bounds[3] - 1.2)]
SCAN = Scan.checked(
    [1.0, 2.0], angle_min=0.0, angle_increment=0.1, range_min=0.0, range_max=9.0, stamp=0.0
)


def driver(
    name: str,
    stops: list[tuple[float, float]],
    *,
    floor: int = 0,
    undeclared: bool = False,
    building: Building = FLOOR,
) -> BenchRobot:
    robot = SimulatedRobot.through(name, building.world, stops, lidar=sick_lms200())
    return BenchRobot(replace(robot, duration_s=50.0), building, floor, undeclared)


def test_robots_on_one_way_are_due_and_those_elsewhere_are_not() -> None:
    fleet = BenchFleet(
        (driver("a", LOWER), driver("b", LOWER), driver("c", UPPER), driver("d", LOWER[::-1]))
    )
    overlap = overlap_of(fleet)
    assert overlap.due[0, 1]
    assert overlap.way_m[0, 1] >= 20.0
    assert overlap.due[0, 3]  # the same walls, seen on the way back
    assert not overlap.due[:, 2].any()
    np.testing.assert_array_equal(overlap.due, overlap.due.T)
    assert not overlap.due.diagonal().any()


def test_a_short_common_way_is_not_enough() -> None:
    short = overlap_of(BenchFleet((driver("a", LOWER), driver("b", [(3.0, 1.2), (9.0, 1.2)]))))
    assert 0.0 < min(short.way_m[0, 1], short.way_m[1, 0]) < LEAST_SHARED_WAY_M
    assert not short.due.any()


def test_neither_another_floor_nor_a_mirrored_lidar_is_due() -> None:
    fleet = BenchFleet(
        (driver("a", LOWER), driver("b", LOWER, floor=1), driver("c", LOWER, undeclared=True))
    )
    assert not overlap_of(fleet).due.any()


def test_walls_that_stand_everywhere_make_nothing_due() -> None:
    plain = replace(FLOOR, telling=FLOOR.world.walls[:0])
    robots = (driver("a", LOWER, building=plain), driver("b", LOWER, building=plain))
    assert not overlap_of(BenchFleet(robots)).due.any()


class Story:
    """A fleet of robots driving along x, each in a track of its own, and a map made of them."""

    def __init__(self, floors: dict[str, int], undeclared: str = "") -> None:
        self.fleet = BenchFleet(
            tuple(driver(n, LOWER, floor=f, undeclared=n == undeclared) for n, f in floors.items())
        )
        self.judge = Judge(self.fleet)
        self.true: dict[str, list[Pose]] = {}
        for k, name in enumerate(floors):
            self.true[name] = [Pose(i, k, 0.3 * i) for i in range(5)]
            for seq, pose in enumerate(self.true[name]):
                scan = replace(SCAN, seq=seq)
                self.judge.note(SimulatedScan(name, scan, pose, 0.2 * seq))

    def view(
        self,
        shifts: dict[str, Pose],
        joints: list[tuple[str, str]],
        components: dict[str, str] | None = None,
        mirrored: str = "",
    ) -> SiteView:
        """Every robot's map moved as a whole; all in one component unless told otherwise."""
        frames: list[KeyframeView] = []
        constraints: list[ConstraintView] = []
        poses: dict[str, list[Pose]] = {}
        for name, true in self.true.items():
            component = (components or {}).get(name, "c0")
            found = [Pose(p.x, -p.y, -p.theta) if name == mirrored else p for p in true]
            poses[name] = [shifts.get(name, Pose.identity()) @ p for p in found]
            ids = range(len(frames), len(frames) + len(true))
            frames += [
                KeyframeView(str(k), name, component, "0", seq, 0.0, poses[name][seq])
                for seq, k in enumerate(ids)
            ]
            constraints += [edge(a, a + 1, "sequential") for a in ids[:-1]]
        first = {name: 5 * k for k, name in enumerate(self.true)}
        constraints += [edge(first[a], first[b], "rendezvous") for a, b in joints]
        names = {f.component: [g.robot for g in frames if g.component == f.component]
                 for f in frames}  # fmt: skip
        return SiteView(
            version=1,
            robots={},
            components=tuple(ComponentView(c, tuple(sorted(set(n))), 5) for c, n in names.items()),
            merged_into={},
            trajectories={n: trajectory(p, (components or {}).get(n, "c0"))
                          for n, p in poses.items()},
            lines=(),
            keyframes=tuple(frames),
            constraints=tuple(constraints),
        )  # fmt: skip


def edge(a: int, b: int, kind: str) -> ConstraintView:
    return ConstraintView(
        f"k{a}-{b}", kind, "accepted", str(a), str(b), Pose.identity(), np.eye(3), "",  # type: ignore[arg-type]
        "recognition", ScanName("a", "0", a), ScanName("b", "0", b),
    )  # fmt: skip


def trajectory(poses: list[Pose], component: str) -> TrajectoryView:
    n = len(poses)
    rows = np.array([p.to_array() for p in poses])
    return TrajectoryView(("0",) * n, np.arange(n), np.zeros(n), (component,) * n, rows)


def test_a_chain_of_right_joins_is_right() -> None:
    story = Story({"a": 0, "b": 0, "c": 0})
    view = story.view({}, [("a", "b"), ("b", "c")])
    verdict = story.judge.verdict(view)
    assert verdict.right == {("a", "b"), ("b", "c"), ("a", "c")}
    assert not verdict.false
    assert story.judge.poses(view, verdict) == PoseFigures(15, 0)


def test_a_join_that_is_off_spoils_all_pairs_across_it() -> None:
    story = Story({"a": 0, "b": 0, "c": 0})
    view = story.view({"c": Pose(1.5, 0.0, 0.0)}, [("a", "b"), ("b", "c")])
    verdict = story.judge.verdict(view)
    assert verdict.right == {("a", "b")}
    assert verdict.false == {("b", "c"), ("a", "c")}
    assert story.judge.poses(view, verdict) == PoseFigures(15, 5)


def test_less_than_a_metre_is_no_false_join() -> None:
    story = Story({"a": 0, "b": 0})
    assert story.judge.verdict(story.view({"b": Pose(0.8, 0.0, 0.0)}, [("a", "b")])).right
    turned = story.view({"b": Pose(0.0, 0.0, math.radians(20.0))}, [("a", "b")])
    assert story.judge.verdict(turned).false


def test_another_floor_is_false_however_well_it_fits() -> None:
    story = Story({"a": 0, "b": 1})
    view = story.view({}, [("a", "b")])
    verdict = story.judge.verdict(view)
    assert verdict.false == {("a", "b")}
    assert story.judge.poses(view, verdict).off == 5


def test_maps_apart_are_neither_right_nor_false() -> None:
    story = Story({"a": 0, "b": 0})
    verdict = story.judge.verdict(story.view({}, [], components={"b": "c1"}))
    assert not verdict.right
    assert not verdict.false


def test_a_mirrored_map_is_joined_falsely_and_a_corrected_one_rightly() -> None:
    story = Story({"a": 0, "b": 0}, undeclared="b")
    assert story.judge.verdict(story.view({}, [("a", "b")], mirrored="b")).false
    assert story.judge.verdict(story.view({}, [("a", "b")])).right


def test_the_same_seed_draws_the_same_fleet() -> None:
    kind = building_classes(None)[0]
    a, b = (bench_fleet(kind, 3, 5, 30.0) for _ in range(2))
    other = bench_fleet(kind, 3, 6, 30.0)
    for ours, same in zip(a.scans(), b.scans(), strict=True):
        assert ours.robot == same.robot
        np.testing.assert_array_equal(ours.scan.ranges, same.scan.ranges)
    assert next(other.scans()).true_pose != next(a.scans()).true_pose


def test_a_full_run_has_at_least_a_thousand_pairs_that_count() -> None:
    undecidable = {k.name for k in building_classes(None) if k.kind == UNDECIDABLE}
    cases = [c for c in full_cases(0, 2, None) if c.building not in undecidable]
    pairs = sum(c.robots * (c.robots - 1) // 2 for c in cases)
    assert pairs > 900  # real floor plans, where they are present, bring it above 1000
    assert len({c.name for c in cases}) == len(cases)


SMALL = [
    MergeCase("rooms in a row", 2, 2, duration_s=60.0),
    MergeCase("small flat", 3, 3, duration_s=50.0),
    MergeCase("different buildings", 4, 4, duration_s=40.0),
]


@pytest.fixture(scope="module")
def results() -> tuple[CaseResult, ...]:
    return run_merge_bench(SMALL)


@pytest.mark.scenario
def test_small_fleets_are_joined_and_never_falsely(results: tuple[CaseResult, ...]) -> None:
    whole = next(row for row in rows_of(results) if row.name == "all")
    assert whole.pairs == 10
    assert (whole.false, whole.off) == (0, 0)
    assert whole.due >= 3
    assert whole.made == whole.due
    assert whole.first_merge_s is not None
    assert 5.0 < whole.first_merge_s < 60.0


def test_the_report_counts_and_sets_the_undecidable_apart(results: tuple[CaseResult, ...]) -> None:
    apart = replace(results[0], kind=UNDECIDABLE, false=(("a", "b"),))
    apart = replace(apart, case=replace(apart.case, building="alike to the last chair"))
    rows = {row.name: row for row in rows_of([*results, apart])}
    assert rows["all"].false == 0
    assert rows["alike to the last chair"].false_per_1000 == 1000.0
    assert not meets_goal(rows["all"])  # too few pairs to say so
    assert meets_goal(replace(rows["all"], pairs=1000))
    assert not meets_goal(replace(rows["all"], pairs=1000, false=1))
    assert not meets_goal(replace(rows["all"], pairs=1000, made_share=0.89))
    table = to_markdown([*results, apart])
    assert "| small flat " in table
    assert "not met" in table
    document = json.loads(json.dumps(to_json(results)))
    assert [case["pairs"] for case in document["cases"]] == [1, 3, 6]


def test_missed_pairs_are_told_and_drawn(tmp_path: Path) -> None:
    """A mapper that wants a hundred constraints joins nothing: what is due is missed."""
    case = MergeCase("small flat", 2, 3, duration_s=35.0)
    strict = MapperConfig(join=JoinConfig(least_set=100))
    result = run_case(case, tmp_path, strict)
    assert result.due
    assert not result.made
    assert [missed.pair for missed in result.missed] == list(result.due)
    assert result.missed[0].shared_m >= LEAST_SHARED_WAY_M
    assert result.missed[0].true_candidates > 0
    assert sum(result.missed[0].reasons.values()) == result.missed[0].true_candidates
    picture = tmp_path / "missed-small-flat-2-3-robot-0-robot-1.png"
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_command_prints_one_document() -> None:
    line = ["bench", "merges", "--quick", "--only", "small flat", "--json"]
    ran = CliRunner().invoke(app, line)
    assert ran.exit_code == 0, ran.output
    document = json.loads(ran.stdout)
    assert [row["name"] for row in document["rows"]] == ["small flat", "all"]
    assert "small-flat-2-2" in ran.stderr


def test_the_command_names_the_classes_it_knows() -> None:
    ran = CliRunner().invoke(app, ["bench", "merges", "--only", "castle"])
    assert ran.exit_code == 2
    assert "hotel floor" in ran.stderr


@pytest.mark.long
def test_two_jobs_give_what_one_gives() -> None:
    alone, together = run_merge_bench(SMALL), run_merge_bench(SMALL, jobs=2)
    assert [replace(r, map_s=0.0) for r in alone] == [replace(r, map_s=0.0) for r in together]
