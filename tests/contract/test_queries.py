"""Every query of the contract, on a site whose map is known (the fake mapper's)."""

from __future__ import annotations

import asyncio
import csv
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import networkx as nx
import numpy as np
import pytest
import pytest_asyncio

pytestmark = pytest.mark.asyncio(loop_scope="module")

Make = Callable[..., dict[str, Any]]
Idle = Callable[[str], Awaitable[dict[str, Any]]]

SITE = "/v1/sites/office"


@pytest_asyncio.fixture(scope="module", loop_scope="module", autouse=True)
async def _office(client: httpx.AsyncClient, make_scan: Make, idle: Idle) -> None:
    """Robots a and b in component c1 with 3 and 5 scans, `alone` in its own with 1."""
    for robot, scans in (("a", 3), ("b", 5), ("alone", 1)):
        body = {"scans": [make_scan(seq) for seq in range(scans)]}
        await client.post(f"{SITE}/robots/{robot}/scans", json=body)
    await idle("office")


async def _get(client: httpx.AsyncClient, path: str, **params: str) -> httpx.Response:
    response = await client.get(f"{SITE}{path}", params=params)
    assert response.status_code == 200, response.text
    return response


async def _expect_refusal(
    client: httpx.AsyncClient, path: str, status: int, slug: str, **params: str
) -> dict[str, Any]:
    response = await client.get(path, params=params)
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    problem: dict[str, Any] = response.json()
    assert problem["type"] == f"/problems/{slug}"
    return problem


async def test_sites(client: httpx.AsyncClient) -> None:
    (site,) = (await client.get("/v1/sites")).json()["sites"]
    assert site == (await _get(client, "")).json()


async def test_site(client: httpx.AsyncClient) -> None:
    site = (await _get(client, "")).json()
    assert site["site"] == "office"
    assert site["version"] == 9
    assert site["idle"] is True
    assert site["scans"] == {"accepted": 9, "processed": 9, "pending": 0, "skipped": 0}
    assert site["robots"] == ["a", "alone", "b"]
    assert site["components"][1] == {"id": "c1", "robots": ["a", "b"], "keyframes": 1}
    assert site["constraints"] == {"rendezvous": {"accepted": 1}, "loop": {"rejected": 1}}


async def test_robots(client: httpx.AsyncClient) -> None:
    answer = (await _get(client, "/robots")).json()
    assert [robot["robot"] for robot in answer["robots"]] == ["a", "alone", "b"]
    robot = (await _get(client, "/robots/b")).json()
    for each in (robot, answer["robots"][2]):
        assert 0.0 <= each.pop("silent_for_s") < 3600.0
        assert each["last_received"] > 1e9
    assert robot == answer["robots"][2]
    assert robot["component"] == "c1"
    assert robot["state"] == "tracking"
    pose = robot["pose"]
    assert (pose["x"], pose["y"], pose["theta"]) == (5.0, 0.0, 0.0)
    assert np.array(pose["covariance"]).shape == (3, 3)
    assert robot["scans"] == {"accepted": 5, "processed": 5, "pending": 0, "skipped": 0}
    assert (robot["latest_seq"], robot["latest_stamp"]) == (4, 104.0)
    assert robot["mount"] is None


async def test_trajectory_as_json(client: httpx.AsyncClient) -> None:
    answer = (await _get(client, "/robots/a/trajectory")).json()
    assert (answer["robot"], answer["version"]) == ("a", 9)
    assert answer["poses"][2] == {
        "session": "0",
        "seq": 2,
        "stamp": 102.0,
        "component": "c1",
        "x": 3.0,
        "y": 0.0,
        "theta": 0.0,
    }
    assert len(answer["poses"]) == 3


async def test_trajectory_as_tum_and_csv(client: httpx.AsyncClient) -> None:
    tum = await _get(client, "/robots/a/trajectory", format="tum")
    assert tum.headers["content-type"].startswith("text/plain")
    rows = [row.split() for row in tum.text.splitlines() if not row.startswith("#")]
    assert [float(v) for v in rows[0]] == [100.0, 1.0, 0, 0, 0, 0, 0, 1]
    table = await _get(client, "/robots/a/trajectory", format="csv")
    assert table.headers["content-type"].startswith("text/csv")
    records = list(csv.DictReader(table.text.splitlines()))
    assert [record["seq"] for record in records] == ["0", "1", "2"]


