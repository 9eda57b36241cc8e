"""Occupancy grids: the kernel against a slow twin, a room, and nav2's files read back."""

from __future__ import annotations

import io
import math
import zipfile

import numpy as np
import pytest
import yaml
from lineloom_core.fusion import _occupancy_kernels as kernels
from lineloom_core.fusion.occupancy import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    GridTooLargeError,
    OccupancyGrid,
    Rays,
    rasterise,
)
from lineloom_core.io import nav2
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.simulation import Fleet
from numpy.typing import NDArray
from PIL import Image

NONE = np.empty((0, 4))


def slow_cells(ax: float, ay: float, bx: float, by: float) -> set[tuple[int, int]]:
    """Cells whose inside a segment passes: sampled so densely that only slivers are missed."""
    t = np.linspace(0.0, 1.0, 20_001)
    x, y = ax + t * (bx - ax), ay + t * (by - ay)
    cells = zip(np.floor(y).astype(int).tolist(), np.floor(x).astype(int).tolist(), strict=True)
    return set(cells)


def test_a_walk_passes_the_cells_that_a_dense_sampling_finds() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        ax, ay, bx, by = rng.uniform(-5.0, 25.0, 4).tolist()
        counts = np.zeros((20, 20), dtype=np.uint16)
        kernels.walk(counts, ax, ay, bx, by)
        walked = {(int(i), int(j)) for i, j in np.argwhere(counts)}
        sampled = {(i, j) for i, j in slow_cells(ax, ay, bx, by) if 0 <= i < 20 and 0 <= j < 20}
        assert sampled <= walked
        assert len(walked - sampled) <= 1  # a corner that the sampling steps over
        assert counts.max(initial=0) <= 1


@pytest.mark.parametrize(("bx", "by"), [(9.5, 2.5), (2.5, 9.5), (2.5, 2.5), (0.5, 2.5), (2.5, 0.5)])
def test_walks_along_the_axes(bx: float, by: float) -> None:
    counts = np.zeros((12, 12), dtype=np.uint16)
    kernels.walk(counts, 2.5, 2.5, bx, by)
    assert counts.sum() == abs(math.floor(bx) - 2) + abs(math.floor(by) - 2) + 1


def room_rays(x: float = 1.0, y: float = 2.0, theta: float = 0.3) -> Rays:
    """A full turn in the room [0, 6] x [0, 4] from (x, y); one beam of eight without return."""
    angles = np.linspace(-math.pi, math.pi, 721)[:-1]
    c, s = np.cos(angles + theta), np.sin(angles + theta)
    with np.errstate(divide="ignore"):
        ranges = np.minimum(
            np.where(c > 0, (6.0 - x) / c, -x / c), np.where(s > 0, (4.0 - y) / s, -y / s)
        )
    ranges[::8] = np.inf
    sweep = (float(angles[0]), float(angles[1] - angles[0]))
    return Rays.of([np.array([x, y, theta])], [sweep], [ranges])


def test_a_room_is_free_inside_occupied_at_its_walls_and_unknown_beyond() -> None:
    grid = rasterise(room_rays(), NONE, 0.05)
    assert grid.at(3.0, 2.0) == FREE
    assert grid.at(5.7, 3.7) == FREE
    for x, y in ((0.0, 2.0), (6.001, 2.0), (3.0, 4.001), (3.0, -0.001)):
        near = [grid.at(x + a, y + b) for a in (-0.05, 0.0, 0.05) for b in (-0.05, 0.0, 0.05)]
        assert OCCUPIED in near
    assert grid.at(6.15, 2.0) == UNKNOWN
    assert grid.at(-50.0, 0.0) == UNKNOWN
    assert grid.x / 0.05 == pytest.approx(round(grid.x / 0.05))


def test_no_return_is_no_free_space() -> None:
    rays = room_rays()
    silent = Rays(rays.poses, rays.sweeps, rays.starts, np.full_like(rays.ranges, np.inf))
    grid = rasterise(silent, NONE, 0.05)
    assert set(np.unique(grid.cells)) == {UNKNOWN}


