"""Maps of simulated and real buildings in their plans: found, or refused for two answers."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.floorplan.differences import differences
from lineloom_core.floorplan.plan import FloorPlan, lengths
from lineloom_core.floorplan.registration import Registration, follow, judge_of, register
from lineloom_core.geometry import Pose, wrap
from lineloom_core.io.floorplan_drawing import draw_differences
from lineloom_core.io.svg import to_svg
from lineloom_lab.simulation import World, world_named
from numpy.typing import NDArray

from tests.core.floorplan.surveys import Survey, survey

REAL = Path(__file__).resolve().parents[4] / "shared" / "data" / "floorplans"
T_PLAN_MAP = Pose(13.0, -7.0, 2.1)


@pytest.fixture(scope="module")
def office() -> World:
    return world_named("office", 0)


@pytest.fixture(scope="module")
def office_map(office: World) -> Survey:
    return survey(office, T_PLAN_MAP, seed=1, duration_s=120.0)


def found(walls: NDArray[np.float64], site: Survey) -> Registration:
    return register(FloorPlan.of(walls), site.lines, site.grid)


def assert_at(answer: Registration, truth: Pose, metres: float, degrees: float) -> None:
    assert answer.verdict == "registered", answer.reason
    assert answer.T_plan_map is not None
    off = truth.between(answer.T_plan_map)
    assert math.hypot(off.x, off.y) < metres
    assert abs(off.theta) < math.radians(degrees)


def test_a_map_is_found_in_its_plan(office: World, office_map: Survey) -> None:
    answer = found(office.walls, office_map)
    assert_at(answer, T_PLAN_MAP, 0.02, 0.05)
    assert answer.best is not None
    assert answer.best.share_explained > 0.9
    assert answer.best.share_missing < 0.1


@pytest.mark.parametrize("seed", range(3))
def test_moving_plan_and_map_moves_the_answer(office: World, office_map: Survey, seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y, turn = rng.uniform([-40.0, -40.0, -math.pi], [40.0, 40.0, math.pi]).tolist()
    T_new_plan = Pose(x, y, turn)
    moved = office.moved(T_new_plan)
    assert_at(found(moved.walls, office_map), T_new_plan @ T_PLAN_MAP, 0.02, 0.05)


def test_the_plans_lines_have_neither_direction_nor_order(
    office: World, office_map: Survey
) -> None:
    rng = np.random.default_rng(0)
    walls = rng.permutation(office.walls)
    flip = rng.random(len(walls)) < 0.5
    walls[flip] = walls[flip][:, [2, 3, 0, 1]]
    assert_at(found(walls, office_map), T_PLAN_MAP, 0.02, 0.05)


def test_a_distorted_map_in_an_old_plan_is_found(office: World, office_map: Survey) -> None:
    """A tenth of a metre of bending, a fifth of the plan's walls gone, others never built."""
    rng = np.random.default_rng(3)
    x, y = office_map.lines[:, 0::2], office_map.lines[:, 1::2]
    bent = np.empty_like(office_map.lines)
    bent[:, 0::2] = x + 0.1 * np.sin(y / 6.0)
    bent[:, 1::2] = y + 0.1 * np.cos(x / 6.0)
    walls = office.walls[rng.random(len(office.walls)) > 0.2]
    low, high = walls.reshape(-1, 2).min(axis=0), walls.reshape(-1, 2).max(axis=0)
    start = rng.uniform(low, high, (10, 2))
    planned = np.hstack([start, start + rng.uniform(-2.0, 2.0, (10, 2))])
    answer = register(FloorPlan.of(np.vstack([walls, planned])), bent, office_map.grid)
    assert_at(answer, T_PLAN_MAP, 0.25, 0.6)


def twin(world: World) -> World:
    """The world and itself turned by half, side by side: nothing tells the halves apart."""
    x_min, y_min, x_max, y_max = world.bounds
    width, height = x_max - x_min, y_max - y_min
    T = Pose(x_min + x_max + width + 2.0, y_min + y_max + 0.1 * height, math.pi)
    other = world.moved(T)
    return World(np.vstack([world.walls, other.walls]), "twin")


def test_two_equal_halves_are_ambiguous(office: World, office_map: Survey) -> None:
    answer = found(twin(office).walls, office_map)
    assert answer.verdict == "ambiguous"
    assert answer.T_plan_map is None
    assert "places in the plan" in answer.reason
    assert len(answer.rivals) >= 1


def test_one_wall_does_not_settle_between_equal_halves(office: World, office_map: Survey) -> None:
    walls = np.vstack([twin(office).walls, [[3.0, 1.0, 3.0, 2.5]]])
    assert found(walls, office_map).verdict == "ambiguous"


@pytest.mark.parametrize(("name", "seed"), [("rectangle", 0), ("long-corridor", 1)])
def test_symmetric_buildings_are_refused(name: str, seed: int) -> None:
    world = world_named(name, seed)
    site = survey(world, T_PLAN_MAP, seed=seed, duration_s=100.0)
    answer = found(world.walls, site)
    assert answer.verdict == "ambiguous"
    assert answer.T_plan_map is None


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_another_buildings_plan_is_refused(office_map: Survey, seed: int) -> None:
    for name in ("office", "rooms"):
        answer = found(world_named(name, seed).walls, office_map)
        assert answer.verdict != "registered", (name, answer)
        assert answer.reason


def test_a_mirrored_plan_is_told(office: World, office_map: Survey) -> None:
    answer = found(office.walls * np.array([-1.0, 1.0, -1.0, 1.0]), office_map)
    assert answer.verdict == "none"
    assert answer.T_plan_map is None
    assert "mirrored it would fit" in answer.reason


