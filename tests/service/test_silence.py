"""A robot that sends nothing is told: in its state, in events, among the figures."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from lineloom import Client
from lineloom.wire import Readiness, ResetEvent, Robot, RobotEvent
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_service.observation.arrivals import Arrivals
from lineloom_service.observation.durations import Durations, Histogram
from lineloom_service.observation.metrics import Metrics, SiteFigures
from lineloom_service.store.records import RobotRecord, SiteRecord
from prometheus_client import generate_latest

from tests.service.fake_server import free_port, server


def site(**accepted: int) -> SiteRecord:
    robots = {name: RobotRecord(name, count, 0, None) for name, count in accepted.items()}
    return SiteRecord(7, "s", 1, 0, sum(accepted.values()), robots)


def test_silence_is_counted_from_the_last_new_scan(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    monkeypatch.setattr("time.time", lambda: 1e9 + now)
    arrivals = Arrivals(10.0)
    arrivals.begin(site(old=5))
    arrivals.on_commit(site(old=5, new=1, idle=0))
    now = 109.0
    arrivals.on_commit(site(old=5, new=1, idle=0))  # a duplicate, or another robot's scan
    assert arrivals.turned(site(old=5, new=1, idle=0)) == {}
    now = 111.0
    record = site(old=5, new=1, idle=0)
    assert arrivals.heard(7, record.robots["new"]).received == 1e9 + 100.0
    assert arrivals.heard(7, record.robots["old"]).received is None
    assert arrivals.silent(record) == {"old": 11.0, "new": 11.0}, "who never sent is not silent"
    assert arrivals.turned(record) == {"old": 11.0, "new": 11.0}
    arrivals.note_told(7, arrivals.turned(record))
    assert arrivals.turned(record) == {}
    arrivals.on_commit(site(old=6, new=1, idle=0))
    assert arrivals.turned(site(old=6, new=1, idle=0)) == {"old": None}
    assert arrivals.silent(site(new=1)) == {"new": 11.0}


def test_figures_name_the_longest_silent_only() -> None:
    silent = {f"r{i}": 100.0 + i for i in range(80)}
    figures = SiteFigures("s", 0, 0, SiteMapper().view(), silent=silent)
    metrics = Metrics()
    metrics.watch(lambda: [figures], Durations, Histogram(), _ready)
    text = generate_latest(metrics.registry).decode()
    assert text.count("lineloom_robot_silent_seconds{") == 50
    assert 'lineloom_robot_silent_seconds{robot="r79",site="s"} 179.0' in text
    assert 'lineloom_findings{finding="silent",site="s"} 80.0' in text


def _ready() -> Readiness:
    return Readiness(takes_scans=True, maps=True, reasons=[])


def _scan(seq: int) -> list[dict[str, Any]]:
    beams = {"angle_min": -1.0, "angle_increment": 0.5, "range_min": 0.1, "range_max": 30.0}
    return [{"seq": seq, "stamp": float(seq), **beams, "ranges": [1.0, 2.0, 3.0, 4.0, 5.0]}]


def _until(client: Client, done: Callable[[Robot], bool]) -> Robot:
    for _ in range(500):
        if done(robot := client.robot("s", "r")):
            return robot
        time.sleep(0.02)
    raise AssertionError(robot)


def test_a_robot_falls_silent_and_is_heard_again_also_across_a_restart(tmp_path: Path) -> None:
    port = free_port()
    with Client(f"http://127.0.0.1:{port}") as client:
        for start in range(2):
            with server(tmp_path, port, LINELOOM_SILENT_AFTER_S="0.4"):
                client.post_scans("s", "r", _scan(2 * start))
                client.wait_until_idle("s")
                robot = _until(client, lambda robot: robot.state == "silent")
                assert robot.last_received == pytest.approx(time.time(), abs=60.0)
                assert robot.silent_for_s is not None
                assert robot.silent_for_s >= 0.4
                assert any(text.startswith("silent: no scan has come") for text in robot.health)
                _hear_silence(client, 2 * start + 1)
                client.post_scans("s", "r", _scan(2 * start + 1))
                client.wait_until_idle("s")
                _hear_silence(client, 2 * start + 2)


def _hear_silence(client: Client, times: int) -> None:
    """Wait until events have said so many times that the robot is silent; none is a reset."""
    for _ in range(500):
        events = list(client.events("s", last_event_id="1-0", until_now=True))
        said = [event.state for event in events if isinstance(event, RobotEvent)]
        if said.count("silent") >= times:
            assert not any(isinstance(event, ResetEvent) for event in events)
            assert "tracking" in said
            return
        time.sleep(0.02)
    raise AssertionError(said)