def test_lines_are_occupied_whatever_the_beams_say() -> None:
    grid = rasterise(room_rays(), np.array([[3.02, 1.0, 3.02, 3.0]]), 0.05)
    assert all(grid.at(3.02, y) == OCCUPIED for y in np.arange(1.0, 3.0, 0.05))
    assert grid.at(3.12, 2.0) == FREE


def test_a_box_cuts_the_same_cells_out() -> None:
    whole = rasterise(room_rays(), NONE, 0.05)
    part = rasterise(room_rays(), NONE, 0.05, (1.0, 1.0, 2.0, 3.0))
    assert part.cells.shape == (40, 20)
    i, j = round((part.y - whole.y) / 0.05), round((part.x - whole.x) / 0.05)
    np.testing.assert_array_equal(part.cells, whole.cells[i : i + 40, j : j + 20])


def test_what_does_not_fit_says_what_would() -> None:
    with pytest.raises(GridTooLargeError, match=r"from 0\.\d+ m on it fits"):
        rasterise(room_rays(), np.array([[0.0, 0.0, 3000.0, 3000.0]]), 0.05)
    with pytest.raises(ValueError, match="resolution"):
        rasterise(room_rays(), NONE, 0.0)
    assert rasterise(Rays.of([], [], []), NONE, 0.05).cells.max() == UNKNOWN


def read_nav2(data: bytes) -> tuple[NDArray[np.int8], dict[str, object]]:
    """Read a zip as nav2's map server does in mode `trinary`, with Pillow and PyYAML."""
    archive = zipfile.ZipFile(io.BytesIO(data))
    assert archive.testzip() is None
    about = yaml.safe_load(archive.read("map.yaml"))
    grey = np.asarray(Image.open(io.BytesIO(archive.read(about["image"]))), dtype=np.float64)
    occupied = (255.0 - grey) / 255.0
    cells = np.full(grey.shape, UNKNOWN, dtype=np.int8)
    cells[occupied > about["occupied_thresh"]] = OCCUPIED
    cells[occupied < about["free_thresh"]] = FREE
    return cells[::-1], about


def test_nav2_reads_the_same_cells_at_the_same_place() -> None:
    grid = rasterise(room_rays(), NONE, 0.05)
    cells, about = read_nav2(nav2.write_map(grid))
    np.testing.assert_array_equal(cells, grid.cells)
    assert about["origin"] == pytest.approx([grid.x, grid.y, 0.0])
    assert about["resolution"] == 0.05
    assert about["negate"] == 0
    assert about["mode"] == "trinary"
    assert nav2.write_map(grid) == nav2.write_map(grid)
    lone = OccupancyGrid(np.array([[FREE, OCCUPIED], [UNKNOWN, FREE]], np.int8), -1.0, 2.0, 0.5)
    assert lone.at(-0.75, 2.25) == FREE
    assert lone.at(-0.25, 2.25) == OCCUPIED
    assert lone.at(-0.75, 2.75) == UNKNOWN
    np.testing.assert_array_equal(read_nav2(nav2.write_map(lone))[0], lone.cells)


def test_a_mapped_floor_is_free_where_the_robot_was() -> None:
    mapper = SiteMapper()
    for sample in Fleet.office(seed=0, duration_s=12.0).scans():
        mapper.add(sample.robot, sample.scan)
    view = mapper.view()
    component = view.components[0].id
    lines = np.array(
        [[w.x1, w.y1, w.x2, w.y2] for w in view.lines if w.component == component]
    ).reshape(-1, 4)
    grid = rasterise(mapper.rays(component), lines)
    assert mapper.rays("nope").poses.shape == (0, 3)
    places = [k.pose for k in view.keyframes if k.component == component]
    assert len(places) >= 3
    # The cell under the laser itself is passed by its own beams.
    assert all(grid.at(p.x, p.y) == FREE for p in places)
    assert (grid.cells == OCCUPIED).sum() > 100