def test_a_plan_in_millimetres_is_asked_about(office: World, office_map: Survey) -> None:
    answer = found(office.walls * 1000.0, office_map)
    assert answer.verdict == "none"
    assert "is it in metres?" in answer.reason


def test_too_little_map_is_said(office: World, office_map: Survey) -> None:
    long = office_map.lines[np.argsort(-lengths(office_map.lines))[:2]]
    assert lengths(long).sum() < 15.0
    answer = register(FloorPlan.of(office.walls), long, office_map.grid)
    assert answer.verdict == "none"
    assert "15 m are needed" in answer.reason


def test_a_registration_follows_the_map(office: World, office_map: Survey) -> None:
    known = found(office.walls, office_map)
    shift = Pose(0.15, -0.1, 0.01)  # the map's frame has moved a little since
    lines = shift.transform(office_map.lines.reshape(-1, 2)).reshape(-1, 4)
    judge = judge_of(FloorPlan.of(office.walls), lines, office_map.grid)
    again = follow(judge, known)
    assert again is not None
    assert_at(again, T_PLAN_MAP @ shift.inverse(), 0.02, 0.1)
    away = Pose(9.0, 5.0, 0.5).transform(office_map.lines.reshape(-1, 2)).reshape(-1, 4)
    judge = judge_of(FloorPlan.of(office.walls), away, office_map.grid)
    assert follow(judge, known) is None


def test_missing_and_new_walls_are_listed(office: World, office_map: Survey) -> None:
    """A wall of the plan that was never built; a mapped wall that the plan does not have."""
    T = T_PLAN_MAP
    free = np.argwhere(office_map.grid.cells == 0)
    step = office_map.grid.resolution
    at = free[len(free) // 2][::-1] * step + [office_map.grid.x, office_map.grid.y]
    (x, y) = T.transform([at])[0].tolist()
    never = [x - 0.5, y, x + 0.5, y]
    longest = int(np.argmax(lengths(office_map.lines)))
    wall = T.transform(office_map.lines[longest].reshape(2, 2)).reshape(4)
    gone = FloorPlan.of(np.vstack([without(office.walls, wall), [never]]))
    judge = judge_of(gone, office_map.lines, office_map.grid)
    listed = differences(judge, T)
    assert near(listed.missing, never)
    assert longest in listed.new_of.tolist()
    assert near(listed.new, wall.tolist())
    as_built = differences(
        judge_of(FloorPlan.of(office.walls), office_map.lines, office_map.grid),
        T,
    )
    assert not near(as_built.missing, never)
    assert not near(as_built.new, wall.tolist())
    total = sum(lengths(p).sum() for p in (listed.confirmed, listed.unseen))
    assert total <= lengths(gone.lines).sum() + 1e-6
    page = to_svg(draw_differences(listed))
    assert 'data-name="missing"' in page
    assert "pieces of wall" in page


def without(walls: NDArray[np.float64], wall: NDArray[np.float64]) -> NDArray[np.float64]:
    """Walls that do not run within half a metre of one that is taken away."""
    along = (wall[2:] - wall[:2]) / np.hypot(*(wall[2:] - wall[:2]))
    normal = np.array([-along[1], along[0]])
    ends = walls.reshape(-1, 2, 2) - wall[:2]
    off, on = np.abs(ends @ normal).max(axis=1), ends @ along
    length = float(np.hypot(*(wall[2:] - wall[:2])))
    beside = (on.max(axis=1) > 0.0) & (on.min(axis=1) < length) & (off < 0.5)
    kept: NDArray[np.float64] = walls[~beside]
    return kept


def near(pieces: NDArray[np.float64], wall: list[float]) -> bool:
    """Does any piece lie within a quarter metre of the wall's middle, along it?"""
    middle = np.array([wall[0] + wall[2], wall[1] + wall[3]]) / 2.0
    direction = math.atan2(wall[3] - wall[1], wall[2] - wall[0])
    for piece in pieces:
        along = piece[2:] - piece[:2]
        t = np.clip((middle - piece[:2]) @ along / (along @ along), 0.0, 1.0)
        turn = 2.0 * wrap(math.atan2(along[1], along[0]) - direction)
        if np.hypot(*(piece[:2] + t * along - middle)) < 0.25 and abs(wrap(turn)) < 0.5:
            return True
    return False


@pytest.mark.skipif(not REAL.is_dir(), reason=f"no floor plans in {REAL}")
@pytest.mark.parametrize(
    "name",
    [
        "Joydeepb-Home",
        *(
            pytest.param(n, marks=pytest.mark.long)
            for n in ("AHG1", "GDC1", "GDC3", "GHC3", "NSH1")
        ),
    ],
)
def test_real_buildings_are_found_in_their_plans(name: str) -> None:
    world = World.from_text(REAL / f"{name}.txt")
    site = survey(world, T_PLAN_MAP, seed=1, duration_s=60.0)
    assert_at(found(world.walls, site), T_PLAN_MAP, 0.05, 0.1)


@pytest.mark.long
@pytest.mark.skipif(not REAL.is_dir(), reason=f"no floor plans in {REAL}")
def test_real_buildings_are_not_found_in_each_others_plans() -> None:
    worlds = {p.stem: World.from_text(p) for p in sorted(REAL.glob("*.txt"))}
    for name, world in worlds.items():
        site = survey(world, T_PLAN_MAP, seed=2, duration_s=60.0)
        for other, plan in worlds.items():
            answer = found(plan.walls, site)
            assert (answer.verdict == "registered") == (name == other), (name, other, answer.reason)
