"""The real client, the real service in a process of its own, loopback between them."""

from __future__ import annotations

import asyncio
import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from lineloom import AsyncClient, Client, InvalidRequestError, NotFoundError, Outbox, RetryPolicy
from lineloom.cli.app import app
from lineloom.cli.child_service import ChildService
from lineloom.wire import MountSettings
from lineloom_lab.simulation import Fleet, SimulatedScan, rooms, sick_lms200
from typer.testing import CliRunner

SCANS = 60


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ChildService]:
    with ChildService(tmp_path_factory.mktemp("service")) as started:
        started.wait_until_ready()
        yield started


@pytest.fixture(scope="module")
def drive() -> list[SimulatedScan]:
    fleet = Fleet.touring(rooms(2), robots=1, seed=2, duration_s=SCANS / 5.0, lidar=sick_lms200())
    return list(fleet.scans())[:SCANS]


@pytest.mark.parametrize("encoding", ["json", "msgpack"])
def test_scans_become_a_trajectory_and_a_map(
    service: ChildService, drive: list[SimulatedScan], encoding: str
) -> None:
    site = f"e2e-{encoding}"
    options = {"encoding": encoding, "compress": True}
    with Client(service.url, **options) as client:  # type: ignore[arg-type]
        client.set_mount(site, "r", MountSettings())
        answer = client.post_scans(site, "r", [entry.scan for entry in drive], batch=7)
        assert (answer.accepted, answer.duplicates, answer.rejected) == (SCANS, 0, [])
        again = client.post_scan(site, "r", drive[0].scan)
        assert (again.accepted, again.duplicates) == (0, 1)
        state = client.wait_until_idle(site, timeout=60.0)
        assert (state.scans.accepted, state.scans.pending, state.robots) == (SCANS, 0, ["r"])
        poses = client.trajectory(site, "r").poses
        assert [pose.seq for pose in poses] == list(range(SCANS))
        first, last = drive[0].true_pose, drive[-1].true_pose
        true = first.between(last)
        assert poses[-1].x == pytest.approx(true.x, abs=0.1)
        assert poses[-1].y == pytest.approx(true.y, abs=0.1)
        assert len(client.map(site).lines) > 5
        assert client.map_file(site, "svg").lstrip().startswith((b"<svg", b"<?xml"))
        assert client.map_file(site, "png").startswith(b"\x89PNG")
        assert json.loads(client.map_file(site, "geojson"))["type"] == "FeatureCollection"
        assert len(client.trajectory_text(site, "r").splitlines()) >= SCANS
        graph = client.graph(site)
        assert {node.robot for node in graph.nodes} == {"r"}
        assert client.robot(site, "r").state == "tracking"
        assert site in [entry.site for entry in client.sites().sites]
        assert client.transform(site, "r", "r").T_a_b.x == pytest.approx(0.0, abs=1e-9)


def test_matching_needs_no_site(service: ChildService, drive: list[SimulatedScan]) -> None:
    with Client(service.url) as client:
        answer = client.match(drive[0].scan, drive[5].scan)
    true = drive[0].true_pose.between(drive[5].true_pose)
    assert answer.verdict != "none"  # two scans of a plain room may well be ambiguous
    assert answer.T_reference_current is not None
    assert answer.T_reference_current.theta == pytest.approx(true.theta, abs=0.05)


def test_the_async_client_is_served_alike(
    service: ChildService, drive: list[SimulatedScan]
) -> None:
    async def go() -> int:
        async with AsyncClient(service.url) as client:
            await client.wait_until_ready()
            scans = [entry.scan for entry in drive]
            posts = [client.post_scans("e2e-async", f"r{n}", scans[:10]) for n in range(4)]
            answers = await asyncio.gather(*posts)
            await client.wait_until_idle("e2e-async", timeout=60.0)
            return sum(answer.accepted for answer in answers)

    assert asyncio.run(go()) == 40


def test_errors_are_the_contracts(service: ChildService, drive: list[SimulatedScan]) -> None:
    with Client(service.url) as client:
        with pytest.raises(NotFoundError):
            client.site("nowhere")
        with pytest.raises(InvalidRequestError) as caught:
            client.post_scan("not a site", "r", drive[0].scan)
        assert caught.value.type


def test_status_and_replay_work_from_the_shell(
    service: ChildService, drive: list[SimulatedScan], tmp_path: Path
) -> None:
    runner = CliRunner()
    log = tmp_path / "rooms.jsonl"
    options = ["--world", "rooms", "--robots", "1", "--duration", "4", "--lidar", "sick-lms200"]
    assert runner.invoke(app, ["simulate", *options, "--output", str(log)]).exit_code == 0
    there = ["--site", "e2e-shell", "--url", service.url]
    played = runner.invoke(app, ["replay", str(log), *there, "--json"])
    assert played.exit_code == 0, played.output
    figures = json.loads(played.stdout)
    assert figures["accepted"] == len(log.read_text(encoding="utf-8").splitlines())
    status = runner.invoke(app, ["status", *there, "--json"])
    assert status.exit_code == 0, status.output
    assert json.loads(status.stdout)["robots"][0]["robot"] == "robot-1"
    picture = tmp_path / "map.svg"
    assert runner.invoke(app, ["map", *there, "--output", str(picture)]).exit_code == 0
    assert picture.stat().st_size > 200


def test_the_thesis_s_path_runs_through_the_service_with_either_matcher(
    service: ChildService, tmp_path: Path
) -> None:
    options = ["closed-path", "--quick", "--url", service.url, "--json", "-o", str(tmp_path)]
    done = CliRunner().invoke(app, ["experiment", *options])
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    for matcher in ("thesis", "default"):
        found = report["matchers"][matcher]
        assert (found["components"], found["placed"]) == (1, found["scans"])
        assert found["error_from_first_max"] < {"thesis": 0.08, "default": 0.03}[matcher]
        assert found["map_lines"] > 5
    assert report["matchers"]["thesis"] != report["matchers"]["default"]
    assert (tmp_path / "closed-path-served-map.png").stat().st_size > 1000


def test_the_outbox_rides_out_the_death_of_the_service(
    service: ChildService, drive: list[SimulatedScan], tmp_path: Path
) -> None:
    quick = RetryPolicy(first_delay=0.05, max_delay=0.2)
    with (
        Client(service.url, retry=RetryPolicy(attempts=1)) as client,
        Outbox(tmp_path / "o.db", client, "death", "r", batch=5, retry=quick) as outbox,
    ):
        for entry in drive[:30]:
            outbox.put(entry.scan)
        assert service.pid is not None
        os.killpg(service.pid, signal.SIGKILL)
        for entry in drive[30:]:
            outbox.put(entry.scan)
        service.stop()
        service.start()
        service.wait_until_ready()
        outbox.flush(timeout=30.0)
        state = client.wait_until_idle("death", timeout=60.0)
        assert state.scans.accepted == SCANS
        poses = client.trajectory("death", "r").poses
        assert [pose.seq for pose in poses] == list(range(SCANS))
        assert outbox.stats().pending == 0
