"""Maps, graphs and trajectories: written, then read back."""

from __future__ import annotations

import csv as stdlib_csv
import io
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import gtsam
import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.io import csv, g2o, geojson, png, svg, tum
from lineloom_core.io.drawing import robot_colour, tint
from lineloom_core.io.selection import UnknownComponentError, clip, select
from lineloom_core.mapping.answers.factor_graph import FactorGraph
from lineloom_core.mapping.answers.site_view import SiteView
from PIL import Image

SVG = "{http://www.w3.org/2000/svg}"


def drawn(view: SiteView, **options: object) -> ET.Element:
    return ET.fromstring(svg.write_map(view, **options).encode())  # type: ignore[arg-type]


def texts(root: ET.Element) -> list[str]:
    return [t.text or "" for t in root.iter(f"{SVG}text")]


def strokes(root: ET.Element, name: str) -> list[ET.Element]:
    return [p for p in root.iter(f"{SVG}path") if p.get("data-name") == name]


def points(path: ET.Element) -> list[tuple[float, float]]:
    pairs = path.get("d", "").replace("M", " M").replace("L", " ").replace("M", "").split()
    numbers = [float(v) for v in pairs]
    return list(zip(numbers[::2], numbers[1::2], strict=True))


def test_svg_shows_all_walls_and_says_what_it_is(site_view: SiteView) -> None:
    root = drawn(site_view)
    assert root.get("role") == "img"
    assert root.get("aria-labelledby") == "map-title map-desc"
    title, desc = root.find(f"{SVG}title"), root.find(f"{SVG}desc")
    assert title is not None
    assert title.text == "Line map of 3 robots, 2 components"
    assert desc is not None
    assert "4242" in (desc.text or "")
    count = sum(p.get("d", "").count("M") for p in strokes(root, "walls"))
    assert count == len(site_view.lines)
    assert {"alice", "bob", "carol", "seen by several", "c1: alice, bob"} <= set(texts(root))
    width, height = float(root.get("width", 0)), float(root.get("height", 0))
    for path in root.iter(f"{SVG}path"):
        for x, y in points(path):
            assert -1.0 <= x <= width + 1.0
            assert -1.0 <= y <= height + 1.0


def test_svg_is_to_scale_and_the_bar_is_right(site_view: SiteView) -> None:
    root = drawn(site_view, component="c1")
    xs = [x for p in strokes(root, "walls") for x, _ in points(p)]
    walls = [v for w in site_view.lines if w.component == "c1" for v in (w.x1, w.x2)]
    pixels_per_metre = (max(xs) - min(xs)) / (max(walls) - min(walls))
    bar = points(strokes(root, "scale bar")[0])
    metres = next(float(t[:-2]) for t in texts(root) if t.endswith(" m"))
    assert bar[2][0] - bar[1][0] == pytest.approx(metres * pixels_per_metre, rel=1e-3)


def test_one_component_or_a_window_of_it(site_view: SiteView) -> None:
    assert not any("carol" in t for t in texts(drawn(site_view, component="c1")))
    box = (10.0, -1.5, 16.0, 1.5)
    root = drawn(site_view, component="c1", bbox=box)
    frame = next(r for r in root.iter(f"{SVG}rect") if r.get("fill") == "none")
    left, top = float(frame.get("x", 0)), float(frame.get("y", 0))
    right = left + float(frame.get("width", 0))
    bottom = top + float(frame.get("height", 0))
    inside = [q for p in strokes(root, "walls") for q in points(p)]
    assert inside
    assert all(left <= x <= right and top <= y <= bottom for x, y in inside)


@pytest.mark.parametrize("render", [svg.write_map, png.write_map, geojson.map_features])
def test_wrong_questions_get_clear_answers(site_view: SiteView, render: object) -> None:
    assert callable(render)
    with pytest.raises(KeyError, match="no component 'nope' here; there is: 'c1', 'c3'") as failure:
        render(site_view, "nope")
    assert isinstance(failure.value, UnknownComponentError)
    assert not str(failure.value).startswith('"')
    with pytest.raises(KeyError, match="merged into 'c1'"):
        render(site_view, "c2")
    with pytest.raises(ValueError, match="x_min < x_max"):
        render(site_view, None, (1.0, 0.0, 1.0, 5.0))
    with pytest.raises(ValueError, match="finite"):
        render(site_view, None, (0.0, 0.0, math.inf, 5.0))


