"""The commands that see and mend a map, against a stand-in for the service."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import httpx
import pytest
from lineloom.cli.app import app
from lineloom.cli.dashboard import Rates, picture
from lineloom.wire import Robot, Site
from rich.console import Console
from typer.testing import CliRunner

from tests.clients.cli.test_commands import one_line, run
from tests.clients.cli.test_map_commands import SITE, answers
from tests.clients.fake_service import FakeService, problem, scan

POSE = {"x": 1.0, "y": -2.0, "theta": 0.5}
COUNTS = {"accepted": 9, "processed": 7, "pending": 2}
ROBOT: dict[str, Any] = {
    "robot": "r1",
    "site": "default",
    "component": "c0",
    "pose": POSE,
    "state": "silent",
}
ROBOT |= {"scans": COUNTS, "silent_for_s": 40.0, "health": ["nothing came for 40 s"]}
CONSTRAINT: dict[str, Any] = {
    "id": "k1",
    "kind": "rendezvous",
    "state": "accepted",
    "keyframe_a": "a",
    "keyframe_b": "b",
    "robot_a": "r1",
    "robot_b": "r2",
    "T_a_b": POSE,
    "information": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    "reason": "three agree",
    "checks": {"overlap": 0.4},
    "consistency_set": [],
    "history": [{"version": 3, "state": "accepted", "reason": "three agree"}],
}
STATE: dict[str, Any] = {
    "site": "default",
    "version": 9,
    "idle": False,
    "scans": COUNTS,
    "robots": ["r1"],
    "components": [{"id": "c0", "robots": ["r1"], "keyframes": 3}],
    "merged_into": {},
    "constraints": {"loop": {"accepted": 2}},
}


@pytest.fixture
def answering(fake: FakeService, loopback: str) -> str:
    answers(fake, "GET", f"{SITE}/robots", {"site": "default", "version": 9, "robots": [ROBOT]})
    answers(fake, "GET", f"{SITE}/robots/r1", ROBOT)
    answers(fake, "GET", SITE, STATE)
    answers(fake, "GET", "/v1/sites", {"sites": [STATE]})
    return loopback


def test_localize_sends_the_scans_named_and_tells_the_place(
    tmp_path: Path, loopback: str, fake: FakeService
) -> None:
    path = tmp_path / "run.jsonl"
    path.write_text("".join(json.dumps(scan(n)) + "\n" for n in range(3)), encoding="utf-8")
    place = POSE | {"component": "c0", "covariance": [[0.1] * 3] * 3, "score": 0.9, "checks": {}}
    body = {"site": "default", "verdict": "unique", "reason": "alone", "scan": 1}
    answers(fake, "POST", f"{SITE}/localize", body | {"hypotheses": [place]})
    result = run("localize", f"{path}:2", f"{path}:3", "--url", loopback)
    assert result.exit_code == 0, result.output
    assert "c0: x 1.000 m, y -2.000 m, theta 28.65 deg" in result.stdout
    sent = json.loads(fake.requests[-1].content)["scans"]
    assert [entry["ranges"][0] for entry in sent] == [1.01, 1.02]
    answers(fake, "POST", f"{SITE}/localize", body | {"verdict": "ambiguous", "hypotheses": []})
    assert run("localize", path, "--url", loopback).exit_code == 4


def test_constraints_are_listed_explained_and_undone(loopback: str, fake: FakeService) -> None:
    other = CONSTRAINT | {"id": "k2", "robot_a": "r3", "robot_b": "r4"}
    page = {"site": "default", "version": 9, "constraints": [CONSTRAINT, other]}
    answers(fake, "GET", f"{SITE}/constraints", page)
    listed = run("constraints", "list", "--robot", "r2", "--kind", "rendezvous", "--url", loopback)
    assert "three agree" in listed.stdout
    assert "k2" not in listed.stdout
    assert fake.requests[-1].url.params["kind"] == "rendezvous"
    limited = run("constraints", "list", "--limit", "1", "--url", loopback)
    assert "the first 1" in limited.stdout
    limit = {"at_least": 0.3, "at_most": None, "holds": True, "means": "share seen by both"}
    answers(fake, "GET", f"{SITE}/constraints/k1", CONSTRAINT | {"limits": {"overlap": limit}})
    told = run("constraints", "show", "k1", "--url", loopback).stdout
    assert "because three agree" in told
    assert ">= 0.3" in told
    retracted = CONSTRAINT | {"state": "retracted", "reason": "an operator said so"}
    answers(fake, "POST", f"{SITE}/constraints/k1/retract", retracted)
    answers(fake, "POST", f"{SITE}/constraints/k1/restore", CONSTRAINT)
    said = run("constraints", "retract", "k1", "--url", loopback).stdout
    assert said == "k1: retracted: an operator said so\n"
    assert json.loads(run("constraints", "restore", "k1", "--json", "--url", loopback).stdout)


def test_join_and_confirm_say_what_the_evidence_does_not(loopback: str, fake: FakeService) -> None:
    operator = CONSTRAINT | {"kind": "operator", "reason": "an operator said so"}
    answers(fake, "POST", f"{SITE}/constraints", operator, 201)
    answers(fake, "POST", f"{SITE}/constraints/k1/confirm", operator)
    arguments = ["join", "r1", "r2:12", "--pose", "1,-2,0.5", "--url", loopback]
    assert "accepted: an operator said so" in run(*arguments).stdout
    sent = json.loads(fake.requests[-1].content)
    assert (sent["robot_a"], sent["robot_b"], sent["seq_b"]) == ("r1", "r2", 12)
    assert sent["T_a_b"] == POSE
    assert "seq_a" not in sent
    assert "operator" in run("constraints", "confirm", "k1", "--url", loopback).stdout
    trial = {"constraint": "k9", "component_a": "c0", "component_b": "c1", "keyframe_a": "a"}
    body: dict[str, Any] = trial | {"keyframe_b": "b", "T_a_b": POSE, "T_components": None}
    body |= {"fits": True, "reason": "it fits", "objections": ["a wall is in the way"]}
    body |= {"checks": {}, "limits": {}, "matched": [], "conflicts": []}
    answers(fake, "POST", f"{SITE}/constraints/what-if", body)
    told = run("join", "r1", "place:p3", "--what-if", "--url", loopback).stdout
    assert "against it: a wall is in the way" in told
    assert json.loads(fake.requests[-1].content)["place_b"] == "p3"
    assert "three numbers" in one_line(run("join", "r1", "r2", "--pose", "1,2"), 2)
    assert "whole number" in one_line(run("join", "r1:x", "r2"), 2)


def test_what_if_tells_who_would_part(loopback: str, fake: FakeService) -> None:
    move: dict[str, Any] = {"robot": "r2", "component_before": "c0", "component_after": "c1"}
    moves = [move | {"moved_m": None, "turned_rad": None}]
    moves += [move | {"robot": "r1", "moved_m": 0.25, "turned_rad": 0.1}]
    body: dict[str, Any] = {"constraint": "k1", "action": "retract", "version": 9, "robots": moves}
    body["components_before"] = [{"id": "c0", "robots": ["r1", "r2"]}]
    body["components_after"] = [{"id": "c0", "robots": ["r1"]}, {"id": "c1", "robots": ["r2"]}]
    answers(fake, "POST", f"{SITE}/constraints/k1/what-if", body)
    told = run("constraints", "what-if", "k1", "--url", loopback).stdout
    assert "after retract: c1: r2" in told
    assert "r2 would be in another component" in told
    assert "r1 would move by 0.250 m, 5.73 deg" in told


def test_robots_their_mounts_and_transforms(answering: str, fake: FakeService) -> None:
    assert "nothing came for 40 s" in run("robots", "--url", answering, "--json").stdout
    answers(fake, "PUT", f"{SITE}/robots/r1", ROBOT)
    said = run("mount", "r1", "--x", "0.1", "--inverted", "--url", answering)
    assert "upside down" in said.stdout
    sent = json.loads(fake.requests[-1].content)["mount"]
    assert sent == {"x": 0.1, "y": 0.0, "theta": 0.0, "inverted": True}
    body = {"robot_a": "r1", "robot_b": "r2", "component": "c0", "version": 9, "T_a_b": POSE}
    answers(fake, "GET", f"{SITE}/transforms/r1/r2", body | {"constraints": ["k1"]})
    assert "r2 in r1: x 1.000 m" in run("transform", "r1", "r2", "--url", answering).stdout
    refusal = problem(409, "not-connected", "r1 and r3 are in two maps")
    fake.routes["GET", f"{SITE}/transforms/r1/r3"] = refusal
    assert "Let them drive" in one_line(run("transform", "r1", "r3", "--url", answering), 4)


def test_delete_asks_first(answering: str, fake: FakeService) -> None:
    answers(fake, "DELETE", f"{SITE}/robots/r1", b"", 204)
    arguments = ["delete", "default", "--robot", "r1", "--url", answering]
    refused = CliRunner().invoke(app, arguments, input="n\n")
    assert refused.exit_code == 1
    assert not any(request.method == "DELETE" for request in fake.requests)
    assert "robot r1 of site default is deleted: 9 scans" in run(*arguments, "--yes").stderr
    assert fake.requests[-1].method == "DELETE"


def test_events_are_lines_for_people_and_for_programs(loopback: str, fake: FakeService) -> None:
    data = {"type": "component-merged", "version": 9, "at": 0.0, "component": "c1"}
    data |= {"merged_into": "c0", "robots": ["r1", "r2"], "constraints": ["k1"]}
    stream = f"event: component-merged\nid: 9-0\ndata: {json.dumps(data)}\n\n"
    kind = {"Content-Type": "text/event-stream"}
    fake.routes["GET", f"{SITE}/events"] = lambda _: httpx.Response(
        200, content=stream, headers=kind
    )
    assert "c1 joined c0: r1, r2" in run("events", "--url", loopback).stdout
    assert run("events", "--type", "map", "--url", loopback).stdout == ""
    found = json.loads(run("events", "--json", "--after", "8-0", "--url", loopback).stdout)
    assert found == data | {"id": "9-0"}
    assert fake.requests[-1].headers["Last-Event-ID"] == "8-0"


def test_watch_shows_rates_lag_and_trouble(answering: str) -> None:
    once = run("watch", "--once", "--url", answering)
    assert once.exit_code == 0, once.output
    for said in ("2 scans behind", "c0  3 keyframes", "silent", "40 s ago"):
        assert said in once.stdout
    assert "lineloom events --follow" in one_line(run("watch", "--url", answering), 2)
    rates, state = Rates(), Site.model_validate(STATE | {"trouble": "no worker"})
    console = Console(width=140, record=True)
    for processed, now in ((0, 0.0), (40, 4.0)):
        counts = COUNTS | {"processed": processed}
        robot = Robot.model_validate(ROBOT | {"scans": counts})
        shown = picture(state, [robot], rates, now)
    console.print(shown)
    text = console.export_text()
    assert "10.0" in text
    assert "not mapped just now: no worker" in text


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("lineloom robots --site ", {"default"}),
        ("lineloom robots --site x", set()),
        ("lineloom trajectory ", {"r1"}),
        ("lineloom map --component ", {"c0"}),
    ],
)
def test_the_shell_completes_names(answering: str, line: str, names: set[str]) -> None:
    words = {"_LINELOOM_COMPLETE": "complete_bash", "COMP_WORDS": line, "LINELOOM_URL": answering}
    words["COMP_CWORD"] = str(len(line.split(" ")) - 1)
    done = CliRunner().invoke(app, [], env=words, prog_name="lineloom")
    assert set(done.output.split()) == names


def test_completion_says_nothing_where_no_service_is(answering: str) -> None:
    words = {"_LINELOOM_COMPLETE": "complete_bash", "COMP_WORDS": "lineloom trajectory "}
    words |= {"COMP_CWORD": "2", "LINELOOM_URL": "http://127.0.0.1:9"}
    assert CliRunner().invoke(app, [], env=words, prog_name="lineloom").output.strip() == ""