async def test_a_scan_that_fitted_nowhere_has_a_row_without_a_pose(
    client: httpx.AsyncClient,
) -> None:
    path = "/robots/alone/trajectory"
    placed, lost = (await _get(client, path)).json()["poses"]
    assert placed["component"] is not None
    nothing = dict.fromkeys(("component", "x", "y", "theta"))
    assert lost == {"session": "0", "seq": 77, "stamp": 99.5, **nothing}
    table = (await _get(client, path, format="csv")).text.splitlines()
    assert table[2] == "0,77,99.5,,,,"
    tum = (await _get(client, path, format="tum")).text.splitlines()
    assert len([row for row in tum if not row.startswith("#")]) == 1


async def test_transform(client: httpx.AsyncClient) -> None:
    answer = (await _get(client, "/transforms/a/b")).json()
    assert answer["T_a_b"] == {"x": 2.0, "y": 0.0, "theta": 0.0}
    assert answer["component"] == "c1"
    assert answer["constraints"] == ["k0-2"]
    # Both robots' own figures add up, and b's bearing of a's heading error: 2 m away.
    expected = np.diag([0.02, 0.02 + 2.0**2 * 0.001, 0.002])
    expected[1, 2] = expected[2, 1] = 2.0 * 0.001
    np.testing.assert_allclose(answer["covariance"], expected, atol=1e-12)
    back = (await _get(client, "/transforms/b/a")).json()
    assert back["T_a_b"]["x"] == -2.0
    same = (await _get(client, "/transforms/a/a")).json()
    assert same["T_a_b"] == {"x": 0.0, "y": 0.0, "theta": 0.0}


async def test_transform_of_robots_that_never_met(client: httpx.AsyncClient) -> None:
    problem = await _expect_refusal(client, f"{SITE}/transforms/a/alone", 409, "not-connected")
    assert "c1" in problem["detail"]
    assert "c-alone" in problem["detail"]
    await _expect_refusal(client, f"{SITE}/transforms/a/nobody", 404, "unknown-robot")


async def test_map_as_json(client: httpx.AsyncClient) -> None:
    answer = (await _get(client, "/map")).json()
    assert (answer["site"], answer["version"]) == ("office", 9)
    assert answer["components"] == [
        {"id": "c-alone", "robots": ["alone"]},
        {"id": "c1", "robots": ["a", "b"]},
    ]
    assert len(answer["lines"]) == 6
    assert set(answer["lines"][0]) == {
        *("id", "component", "x1", "y1", "x2", "y2", "sigma", "support"),
        *("robots", "first_seen", "last_seen", "layer", "wall"),
    }


async def test_map_filters(client: httpx.AsyncClient) -> None:
    answer = (await _get(client, "/map", component="c1")).json()
    assert {line["component"] for line in answer["lines"]} == {"c1"}
    assert [component["id"] for component in answer["components"]] == ["c1"]
    answer = (await _get(client, "/map", component="c1", bbox="1.5,-1,1.7,1")).json()
    assert [line["x1"] for line in answer["lines"]] == [1]
    answer = (await _get(client, "/map", format="geojson", bbox="50,50,60,60")).json()
    assert answer["features"] == []


async def test_map_formats(client: httpx.AsyncClient) -> None:
    svg = await _get(client, "/map", format="svg")
    assert svg.headers["content-type"].startswith("image/svg+xml")
    assert "<svg" in svg.text
    png = await _get(client, "/map", format="png", component="c1")
    assert png.headers["content-type"] == "image/png"
    assert png.content.startswith(b"\x89PNG\r\n")
    geojson = await _get(client, "/map", format="geojson")
    assert geojson.headers["content-type"] == "application/geo+json"
    assert geojson.json()["type"] == "FeatureCollection"
    kinds = {feature["properties"]["kind"] for feature in geojson.json()["features"]}
    assert kinds >= {"wall", "trajectory", "robot"}
    problem = await _expect_refusal(client, f"{SITE}/map", 422, "unknown-format", format="bmp")
    assert (
        problem["detail"]
        == "no format 'bmp'; available are json, geojson, svg, png, dxf, csv, ieee1873, nav2"
    )