@pytest.mark.parametrize("count", [2, 9, 60])
def test_many_components_and_robots_stay_on_the_page_and_apart(
    site_view: SiteView, count: int
) -> None:
    """A robot that keeps getting lost leaves a row of small components behind."""
    first, small = site_view.components
    walls = [w for w in site_view.lines if w.component == small.id][:20]
    extra = [replace(small, id=f"x{k}", robots=(f"robot-{k}",)) for k in range(count)]
    robots = {
        f"robot-{k}": replace(site_view.robots["carol"], component=None) for k in range(count)
    }
    view = replace(
        site_view,
        components=(first, *extra),
        robots={**site_view.robots, **robots},
        lines=site_view.lines
        + tuple(replace(w, component=c.id, id=f"{c.id}-{w.id}") for c in extra for w in walls),
    )
    root = drawn(view)
    width, height = float(root.get("width", 0)), float(root.get("height", 0))
    frames = [
        [float(r.get(k, 0)) for k in ("x", "y", "width", "height")]
        for r in root.iter(f"{SVG}rect")
        if r.get("fill") == "none"
    ]
    assert len(frames) == count + 1
    for i, (x, y, w, h) in enumerate(frames):
        assert x >= 0
        assert y >= 0
        assert x + w <= width
        assert y + h <= height
        for u, v, p, q in frames[:i]:
            assert u + p <= x or x + w <= u or v + q <= y or y + h <= v
    labels = [(float(t.get("x", 0)), float(t.get("y", 0))) for t in root.iter(f"{SVG}text")]
    assert len(set(labels)) == len(labels)
    assert all(y < height for _, y in labels)


def test_hostile_names_stay_text(site_view: SiteView) -> None:
    component = replace(site_view.components[0], id='<script>&"', robots=("alice", "b<b>"))
    view = replace(site_view, components=(component,), lines=(), trajectories={}, robots={})
    root = drawn(view, component='<script>&"')
    assert any("<script>" in t for t in texts(root))
    assert root.find(f"{SVG}script") is None


def test_an_empty_site_is_drawn_as_such(site_view: SiteView) -> None:
    empty = replace(
        site_view, components=(), lines=(), trajectories={}, robots={}, keyframes=(), constraints=()
    )
    assert "No map yet" in texts(drawn(empty))
    assert Image.open(io.BytesIO(png.write_map(empty))).size[0] == 1600
    assert geojson.map_features(empty)["features"] == []
    assert g2o.write_graph(_factors(empty)) == ""


def test_png_is_the_same_page(site_view: SiteView) -> None:
    data = png.write_map(site_view, width_px=900)
    assert png.write_map(site_view, width_px=900) == data
    picture = Image.open(io.BytesIO(data)).convert("RGB")
    assert picture.width == 900
    colours = np.asarray(picture).reshape(-1, 3)
    for index in range(3):  # each robot's colour is there
        wanted = np.array([int(robot_colour(index)[i : i + 2], 16) for i in (1, 3, 5)])
        assert (np.abs(colours.astype(int) - wanted).max(axis=1) < 8).sum() > 20
    greys = np.unique(colours[:, 0]).size
    assert greys > 100  # smooth edges
    with pytest.raises(ValueError, match="8000"):
        png.write_map(site_view, width_px=9000)
    with pytest.raises(ValueError, match="200"):
        png.write_map(site_view, width_px=20)


def test_many_robots_have_colours_of_their_own() -> None:
    assert len({robot_colour(i) for i in range(40)}) == 40
    assert tint("#000000", 0.0) == "#ffffff"
    assert tint("#102030", 1.0) == "#102030"


def test_geojson_is_geojson_and_owns_up_to_its_metres(site_view: SiteView) -> None:
    features = json.loads(json.dumps(geojson.map_features(site_view)))
    assert features["type"] == "FeatureCollection"
    assert features["coordinates"]["unit"] == "metre"
    assert "not longitude and latitude" in features["coordinates"]["note"]
    walls = [f for f in features["features"] if f["properties"]["kind"] == "wall"]
    assert len(walls) == len(site_view.lines)
    by_id = {w.id: w for w in site_view.lines}
    for wall in walls:
        line = by_id[wall["id"]]
        (x1, y1), (x2, y2) = wall["geometry"]["coordinates"]
        assert (x1, y1, x2, y2) == pytest.approx((line.x1, line.y1, line.x2, line.y2), abs=1e-4)
        assert wall["properties"]["support"] == line.support
        assert wall["properties"]["robots"] == list(line.robots)
    kinds = [f["properties"]["kind"] for f in features["features"]]
    assert kinds.count("trajectory") == 3
    assert kinds.count("robot") == 3


def test_geojson_window_holds_what_touches_it(site_view: SiteView) -> None:
    box = (10.0, -1.5, 16.0, 1.5)
    features = geojson.map_features(site_view, "c1", box)
    assert features["bbox"] == list(box)
    ids = {f["id"] for f in features["features"] if f["properties"]["kind"] == "wall"}
    expected = {
        w.id
        for w in site_view.lines
        if w.component == "c1" and clip((w.x1, w.y1, w.x2, w.y2), box) is not None
    }
    assert ids == expected
    assert 0 < len(ids) < 60
    for f in features["features"]:
        if f["properties"]["kind"] == "trajectory":
            x, y = np.array(f["geometry"]["coordinates"]).T
            assert x.min() >= 10.0
            assert x.max() <= 16.0
            assert abs(y).max() <= 1.5


