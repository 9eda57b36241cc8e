"""What the exports write, read by libraries that have nothing to do with them."""

from __future__ import annotations

import csv as stdlib_csv
import io
import json
import math
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import png as pypng
import pyogrio
import pytest
import svgelements
from evo.tools import file_interface
from ezdxf.audit import Auditor
from ezdxf.filemanagement import read as read_dxf
from lineloom_core.geometry import Pose
from lineloom_core.io import csv, dxf, geojson, ieee1873, png, svg, tum
from lineloom_core.io.reframe import in_frames, only
from lineloom_core.io.selection import UnknownComponentError, clip
from lineloom_core.mapping.answers.site_view import MapLine, SiteView
from numpy.typing import NDArray


def line_strings(path: str, **options: Any) -> list[tuple[NDArray[np.float64], dict[str, Any]]]:
    """Return GDAL's LineStrings: points (n, 2) and the fields beside them."""
    meta, _, shapes, columns = pyogrio.raw.read(path, **options)
    found = []
    for i, shape in enumerate(shapes):
        _, kind, count = struct.unpack_from("<BII", shape)
        if kind % 1000 != 2 and kind != 0x80000002:
            continue
        each = 2 if kind == 2 else 3
        points = np.frombuffer(shape, "<f8", each * count, 9).reshape(-1, each)[:, :2]
        fields = {str(n): c[i] for n, c in zip(meta["fields"], columns, strict=True)}
        found.append((points, fields))
    return found


def ends(lines: list[MapLine] | tuple[MapLine, ...]) -> NDArray[np.float64]:
    rows = np.array([[w.x1, w.y1, w.x2, w.y2] for w in lines])
    return rows[np.lexsort(rows.T)]


def test_gdal_reads_the_dxf(site_view: SiteView, tmp_path: Path) -> None:
    file = tmp_path / "map.dxf"
    file.write_text(dxf.write_map(site_view, "c1"))
    drawn = line_strings(str(file))
    walls = [p.reshape(4) for p, fields in drawn if fields["Layer"] == "c1-walls"]
    read = np.array(walls)
    expected = ends([w for w in site_view.lines if w.component == "c1"])
    np.testing.assert_allclose(read[np.lexsort(read.T)], expected, atol=1e-9)
    paths = [p for p, fields in drawn if fields["Layer"] == "c1-trajectories"]
    assert sorted(len(p) for p in paths) == [200, 200]


def test_ezdxf_finds_nothing_to_mend_and_metres(site_view: SiteView) -> None:
    text = dxf.write_map(site_view)
    document = read_dxf(io.StringIO(text))
    auditor: Auditor = document.audit()
    assert not auditor.errors
    assert not auditor.fixes
    assert document.header["$INSUNITS"] == 6
    assert {e.dxf.text for e in document.modelspace().query("TEXT")} == {"alice", "bob", "carol"}
    assert dxf.write_map(site_view) == text


@pytest.mark.parametrize("driver", ["GeoJSON", "JSONFG"])
def test_gdal_reads_the_geojson(site_view: SiteView, tmp_path: Path, driver: str) -> None:
    file = tmp_path / "map.json"
    document = geojson.map_features(site_view)
    assert document["coordRefSys"].startswith("urn:")
    file.write_text(json.dumps(document))
    prefix = "JSONFG:" if driver == "JSONFG" else ""
    walls = [p.reshape(4) for p, f in line_strings(prefix + str(file)) if f["kind"] == "wall"]
    read = np.array(walls)
    np.testing.assert_allclose(read[np.lexsort(read.T)], ends(site_view.lines), atol=1e-3)


def test_svgelements_reads_walls_where_they_are(site_view: SiteView) -> None:
    page = svgelements.SVG.parse(io.StringIO(svg.write_map(site_view, "c1")))
    walls = [
        piece
        for element in page.elements()
        if isinstance(element, svgelements.Path) and element.values.get("data-name") == "walls"
        for piece in element
        if isinstance(piece, svgelements.Line)
    ]
    lines = [w for w in site_view.lines if w.component == "c1"]
    assert len(walls) == len(lines)
    drawn = sum(math.dist(p.start, p.end) for p in walls)
    metres = sum(math.hypot(w.x2 - w.x1, w.y2 - w.y1) for w in lines)
    spread = max(v for p in walls for v in (p.start.x, p.end.x)) - min(
        v for p in walls for v in (p.start.x, p.end.x)
    )
    width = max(v for w in lines for v in (w.x1, w.x2)) - min(
        v for w in lines for v in (w.x1, w.x2)
    )
    assert drawn / metres == pytest.approx(spread / width, rel=1e-3)


def test_pypng_reads_the_png(site_view: SiteView) -> None:
    data = png.write_map(site_view, width_px=600)
    width, height, rows, _ = pypng.Reader(bytes=data).asRGB8()
    pixels = np.vstack([np.asarray(row, dtype=np.uint8) for row in rows])
    assert (width, height) == (600, pixels.shape[0])
    assert pixels.mean() > 200  # mostly paper
    assert pixels.min() < 90  # some ink