async def test_layers_are_chosen_in_every_format(client: httpx.AsyncClient) -> None:
    walls = (await _get(client, "/map", layers="wall")).json()["lines"]
    assert walls
    assert {line["layer"] for line in walls} == {"wall"}
    assert (await _get(client, "/map", layers="clutter")).json()["lines"] == []
    drawn = (await _get(client, "/map", layers="clutter", format="geojson")).json()["features"]
    assert "wall" not in {feature["properties"]["kind"] for feature in drawn}
    problem = await _expect_refusal(client, f"{SITE}/map", 422, "invalid-parameter", layers="sky")
    assert "wall, furniture, clutter" in problem["detail"]


@pytest.mark.parametrize("bbox", ["", "1,2,3", "1,2,3,4,5", "a,b,c,d", "0,0,0,1", "nan,0,1,1"])
async def test_a_bbox_that_is_none(client: httpx.AsyncClient, bbox: str) -> None:
    problem = await _expect_refusal(client, f"{SITE}/map", 422, "invalid-parameter", bbox=bbox)
    assert "bbox" in problem["detail"]


async def test_a_component_that_was_merged_points_to_its_survivor(
    client: httpx.AsyncClient,
) -> None:
    response = await client.get(f"{SITE}/map", params={"component": "c9", "format": "json"})
    assert response.status_code == 307
    assert response.headers["location"] == f"{SITE}/map?component=c1&format=json"
    assert response.json() == {"component": "c9", "merged_into": "c1"}
    await _expect_refusal(client, f"{SITE}/map", 404, "unknown-component", component="c77")


@pytest.mark.parametrize("what", ["map", "graph", "graph?format=g2o", "constraints?kind=loop"])
async def test_what_did_not_change_is_304(
    client: httpx.AsyncClient, make_scan: Make, idle: Idle, site: str, what: str
) -> None:
    await client.post(f"/v1/sites/{site}/robots/r/scans", json=make_scan(0))
    await idle(site)
    url = f"/v1/sites/{site}/{what}"
    etag = (await client.get(url)).headers["etag"]
    for current in (etag, f'"other", W/{etag}', "*"):
        response = await client.get(url, headers={"If-None-Match": current})
        assert (response.status_code, response.content) == (304, b"")
        assert response.headers["etag"] == etag
    await client.post(f"/v1/sites/{site}/robots/r/scans", json=make_scan(1))
    await idle(site)
    response = await client.get(url, headers={"If-None-Match": etag})
    assert response.status_code == 200
    assert response.headers["etag"] != etag


async def test_graph(client: httpx.AsyncClient) -> None:
    answer = (await _get(client, "/graph")).json()
    graph = nx.node_link_graph(answer, edges="edges")
    assert (graph.number_of_nodes(), graph.number_of_edges()) == (3, 1)
    assert graph.nodes["0"]["robot"] == "a"
    assert graph.graph == {"site": "office", "version": 9, "settled": True, "submaps": []}
    assert list(graph.edges(keys=True)) == [("0", "2", "k0-2")]
    g2o = await _get(client, "/graph", format="g2o")
    assert g2o.text.count("VERTEX_SE2") == 3
    assert g2o.text.count("EDGE_SE2") == 1
    await _expect_refusal(client, f"{SITE}/graph", 422, "unknown-format", format="dot")