def test_clipping_against_samples() -> None:
    rng = np.random.default_rng(0)
    box = (-1.0, -0.5, 1.0, 0.5)
    for _ in range(500):
        s = tuple(rng.uniform(-2.0, 2.0, 4).tolist())
        t = np.linspace(0.0, 1.0, 4001)
        x, y = s[0] + t * (s[2] - s[0]), s[1] + t * (s[3] - s[1])
        inside = (x >= -1.0) & (x <= 1.0) & (y >= -0.5) & (y <= 0.5)
        clipped = clip(s, box)
        if not inside.any():
            assert clipped is None or math.dist(clipped[:2], clipped[2:]) < 5e-3
            continue
        assert clipped is not None
        first, last = np.flatnonzero(inside)[[0, -1]]
        expected = (x[first], y[first], x[last], y[last])
        assert clipped == pytest.approx(expected, abs=5e-3)
    assert clip((2.0, 0.0, 2.0, 1.0), box) is None
    assert clip((0.0, 0.0, 0.0, 0.0), box) == (0.0, 0.0, 0.0, 0.0)


def test_paths_break_where_component_or_session_change(site_view: SiteView) -> None:
    trajectory = site_view.trajectories["alice"]
    component = ("c1",) * 50 + ("c3",) * 50 + ("c1",) * 100
    session = ("0",) * 150 + ("1",) * 50
    view = replace(
        site_view,
        trajectories={"alice": replace(trajectory, component=component, session=session)},
    )
    by_id = {c.component.id: [p.poses.shape[0] for p in c.paths] for c in select(view)}
    assert by_id == {"c1": [50, 50, 50], "c3": [50]}


def _factors(view: SiteView) -> FactorGraph:
    """The accepted constraints of a view, as gtsam would have them."""
    row = {keyframe.id: i for i, keyframe in enumerate(view.keyframes)}
    accepted = [c for c in view.constraints if c.state == "accepted"]
    ends = [(row[c.keyframe_a], row[c.keyframe_b]) for c in accepted]
    return FactorGraph(
        view.version,
        tuple(row),
        tuple(k.component for k in view.keyframes),
        np.array([k.pose.to_array() for k in view.keyframes]).reshape(-1, 3),
        np.array(ends, np.int64).reshape(-1, 2),
        np.array([c.T_a_b.to_array() for c in accepted]).reshape(-1, 3),
        np.array([c.information for c in accepted]).reshape(-1, 3, 3),
    )


def test_g2o_is_read_by_gtsam_with_every_digit(site_view: SiteView, tmp_path: Path) -> None:
    file = tmp_path / "graph.g2o"
    file.write_text(g2o.write_graph(_factors(site_view)))
    graph, values = gtsam.readG2o(str(file), False)
    assert values.size() == len(site_view.keyframes)
    number = {keyframe.id: i for i, keyframe in enumerate(site_view.keyframes)}
    for keyframe in site_view.keyframes:
        read = values.atPose2(number[keyframe.id])
        assert (read.x(), read.y()) == (keyframe.pose.x, keyframe.pose.y)
        assert read.theta() == pytest.approx(keyframe.pose.theta, abs=1e-15)
    accepted = [c for c in site_view.constraints if c.state == "accepted"]
    assert graph.size() == len(accepted) == 7
    for i, constraint in enumerate(accepted):
        factor: Any = graph.at(i)
        assert list(factor.keys()) == [number[constraint.keyframe_a], number[constraint.keyframe_b]]
        assert (factor.measured().x(), factor.measured().y()) == (
            constraint.T_a_b.x,
            constraint.T_a_b.y,
        )
        np.testing.assert_allclose(
            factor.noiseModel().information(), constraint.information, rtol=1e-12, atol=1e-9
        )
    assert g2o.write_graph(_factors(site_view)).count("FIX") == 2


def test_tum_rows_hold_the_poses(site_view: SiteView) -> None:
    trajectory = site_view.trajectories["bob"]
    text = tum.write_trajectory(trajectory)
    rows = np.loadtxt(io.StringIO(text))
    assert rows.shape == (200, 8)
    np.testing.assert_array_equal(rows[:, 0], trajectory.stamp)
    np.testing.assert_array_equal(rows[:, 1:3], trajectory.poses[:, :2])
    theta = 2.0 * np.arctan2(rows[:, 6], rows[:, 7])
    np.testing.assert_allclose(np.cos(theta - trajectory.poses[:, 2]), 1.0, atol=1e-15)
    assert "# component c1 session 0" in text


def test_csv_rows_hold_the_poses(site_view: SiteView) -> None:
    trajectory = site_view.trajectories["bob"]
    rows = list(stdlib_csv.DictReader(io.StringIO(csv.write_trajectory(trajectory))))
    assert len(rows) == 200
    assert [int(r["seq"]) for r in rows] == trajectory.seq.tolist()
    read = [Pose(float(r["x"]), float(r["y"]), float(r["theta"])).to_array() for r in rows]
    np.testing.assert_array_equal(np.array(read), trajectory.poses)
    assert {r["component"] for r in rows} == {"c1"}
    assert [float(r["stamp"]) for r in rows] == trajectory.stamp.tolist()
    awkward = replace(trajectory, session=('a,"b"',) * 200)
    again = list(stdlib_csv.DictReader(io.StringIO(csv.write_trajectory(awkward))))
    assert again[0]["session"] == 'a,"b"'
