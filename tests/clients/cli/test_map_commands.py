"""map, trajectory, graph, export and floorplan against a stand-in for the service."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import httpx
import pytest

from tests.clients.cli.test_commands import one_line, run
from tests.clients.fake_service import FakeService, problem

SITE = "/v1/sites/default"
FILE = b"the bytes of a map"
EXPORT = {
    "id": "nav2-9-abc",
    "site": "default",
    "version": 9,
    "format": "nav2",
    "component": "c0",
    "media_type": "application/zip",
    "size": len(FILE),
    "sha256": hashlib.sha256(FILE).hexdigest(),
    "created": 1_700_000_000.0,
    "url": "http://x/v1/sites/default/exports/nav2-9-abc",
    "map": {
        "mapId": "default/c0",
        "mapVersion": "9-abc",
        "mapDownloadLink": "http://x/v1/sites/default/exports/nav2-9-abc",
        "mapHash": hashlib.sha256(FILE).hexdigest(),
    },
}


def placed(verdict: str) -> dict[str, object]:
    pose = {"x": 1.0, "y": 2.0, "theta": 0.5} if verdict == "registered" else None
    component = {"component": "c0", "verdict": verdict, "reason": "so", "T_plan_map": pose}
    return {
        "site": "default",
        "version": 9,
        "sha256": "0" * 64,
        "lines": 4,
        "extent": 8.0,
        "components": [component],
    }


def answers(fake: FakeService, method: str, path: str, body: object, status: int = 200) -> None:
    content = body if isinstance(body, bytes) else json.dumps(body).encode()
    fake.routes[method, path] = lambda _: httpx.Response(status, content=content)


def test_every_option_of_map_is_asked_for(tmp_path: Path, loopback: str, fake: FakeService) -> None:
    answers(fake, "GET", f"{SITE}/map", FILE)
    target = tmp_path / "deep" / "map.zip"
    options = ["--format", "nav2", "--component", "c0", "--bbox", "0,0,5,5", "--resolution", "0.1"]
    result = run("map", *options, "--frame", "plan", "--output", target, "--url", loopback)
    assert result.exit_code == 0, result.output
    assert target.read_bytes() == FILE
    assert dict(fake.requests[-1].url.params) == {
        "format": "nav2",
        "component": "c0",
        "bbox": "0.0,0.0,5.0,5.0",
        "frame": "plan",
        "resolution": "0.1",
    }
    run("map", "--json", "--align", "--url", loopback)
    assert dict(fake.requests[-1].url.params) == {"format": "json", "align": "true"}


@pytest.mark.parametrize(
    ("command", "path", "form"),
    [
        (["trajectory", "r1"], f"{SITE}/robots/r1/trajectory", "tum"),
        (["trajectory", "r1", "--format", "csv"], f"{SITE}/robots/r1/trajectory", "csv"),
        (["graph"], f"{SITE}/graph", "g2o"),
    ],
)
def test_text_goes_to_stdout_and_nothing_else(
    command: list[str], path: str, form: str, loopback: str, fake: FakeService
) -> None:
    answers(fake, "GET", path, b"1 2 3\n")
    result = run(*command, "--url", loopback)
    assert result.exit_code == 0, result.output
    assert result.stdout == "1 2 3\n"
    assert fake.requests[-1].url.params["format"] == form


@pytest.mark.parametrize(
    ("options", "params"),
    [
        (["--frame", "plan"], {"frame": "plan"}),
        (["--align"], {"align": "true"}),
        ([], {}),
    ],
)
def test_trajectory_and_graph_lie_as_the_map_does(
    options: list[str], params: dict[str, str], loopback: str, fake: FakeService
) -> None:
    answers(fake, "GET", f"{SITE}/robots/r1/trajectory", b"")
    answers(fake, "GET", f"{SITE}/graph", b"")
    for command, form in ((["trajectory", "r1"], "tum"), (["graph"], "g2o")):
        assert run(*command, *options, "--url", loopback).exit_code == 0
        assert dict(fake.requests[-1].url.params) == {"format": form} | params


def test_trajectory_and_graph_for_scripts(loopback: str, fake: FakeService) -> None:
    answers(
        fake,
        "GET",
        f"{SITE}/robots/r1/trajectory",
        {"robot": "r1", "version": 3, "poses": []},
    )
    assert json.loads(run("trajectory", "r1", "--json", "--url", loopback).stdout)["version"] == 3
    about = {"site": "default", "version": 3}
    answers(fake, "GET", f"{SITE}/graph", {"graph": about, "nodes": [], "edges": []})
    found = json.loads(run("graph", "--json", "--url", loopback).stdout)["graph"]
    assert found == {**about, "settled": False, "submaps": []}


def test_exports_are_made_listed_fetched_and_removed(
    tmp_path: Path, loopback: str, fake: FakeService
) -> None:
    answers(fake, "POST", f"{SITE}/exports", EXPORT, 201)
    made = run("export", "create", "--component", "c0", "--url", loopback, "--json")
    assert json.loads(made.stdout) == {**EXPORT, "settled": False}
    sent = json.loads(fake.requests[-1].content)
    assert (sent["format"], sent["component"]) == ("nav2", "c0")
    assert str(EXPORT["sha256"]) in run("export", "create", "--url", loopback).stdout
    answers(fake, "GET", f"{SITE}/exports", {"site": "default", "exports": [EXPORT]})
    assert "nav2-9-abc" in run("export", "list", "--url", loopback).stdout
    answers(fake, "GET", f"{SITE}/exports/nav2-9-abc", FILE)
    target = tmp_path / "map.zip"
    fetch = ["export", "get", "nav2-9-abc", "--output", str(target), "--url", loopback]
    assert run(*fetch).exit_code == 0
    assert target.read_bytes() == FILE
    answers(fake, "GET", f"{SITE}/exports/nav2-9-abc", FILE[:-1])
    assert "not those of its hash" in one_line(run(*fetch), 1)
    assert "lineloom export list" in one_line(run("export", "get", "x", "--url", loopback), 1)
    answers(fake, "DELETE", f"{SITE}/exports/nav2-9-abc", b"", 204)
    assert run("export", "delete", "nav2-9-abc", "--url", loopback).exit_code == 0


def test_a_floor_plan_is_put_and_its_verdict_is_the_exit_code(
    tmp_path: Path, loopback: str, fake: FakeService
) -> None:
    plan = tmp_path / "plan.txt"
    plan.write_text("0,0,8,0\n")
    answers(fake, "PUT", f"{SITE}/floorplan", placed("registered"))
    result = run("floorplan", "put", plan, "--url", loopback)
    assert result.exit_code == 0, result.output
    assert fake.requests[-1].headers["Content-Type"] == "text/plain"
    assert "x 1.000 m, y 2.000 m, turned by 28.65 deg" in result.stdout
    answers(fake, "GET", f"{SITE}/floorplan", placed("ambiguous"))
    result = run("floorplan", "show", "--json", "--url", loopback)
    assert result.exit_code == 4
    assert json.loads(result.stdout)["components"][0]["verdict"] == "ambiguous"
    answers(fake, "GET", f"{SITE}/floorplan/differences", b"<svg/>")
    assert run("floorplan", "differences", "--url", loopback).stdout == "<svg/>"
    odd = tmp_path / "plan.pdf"
    odd.write_text("")
    assert "ends in one of .geojson" in one_line(run("floorplan", "put", odd), 2)
    fake.routes["GET", f"{SITE}/floorplan"] = problem(
        404, "no-floor-plan", "there is none; PUT one"
    )
    assert "PUT one" in one_line(run("floorplan", "show", "--url", loopback), 1)
