"""lineloom doctor: this machine, a server, and files with one fault each."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import httpx
import pytest
from lineloom.cli import check_installation
from lineloom_core.io.jsonl import ScanRecord, record_to_json, write_jsonl
from lineloom_lab.simulation import DriftingOdometry, Fleet

from tests.clients.cli.test_commands import run
from tests.clients.fake_service import FakeService, problem


def look(*arguments: str | Path, code: int) -> dict[str, dict[str, str]]:
    result = run("doctor", *arguments, "--json")
    assert result.exit_code == code, result.output
    return {finding["check"]: finding for finding in json.loads(result.stdout)}


def test_this_installation_is_well() -> None:
    found = look("--no-server", code=0)
    for check in ("python", "lineloom-client", "lineloom-core", "gtsam", "numba"):
        assert found[check]["verdict"] == "ok", found[check]


def test_mixed_versions_are_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    real = check_installation._installed

    def older(name: str) -> str | None:
        return "0.0.1" if name == "lineloom-core" else real(name)

    monkeypatch.setattr(check_installation, "_installed", older)
    finding = look("--no-server", code=4)["lineloom-core"]
    assert finding["verdict"] == "wrong"
    assert "same version" in finding["advice"]


def healthy(fake: FakeService) -> None:
    alive = {"status": "ok", "version": "0.1.0"}
    fake.routes["GET", "/healthz"] = lambda _: httpx.Response(200, json=alive)
    for method, path in (
        ("GET", "/v1/sites/lineloom-doctor"),
        ("DELETE", "/v1/sites/lineloom-doctor/exports/lineloom-doctor"),
    ):
        fake.routes[method, path] = problem(404, "unknown-site", "no such site")
    path = "/v1/sites/lineloom-doctor/robots/lineloom-doctor/scans"
    fake.routes["POST", path] = problem(400, "malformed-body", "not JSON")


def test_a_server_that_is_well(loopback: str, fake: FakeService) -> None:
    healthy(fake)
    found = look("--url", loopback, code=0)
    assert found["server"]["verdict"] == found["ready"]["verdict"] == "ok"
    assert "everybody may read, ingest, operate" in found["token"]["found"]
    assert fake.scans == {}


def test_a_server_that_warms_up_and_wants_a_token(loopback: str, fake: FakeService) -> None:
    healthy(fake)
    waiting = {"takes_scans": True, "maps": False, "reasons": ["worker 0 is warming up"]}
    fake.routes["GET", "/readyz"] = lambda _: httpx.Response(503, json=waiting)
    refusal = problem(401, "unauthorized", "a token, please")
    fake.routes["GET", "/v1/sites/lineloom-doctor"] = refusal
    found = look("--url", loopback, code=4)
    assert "worker 0 is warming up" in found["ready"]["found"]
    assert "lineloom token create" in found["token"]["advice"]


def test_a_token_with_one_scope(loopback: str, fake: FakeService) -> None:
    healthy(fake)
    path = "/v1/sites/lineloom-doctor/exports/lineloom-doctor"
    fake.routes["DELETE", path] = problem(403, "forbidden", "not yours")
    found = look("--url", loopback, "--token", "t", code=0)
    assert "may read, ingest; not operate" in found["token"]["found"]


def test_no_server() -> None:
    found = look("--url", "http://127.0.0.1:9", code=4)
    assert found["server"]["verdict"] == "wrong"
    assert "lineloom serve" in found["server"]["advice"]


@pytest.fixture(scope="module")
def records() -> list[ScanRecord]:
    fleet = Fleet.office(seed=0, robots=1, duration_s=25.0)
    moved = Fleet.touring(
        fleet.world, robots=1, seed=0, duration_s=25.0, odometry=DriftingOdometry()
    )
    return [ScanRecord(s.scan, s.robot, None) for s in moved.scans()]


def test_a_good_recording(records: list[ScanRecord], tmp_path: Path) -> None:
    path = tmp_path / "good.jsonl"
    write_jsonl(path, records)
    found = look(path, "--no-server", code=0)
    name = records[0].robot
    assert f"{name}: sensor mirrored" not in found
    for check in ("beams", "units", "clock", "map"):
        assert found[f"{name}: {check}"]["verdict"] == "ok", found[f"{name}: {check}"]


def changed(records: list[ScanRecord], path: Path, **changes: Any) -> Path:
    """Write the records with some fields replaced: by a value, or a function of the old one."""
    with path.open("w") as out:
        for record in records:
            line = record_to_json(record)
            for field, change in changes.items():
                line[field] = change(line[field]) if callable(change) else change
            out.write(json.dumps(line) + "\n")
    return path


def in_millimetres(ranges: list[Any]) -> list[Any]:
    return [1000.0 * r if isinstance(r, float) else r for r in ranges]


def halved(ranges: list[Any]) -> list[Any]:
    return [0.5 * r if isinstance(r, float) else r for r in ranges]


@pytest.mark.parametrize(
    ("check", "changes", "what"),
    [
        ("units", {"ranges": in_millimetres, "range_max": 30_000.0}, "divide millimetres"),
        ("clock", {"stamp": 7.0}, "send the scans' times"),
        ("clock", {"stamp": lambda s: 1e3 * s}, "milliseconds"),
        ("beams", {"angle_increment": 1e-5}, "One degree is 0.01745"),
        ("sensor mirrored", {"ranges": lambda r: r[::-1]}, "upside down"),
        ("sensor length-scale", {"ranges": halved}, "another unit than metres"),
    ],
)
def test_one_fault_each(
    records: list[ScanRecord], tmp_path: Path, check: str, changes: dict[str, Any], what: str
) -> None:
    path = changed(records, tmp_path / "bad.jsonl", **changes)
    finding = look(path, "--no-server", code=4)[f"{records[0].robot}: {check}"]
    assert finding["verdict"] == "wrong"
    assert what in finding["advice"] + finding["found"]


def test_a_field_error_names_line_and_field(records: list[ScanRecord], tmp_path: Path) -> None:
    path = changed(records[:3], tmp_path / "bad.jsonl", range_max="far")
    finding = look(path, "--no-server", code=4)["file"]
    assert "bad.jsonl:1: range_max" in finding["found"]


def test_people_see_marks_and_advice(tmp_path: Path) -> None:
    path = tmp_path / "no.jsonl"
    path.write_text("[]\n")
    result = run("doctor", path, "--no-server")
    assert result.exit_code == 4
    assert "ok    gtsam: " in result.stdout
    assert "WRONG file: " in result.stdout
