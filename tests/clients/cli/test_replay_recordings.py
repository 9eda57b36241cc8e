"""Bags, tinySLAM logs and compressed logs through `lineloom replay`."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import httpx
import pytest

from tests.clients.cli.test_commands import CARMEN, one_line, run
from tests.clients.fake_service import FakeService
from tests.core.io.bags import SCAN, TRANSFORMS, Entry, Messages, write_bag

START = 1_700_000_000.0


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    m = Messages("mcap")
    entries: list[Entry] = [
        ("/tf_static", TRANSFORMS, START, m.transform(START, "base_link", "laser", 0.3, 0, 0))
    ]
    for i in range(3):
        t = START + 0.1 * i
        for robot, frame in (("r1", "laser"), ("r2", "other")):
            entries.append((f"/{robot}/scan", SCAN, t, m.scan(t, frame, [1.0 + i, 2.0])))
    return write_bag(tmp_path, "mcap", entries)


def test_a_bag_is_played_as_its_robots(bag: Path, loopback: str, fake: FakeService) -> None:
    mounts: dict[str, object] = {}

    def take_mount(request: httpx.Request) -> httpx.Response:
        mounts["r1"] = json.loads(request.content)["mount"]
        scans = {"accepted": 0, "processed": 0, "pending": 0}
        robot = {"site": "default", "robot": "r1", "state": "starting", "scans": scans}
        return httpx.Response(200, json=robot | {"keyframes": 0, "health": []})

    fake.routes["PUT", "/v1/sites/default/robots/r1"] = take_mount
    result = run("replay", bag, "--url", loopback, "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["components"] == [["r1", "r2"]]
    assert mounts == {"r1": {"x": pytest.approx(0.3), "y": 0.0, "theta": 0.0, "inverted": False}}
    sent = [(robot, seq) for _, robot, _, seq in fake.scans]
    assert sorted(sent) == [(r, n) for r in ("r1", "r2") for n in range(3)]
    again = run("replay", bag, "--url", loopback)
    assert "6 scans were on the site before" in again.stderr


def test_topics_of_a_bag_are_chosen(bag: Path, loopback: str, fake: FakeService) -> None:
    result = run("replay", bag, "--topic", "/r2/scan", "--robot", "mine", "--url", loopback)
    assert result.exit_code == 0, result.output
    assert {robot for _, robot, _, _ in fake.scans} == {"mine"}
    wrong = run("replay", bag, "--topic", "/r9/scan", "--url", loopback)
    assert "no laser scans on /r9/scan; they are on: /r1/scan, /r2/scan" in one_line(wrong, 1)


def test_compressed_and_tinyslam_logs_are_played_together(
    tmp_path: Path, loopback: str, fake: FakeService
) -> None:
    packed = tmp_path / "carmen.log.gz"
    packed.write_bytes(gzip.compress(CARMEN.encode()))
    tiny = tmp_path / "tiny.dat"
    tiny.write_text(
        "".join(f"{n * 100_000} " + " ".join(["7"] * 23 + ["1500"] * 682) + "\n" for n in range(4))
    )
    result = run("replay", packed, tiny, "--url", loopback)
    assert result.exit_code == 0, result.output
    counts = [robot for _, robot, _, _ in fake.scans]
    assert (counts.count("carmen"), counts.count("tiny")) == (9, 4)


def test_what_is_no_recording_is_told(tmp_path: Path) -> None:
    assert "no bag of ROS 2" in one_line(run("replay", tmp_path), 1)
    assert "No such file" in one_line(run("replay", tmp_path / "no.mcap"), 1)
    broken = tmp_path / "broken.bag"
    broken.write_bytes(b"nothing")
    assert "not a bag that can be read" in one_line(run("replay", broken), 1)


@pytest.mark.parametrize(
    ("name", "content", "next_step"),
    [
        ("run.rawlog", "", "rawlog-edit"),
        ("run.rawlog.gz", "", "rawlog-edit"),
        ("run.txt", "# stamp r0 r1\n0.0 1.0 2.0\n", "save it with numpy as .npz"),
        ("run.zip", "", "unpack it first"),
    ],
)
def test_what_is_not_read_is_refused_with_the_next_step(
    name: str, content: str, next_step: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_text(content)
    said = one_line(run("replay", path), 1)
    assert next_step in said
    assert "Read are JSON lines, numpy (.npz)" in said


def test_a_log_is_known_by_what_it_holds(tmp_path: Path, loopback: str, fake: FakeService) -> None:
    (tmp_path / "a.txt").write_text(CARMEN)
    (tmp_path / "b.log").write_text("Odometry 0 0 0\nLaser 3 1.0 2.0 3.0\nLaser 3 1.0 2.0 3.1\n")
    result = run("replay", tmp_path / "a.txt", tmp_path / "b.log", "--url", loopback)
    assert result.exit_code == 0, result.output
    assert {robot for _, robot, _, _ in fake.scans} == {"a", "b"}
