"""The commands against a stand-in for the service on loopback."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import httpx
import numpy as np
import pytest
from lineloom.cli.app import app
from lineloom.cli.child_service import free_port
from lineloom_core.io.jsonl import read_jsonl
from typer.testing import CliRunner, Result

from tests.clients.fake_service import FakeService, problem, scan

CARMEN = "".join(
    f"FLASER 181 {' '.join(['2.5'] * 181)} {n} 0 0 {n} 0 0 {100 + n}.5 host {n}\n" for n in range(9)
)


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def one_line(result: Result, code: int) -> str:
    """Check that a command failed as promised, and return what it said."""
    assert result.exit_code == code, result.output
    said = [line for line in result.stderr.splitlines() if line]
    assert len(said) == 1, result.stderr
    assert said[0].startswith("lineloom: ")
    return said[0]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "run 1.log"
    path.write_text(CARMEN, encoding="ascii")
    return path


def write_lines(path: Path, *lines: object) -> Path:
    path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    return path


def test_replay_plays_a_log_and_sums_up(log: Path, loopback: str, fake: FakeService) -> None:
    result = run("replay", log, "--site", "s", "--url", loopback, "--json")
    assert result.exit_code == 0, result.output
    figures = json.loads(result.stdout)
    assert (figures["sent"], figures["accepted"], figures["robots"]) == (9, 9, 1)
    assert figures["components"] == [["run-1"]]
    assert figures["constraints"] == {"loop": {"accepted": 2}}
    assert figures["driven_s"] == 8.0
    assert figures["times_real_time"] == pytest.approx(8.0 / figures["elapsed_s"], abs=0.1)
    sent = list(fake.scans.values())
    assert sent[3]["odometry"] == {"x": 3.0, "y": 0.0, "theta": 0.0}
    assert sent[3]["stamp"] == 103.5


def test_replay_again_changes_nothing_and_says_so(
    log: Path, loopback: str, fake: FakeService
) -> None:
    for _ in range(2):
        result = run("replay", log, "--site", "s", "--url", loopback)
        assert result.exit_code == 0, result.output
    assert "9 scans were on the site before" in result.stderr
    assert "0 new of 9 sent" in result.stdout
    assert len(fake.scans) == 9


def test_replay_splits_a_log_into_interleaved_robots(
    log: Path, loopback: str, fake: FakeService
) -> None:
    options = ["--split", "3", "--no-odometry", "--batch", "1", "--robot", "r"]
    result = run("replay", log, "--site", "s", "--url", loopback, *options)
    assert result.exit_code == 0, result.output
    order = [(robot, seq) for _, robot, _, seq in fake.scans]
    assert order[:6] == [("r-1", 0), ("r-2", 0), ("r-3", 0), ("r-1", 1), ("r-2", 1), ("r-3", 1)]
    assert len(order) == 9
    assert not any("odometry" in entry for entry in fake.scans.values())
    assert [entry["stamp"] for entry in fake.scans.values()][:3] == [100.5, 103.5, 106.5]


def test_replay_plays_json_lines_of_several_robots(
    tmp_path: Path, loopback: str, fake: FakeService
) -> None:
    truth = {"x": 0, "y": 0, "theta": 0}
    lines = [scan(n, robot=f"r{n % 2}", truth=truth, session="day-1") for n in range(6)]
    path = write_lines(tmp_path / "fleet.jsonl", *lines)
    assert run("replay", path, "--site", "s", "--url", loopback).exit_code == 0
    assert sorted(fake.scans) == [("s", f"r{n % 2}", "day-1", n) for n in (0, 2, 4, 1, 3, 5)]
    assert not any("truth" in entry for entry in fake.scans.values())


def test_replay_keeps_to_the_speed_asked_for(log: Path, loopback: str, fake: FakeService) -> None:
    begin = time.monotonic()
    assert run("replay", log, "--url", loopback, "--speed", "16").exit_code == 0
    assert time.monotonic() - begin >= 0.5
    assert len(fake.batch_sizes) >= 5


def test_replay_lists_what_was_refused(log: Path, loopback: str, fake: FakeService) -> None:
    fake.unacceptable = {1, 2}
    result = run("replay", log, "--url", loopback)
    assert result.exit_code == 0
    assert "refused: run-1 seq 1: range_max: too small" in result.stderr
    fake.unacceptable = set(range(9))
    result = run("replay", log, "--url", loopback, "--robot", "other")
    assert result.exit_code == 1
    assert "the service refused all 9 scans" in result.stderr


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.clf", "FLASER 3 1 2\n", "a.clf:1: FLASER: expected 3 ranges"),
        ("a.clf", "nothing\n", "holds no scans"),
        ("a.jsonl", "{}\n", "a.jsonl:1: stamp: Field required"),
        ("a.jsonl", "{\n", "a.jsonl:1: not JSON"),
        ("a.jsonl", '{"stamp": NaN}\n', "a.jsonl:1: not JSON: NaN is not JSON"),
        ("a.jsonl", "[]\n", "a.jsonl:1: a scan is a JSON object"),
    ],
)
def test_a_broken_log_is_named_by_file_and_line(
    tmp_path: Path, loopback: str, name: str, content: str, said: str
) -> None:
    path = tmp_path / name
    path.write_text(content, encoding="utf-8")
    assert said in one_line(run("replay", path, "--url", loopback), 1)


def test_a_missing_file_and_two_of_one_name_are_told(log: Path, loopback: str) -> None:
    missing = one_line(run("replay", "no-such.log", "--url", loopback), 1)
    assert "no-such.log: No such file or directory" in missing
    twice = one_line(run("replay", log, log, "--url", loopback), 2)
    assert "two logs are named run-1" in twice


def test_no_service_is_told_with_what_to_do_next(log: Path) -> None:
    url = f"http://127.0.0.1:{free_port()}"
    for arguments in (["status"], ["map"], ["replay", log]):
        begin = time.monotonic()
        assert "lineloom serve" in one_line(run(*arguments, "--url", url), 3)
        assert time.monotonic() - begin < 20.0


def test_status_shows_sites_and_robots(loopback: str, fake: FakeService) -> None:
    empty: dict[str, list[str]] = {"sites": []}
    fake.routes["GET", "/v1/sites"] = lambda request: httpx.Response(200, json=empty)
    assert "has no sites yet" in run("status", "--url", loopback).stdout
    fake.scans["s", "r", "0", 0] = {}
    counts = {"accepted": 1, "processed": 1, "pending": 0}
    pose = {"x": 1.25, "y": -2.0, "theta": 0.5}
    robot = {"robot": "r", "site": "s", "state": "tracking", "scans": counts, "pose": pose}
    body = {"site": "s", "version": 1, "robots": [{**robot, "health": [], "component": "c1"}]}
    fake.routes["GET", "/v1/sites/s/robots"] = lambda request: httpx.Response(200, json=body)
    shown = run("status", "--site", "s", "--url", loopback)
    assert shown.exit_code == 0, shown.output
    assert "1.25" in shown.stdout
    assert "tracking" in shown.stdout
    told = json.loads(run("status", "--site", "s", "--url", loopback, "--json").stdout)
    assert told["idle"] is True
    assert told["robots"][0]["pose"]["y"] == -2.0
    assert "no site x" in one_line(run("status", "--site", "x", "--url", loopback), 1)


def test_map_writes_the_file_asked_for(tmp_path: Path, loopback: str, fake: FakeService) -> None:
    asked: list[dict[str, str]] = []

    def draw(request: httpx.Request) -> httpx.Response:
        asked.append(dict(request.url.params))
        return httpx.Response(200, content=b"<svg/>")

    fake.routes["GET", "/v1/sites/s/map"] = draw
    target = tmp_path / "new" / "map.svg"
    options = ["--site", "s", "--url", loopback, "--bbox", "0,-1,2.5,3", "--component", "c1"]
    result = run("map", "--format", "svg", "--output", target, *options)
    assert result.exit_code == 0, result.output
    assert target.read_bytes() == b"<svg/>"
    assert asked == [{"format": "svg", "component": "c1", "bbox": "0.0,-1.0,2.5,3.0"}]
    assert run("map", "--site", "s", "--url", loopback).stdout == "<svg/>"
    said = one_line(run("map", "--site", "s", "--url", loopback, "--bbox", "1,2"), 2)
    assert "give four numbers" in said
    assert run("map", "--format", "bmp").exit_code == 2


def test_match_asks_the_service_named(tmp_path: Path, loopback: str, fake: FakeService) -> None:
    path = write_lines(tmp_path / "a.jsonl", scan(0), scan(1), scan(2))
    bodies: list[dict[str, dict[str, float]]] = []

    def answer(request: httpx.Request) -> httpx.Response:
        bodies.append(json.loads(request.content))
        verdict: dict[str, object] = {
            "verdict": "none",
            "T_reference_current": None,
            "weak_direction": None,
        }
        verdict |= {"covariance": None, "score": 0.0, "pairs": [], "checks": {}}
        verdict |= {"alternatives": [], "reason": "no hypothesis stands"}
        return httpx.Response(200, json=verdict)

    fake.routes["POST", "/v1/match"] = answer
    result = run("match", path, f"{path}:3", "--url", loopback)
    assert result.exit_code == 4
    assert result.stdout == "none (score 0.00): no hypothesis stands\n"
    assert bodies[0]["reference"]["stamp"] == 100.0
    assert bodies[0]["current"]["stamp"] == pytest.approx(100.2)
    assert "holds no scan on line 7" in one_line(run("match", path, f"{path}:7"), 1)


def test_a_refusal_of_the_service_is_one_line(log: Path, loopback: str, fake: FakeService) -> None:
    fake.routes["POST", "/v1/sites/default/robots/run-1/scans"] = problem(
        403, "scope", "the token may not ingest"
    )
    said = one_line(run("replay", log, "--url", loopback), 1)
    assert "the token may not ingest" in said
    assert "--token" in said


def test_simulate_writes_scans_with_true_poses(tmp_path: Path) -> None:
    files = [tmp_path / "a.jsonl", tmp_path / "b.jsonl"]
    for path in files:
        options = ["--world", "rooms", "--robots", "2", "--duration", "4", "--seed", "5"]
        options += ["--lidar", "sick-lms200", "--odometry", "--output", str(path)]
        result = run("simulate", *options)
        assert result.exit_code == 0, result.output
    assert files[0].read_bytes() == files[1].read_bytes()
    records = list(read_jsonl(files[0]))
    assert {record.robot for record in records} == {"robot-1", "robot-2"}
    assert 38 <= len(records) <= 42
    assert {len(record.scan) for record in records} == {181}
    assert all(record.truth is not None for record in records)
    assert all(record.scan.odometry is not None for record in records)
    assert all(np.isfinite(record.scan.ranges).sum() > 100 for record in records)


def test_simulate_plays_to_a_service(loopback: str, fake: FakeService) -> None:
    options = ["--world", "rectangle", "--robots", "1", "--duration", "3", "--site", "s"]
    result = run("simulate", *options, "--lidar", "sick-lms200", "--url", loopback, "--json")
    assert result.exit_code == 0, result.output
    figures = json.loads(result.stdout)
    assert figures["accepted"] == len(fake.scans) == figures["sent"] > 10
    assert figures["components"] == [["robot-1"]]


def test_simulate_names_the_worlds_it_knows() -> None:
    said = one_line(run("simulate", "--world", "moon"), 2)
    assert "no world 'moon': choose one of corridors, long-corridor, office" in said


def test_serve_without_the_service_says_what_to_install() -> None:
    script = (
        "import sys; sys.modules['lineloom_service'] = None\n"
        "from lineloom.cli import main\n"
        "sys.argv = ['lineloom', 'serve']; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=30
    )
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "pip install lineloom-client[server]" in done.stderr


def test_a_robots_command_line_needs_no_core(tmp_path: Path, log: Path, loopback: str) -> None:
    lines = write_lines(tmp_path / "a.jsonl", scan(0), scan(1))
    script = (
        "import sys; sys.modules['lineloom_core'] = None; sys.modules['numpy'] = None\n"
        "from lineloom.cli import main\n"
        "sys.argv = ['lineloom', *sys.argv[1:]]; main()"
    )
    for path, code, said in ((lines, 0, "2 new of 2 sent"), (log, 1, "needs the core")):
        command = [sys.executable, "-c", script, "replay", str(path), "--url", loopback]
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=30, env=os.environ
        )
        assert done.returncode == code, done.stderr
        assert said in done.stdout + done.stderr
        assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("status", "kind", "advice", "code"),
    [
        (404, "unknown-site", "`lineloom status` lists the sites", 1),
        (404, "unknown-component", "lists the components", 1),
        (404, "no-floor-plan", "`lineloom floorplan put FILE`", 1),
        (409, "not-registered", "`lineloom floorplan show`", 4),
        (422, "invalid-parameter", "", 1),
    ],
)
def test_what_the_service_refuses_is_told_with_what_to_do_next(
    status: int, kind: str, advice: str, code: int, loopback: str, fake: FakeService
) -> None:
    fake.routes["GET", "/v1/sites/s/map"] = problem(status, kind, "the reason")
    said = one_line(run("map", "--site", "s", "--url", loopback), code)
    assert "the reason" in said
    assert advice in said
