"""`lineloom config` against a real service with the fake mapper."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from lineloom import Client
from lineloom.cli.app import app
from typer.testing import CliRunner, Result

from tests.service.fake_server import free_port, server


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    port = free_port()
    with server(tmp_path_factory.mktemp("data"), port):
        yield f"http://127.0.0.1:{port}"


def run(url: str, *arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["config", *map(str, arguments), "--url", url])


def test_parameters_are_set_one_by_one_and_taken_back(url: str) -> None:
    done = run(url, "set", "join.least_set=4", "chapter=64", "--site", "s")
    assert done.exit_code == 0, done.output
    assert "join.least_set = 4 (2) constraints: mutually consistent" in done.stdout
    assert "effect: they hold from the first scan on" in done.stderr
    assert run(url, "set", "join.least_set=", "--site", "s").exit_code == 0
    shown = run(url, "show", "--site", "s", "--json")
    assert json.loads(shown.stdout)["own"] == {"join": {}, "chapter": 64}
    assert run(url, "show", "--site", "s").stdout.startswith("chapter = 64 (256) keyframes: ")
    assert len(run(url, "show", "--all", "--site", "s").stdout.splitlines()) > 120


def test_a_word_is_set_as_a_number_is(url: str) -> None:
    done = run(url, "set", "matcher=thesis", "--site", "w")
    assert done.exit_code == 0, done.output
    assert done.stdout.startswith("matcher = thesis (lineloom): ")
    with Client(url) as client:
        assert client.config("w").parameters["matcher"].choices == ["lineloom", "thesis"]


def test_a_file_takes_the_place_of_all_that_was_set(url: str, tmp_path: Path) -> None:
    run(url, "set", "chapter=64", "--site", "t")
    file = tmp_path / "mapper.toml"
    file.write_text("[join]\nleast_evidence = 80\n", encoding="utf-8")
    assert run(url, "file", file, "--site", "t").exit_code == 0
    with Client(url) as client:
        assert client.config("t").own == {"join": {"least_evidence": 80}}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("join.least_sett=4", "/join/least_sett: is not a parameter"),
        ("join.least_set=0", "/join/least_set: has to be from 1"),
        ("join.least_set=many", "/join/least_set: has to be a number, not 'many'"),
        ("matcher=karto", "/matcher: has to be lineloom or thesis, not 'karto'"),
        ("join.least_set", "write NAME=VALUE"),
    ],
)
def test_what_cannot_be_is_said(url: str, change: str, said: str) -> None:
    done = run(url, "set", change, "--site", "u")
    assert done.exit_code != 0
    assert said in done.stderr
    with Client(url) as client:
        assert "u" not in [site.site for site in client.sites().sites]


def test_a_difference_is_told(url: str) -> None:
    scan = {
        "stamp": 0.0,
        "angle_min": -1.0,
        "angle_increment": 0.5,
        "range_min": 0.1,
        "range_max": 30.0,
        "ranges": [1.0, 2.0, 3.0, 4.0, 5.0],
    }
    with Client(url) as client:
        client.post_scans("d", "r", [{**scan, "seq": n, "stamp": float(n)} for n in range(3)])
        client.wait_until_idle("d")
        assert run(url, "difference", "--site", "d").exit_code != 0
        assert client.set_config("d", {"join": {"least_set": 5}}).effect is not None
        for event in client.events("d"):
            if event.type == "remade":
                break
    done = run(url, "difference", "--site", "d")
    assert done.exit_code == 0, done.output
    assert "made anew at version 4: other parameters" in done.stdout
    assert "r moved by 3.000 m" in done.stdout