async def test_constraints(client: httpx.AsyncClient) -> None:
    answer = (await _get(client, "/constraints")).json()
    assert [c["id"] for c in answer["constraints"]] == ["k0-2", "k-rejected"]
    assert answer["next_cursor"] is None
    (first,) = (await _get(client, "/constraints", kind="rendezvous")).json()["constraints"]
    assert first["checks"] == {"conflict": 0.02, "unknown": None}
    assert (first["robot_a"], first["robot_b"]) == ("a", "b")
    assert (first["reason"], first["residual"]) == ("they met", 0.5)
    whole = (await _get(client, "/constraints/k0-2")).json()
    # One alone comes with its evidence besides.
    assert first.items() <= whole.items()
    (other,) = (await _get(client, "/constraints", state="rejected")).json()["constraints"]
    assert other["id"] == "k-rejected"
    assert other["residual"] is None


async def test_constraints_by_pages(client: httpx.AsyncClient) -> None:
    page = (await _get(client, "/constraints", limit="1")).json()
    assert [c["id"] for c in page["constraints"]] == ["k0-2"]
    page = (await _get(client, "/constraints", limit="1", cursor=page["next_cursor"])).json()
    assert [c["id"] for c in page["constraints"]] == ["k-rejected"]
    assert page["next_cursor"] is None


@pytest.mark.parametrize(
    "params", [{"kind": "x"}, {"state": "x"}, {"limit": "0"}, {"limit": "x"}, {"cursor": "x"}]
)
async def test_constraint_filters_that_are_none(
    client: httpx.AsyncClient, params: dict[str, str]
) -> None:
    await _expect_refusal(client, f"{SITE}/constraints", 422, "invalid-parameter", **params)


@pytest.mark.parametrize(
    ("path", "slug"),
    [
        ("/v1/sites/nowhere", "unknown-site"),
        ("/v1/sites/nowhere/map", "unknown-site"),
        ("/v1/sites/nowhere/robots", "unknown-site"),
        (f"{SITE}/robots/nobody", "unknown-robot"),
        (f"{SITE}/robots/nobody/trajectory", "unknown-robot"),
        (f"{SITE}/constraints/none", "unknown-constraint"),
        ("/v1/nothing", "not-found"),
        ("/v1/sites/", "not-found"),
        ("/favicon.ico", "not-found"),
    ],
)
async def test_what_is_not_there(client: httpx.AsyncClient, path: str, slug: str) -> None:
    await _expect_refusal(client, path, 404, slug)


async def test_alive_and_ready(client: httpx.AsyncClient) -> None:
    health = (await client.get("/healthz")).json()
    assert health["status"] == "ok"
    for _ in range(3000):
        response = await client.get("/readyz?maps=true")
        if response.status_code == 200:
            break
        assert response.status_code == 503
        assert response.headers["content-type"] == "application/problem+json"
        assert response.json()["reasons"]
        await asyncio.sleep(0.02)
    assert response.json() == {"takes_scans": True, "maps": True, "reasons": []}


async def test_only_what_changed_since_a_version(
    client: httpx.AsyncClient, make_scan: Make, idle: Idle
) -> None:
    url = "/v1/sites/delta/map"
    await client.post("/v1/sites/delta/robots/r/scans", json=make_scan(0))
    await idle("delta")
    first = (await client.get(url)).json()
    assert not {"since", "full", "removed"} & set(first)
    here = {"since": first["version"], "since_settled": first["settled"]}
    assert first["settled"] is True
    same = (await client.get(url, params=here)).json()
    assert (same["full"], same["lines"], same["removed"]) == (False, [], [])
    await client.post("/v1/sites/delta/robots/r/scans", json=make_scan(1))
    await idle("delta")
    changes = (await client.get(url, params={"since": first["version"]})).json()
    assert (changes["full"], changes["since"]) == (False, first["version"])
    # The fake mapper's lines have new ids with every scan.
    assert changes["removed"] == [line["id"] for line in first["lines"]]
    assert changes["lines"] == (await client.get(url)).json()["lines"]
    unknown = (await client.get(url, params={"since": "12345"})).json()
    assert unknown["full"] is True
    assert unknown["lines"] == changes["lines"]
    for since in ("-1", "x", "1.5", str(2**63)):
        await _expect_refusal(client, url, 422, "invalid-parameter", since=since)
    await _expect_refusal(client, url, 422, "invalid-parameter", since="1", format="svg")