def test_evo_reads_the_tum(site_view: SiteView, tmp_path: Path) -> None:
    trajectory = site_view.trajectories["bob"]
    file = tmp_path / "bob.tum"
    file.write_text(tum.write_trajectory(trajectory))
    read = file_interface.read_tum_trajectory_file(str(file))
    np.testing.assert_array_equal(read.timestamps, trajectory.stamp)
    np.testing.assert_array_equal(read.positions_xyz[:, :2], trajectory.poses[:, :2])
    w, z = read.orientations_quat_wxyz[:, 0], read.orientations_quat_wxyz[:, 3]
    off = 2.0 * np.arctan2(z, w) - trajectory.poses[:, 2]
    np.testing.assert_allclose(np.cos(off), 1.0, atol=1e-14)


def test_map_csv_holds_every_digit(site_view: SiteView) -> None:
    rows = list(stdlib_csv.DictReader(io.StringIO(csv.write_map(site_view))))
    assert [r["id"] for r in rows] == [w.id for w in site_view.lines]
    for row, line in zip(rows, site_view.lines, strict=True):
        read = tuple(float(row[k]) for k in ("x1", "y1", "x2", "y2", "sigma"))
        assert read == (line.x1, line.y1, line.x2, line.y2, line.sigma)
        assert row["robots"].split() == list(line.robots)


def test_ieee1873_segments_give_the_walls_back(site_view: SiteView) -> None:
    root = ET.fromstring(ieee1873.write_map(site_view).encode())
    maps = root.findall("local_map")
    assert [m.get("id") for m in maps] == ["c1", "c3"]
    for part in maps:
        lines = [w for w in site_view.lines if w.component == part.get("id")]
        segments = part.findall("line_segments/line_segment")
        assert [s.get("id") for s in segments] == [w.id for w in lines]
        for segment, line in zip(segments, lines, strict=True):
            rho, alpha, a, b = (float(segment.get(k, "nan")) for k in ieee1873._PARAMETERS)
            assert rho >= 0.0
            c, s = math.cos(alpha), math.sin(alpha)
            back = (rho * c - a * s, rho * s + a * c, rho * c - b * s, rho * s + b * c)
            assert back == pytest.approx((line.x1, line.y1, line.x2, line.y2), abs=1e-9)
            assert float(segment.get("covariance_rhorho", "nan")) == line.sigma**2
            assert sum(k.startswith("covariance_") for k in segment.keys()) == 10  # noqa: SIM118


def test_frames_move_everything_and_back(site_view: SiteView) -> None:
    T = Pose(3.0, -2.0, 0.7)
    moved = in_frames(site_view, {"c1": T})
    assert [w for w in moved.lines if w.component == "c3"] == [
        w for w in site_view.lines if w.component == "c3"
    ]
    robot, before = moved.robots["alice"], site_view.robots["alice"]
    assert robot.pose is not None
    assert before.pose is not None
    assert robot.pose.to_array() == pytest.approx((T @ before.pose).to_array())
    last = moved.trajectories["alice"].poses[-1]
    assert last == pytest.approx(robot.pose.to_array())
    back = in_frames(moved, {"c1": T.inverse()})
    np.testing.assert_allclose(ends(back.lines), ends(site_view.lines), atol=1e-12)
    assert in_frames(site_view, {}) is site_view


def test_only_some_components(site_view: SiteView) -> None:
    part = only(site_view, {"c3"})
    assert [c.id for c in part.components] == ["c3"]
    assert {w.component for w in part.lines} == {k.component for k in part.keyframes} == {"c3"}
    assert list(part.robots) == ["carol"]
    assert len(part.trajectories["carol"].poses) == 200
    assert len(part.trajectories["alice"].poses) == 0
    assert {c.id for c in part.constraints} == {"s20", "s21"}
    both = only(site_view, {"c1", "c3"})
    assert both.lines == site_view.lines
    assert both.keyframes == site_view.keyframes


@pytest.mark.parametrize("write", [dxf.write_map, csv.write_map, ieee1873.write_map])
def test_parts_and_refusals_as_everywhere(site_view: SiteView, write: Any) -> None:
    with pytest.raises(UnknownComponentError, match="merged into 'c1'"):
        write(site_view, "c2")
    box = (10.0, -1.5, 16.0, 1.5)
    inside = tuple(
        w
        for w in site_view.lines
        if w.component == "c1" and clip((w.x1, w.y1, w.x2, w.y2), box) is not None
    )
    bare = replace(site_view, trajectories={}, robots={})
    assert write(bare, "c1", box) == write(replace(bare, lines=inside), "c1")
    assert 0 < len(inside) < 60
