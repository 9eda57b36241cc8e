"""Every command and every Python block of the docs, run against a service that has a map.

A page is run from top to bottom, in a folder of its own (`workplace.py`): its shell commands, then
its Python. What cannot be run is listed, with reasons and counts, in `unrun.py`.
"""

from __future__ import annotations

import asyncio
import re
import warnings
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from lineloom import Client
from lineloom.cli.app import app
from lineloom.cli.child_service import ChildService
from lineloom.wire import AnyEvent
from lineloom_core.scan import Scan
from lineloom_lab.simulation import Fleet, rooms, scanner_360
from typer.testing import CliRunner

from tests.docs import shell
from tests.docs.expected import EXPECTED
from tests.docs.pages import Command, blocks, shell_commands, spans
from tests.docs.unrun import UNRUN, UNRUN_SPANS, Unrun, why_not
from tests.docs.workplace import environment, furnish
from tests.service.databases import POSTGRESQL, fresh_database

SITE = "floor-2"
FIRST_SCANS = {"README.md", "service/docs/quickstart.md"}
"""Pages that send a site's first scan: theirs is to be new."""
FORGETS = "service/docs/api.md"
"""The page that deletes the site in the end comes last."""
DATABASE = "postgresql+asyncpg://lineloom:secret@db/lineloom"
TOKEN_ID = "1f0c2a9b77de"
COMPONENT = "c-4hqxw2oklm3dv7ye"
PAGES = sorted({block.page for block in blocks("sh")})
PYTHON_PRINTS = {
    "clients/python/README.md": r"(?s)^r1 c-\S+ .*c-\S+ joined c-\S+ by \['",
    "core/README.md": r"^$",
    "service/docs/quickstart.md": r"^r1 ",
    "service/docs/tuning.md": r"^$",
}
PLAYS = {"clients/python/docs/command-line.md"}
"""Pages that play recordings, to a site of their own."""
SHORTER = {"simulate": ("--duration", "3")}
"""What is added to commands of the text, lest they take minutes."""
GROUPS = (
    "lineloom config",
    "lineloom constraints",
    "lineloom export",
    "lineloom floorplan",
    "lineloom token",
)
CODES = dict.fromkeys(GROUPS, 2)
CODES |= {"lineloom replay": 2, "lineloom floorplan show": 4}
CODES |= {"lineloom localize": 2, "lineloom join r1 r2:120": 1}
"""What the commands of the text end with, if not 0: a group by itself shows its help, replay and
localize want files, the plan is another building's, and other robots are to be joined."""


@dataclass(frozen=True)
class Stage:
    """The one service, with a site that two robots drove through until they met.

    rest: how r1 went on. constraint, export, component: ids of one each.
    """

    url: str
    rest: list[Scan]
    constraint: str
    export: str
    component: str


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    fleet = Fleet.touring(rooms(0), robots=2, seed=0, duration_s=42.0, lidar=scanner_360())
    named = {robot.name: f"r{number}" for number, robot in enumerate(fleet.robots, start=1)}
    drive = [(named[one.robot], one.scan) for one in fleet.scans()]
    with ChildService(tmp_path_factory.mktemp("service")) as service:
        service.wait_until_ready(600.0)
        with Client(service.url) as client:
            # In two parts, so that there are two components in between for all to see.
            for part in (drive[:200], drive[200:-40]):
                for robot in named.values():
                    client.post_scans(SITE, robot, [scan for name, scan in part if name == robot])
                client.wait_until_idle(SITE, 60.0)
            met = next(client.constraints(SITE, kind="rendezvous", state="accepted"))
            made = client.export(SITE, "svg")
            component = client.site(SITE).components[0].id
        rest = [scan for robot, scan in drive[-40:] if robot == "r1"]
        yield Stage(service.url, rest, met.id, made.id, component)


@pytest.fixture
def folder(tmp_path: Path, stage: Stage) -> Path:
    furnish(tmp_path, rooms(0), stage.rest)
    return tmp_path


@pytest.fixture(scope="module")
def database() -> Iterator[str | None]:
    """An empty database, None where there is no server."""
    with asyncio.Runner() as runner:
        context = fresh_database(POSTGRESQL)
        try:
            url = runner.run(context.__aenter__())
        except pytest.skip.Exception:
            yield None
            return
        yield url
        runner.run(context.__aexit__(None, None, None))


@pytest.fixture(scope="module")
def outcomes(
    stage: Stage, database: str | None, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Future[list[shell.Done]]]:
    """What became of each page's shell commands. Two pages at a time: most of it is waiting."""

    def run(page: str) -> list[shell.Done]:
        folder = tmp_path_factory.mktemp("page")
        furnish(folder, rooms(0), stage.rest)
        return _run_page(page, stage, database, folder)

    with ThreadPoolExecutor(2) as pool:
        futures = {page: pool.submit(run, page) for page in PAGES if page != FORGETS}
    with ThreadPoolExecutor(1) as pool:
        return futures | {FORGETS: pool.submit(run, FORGETS)}


def _run_page(page: str, stage: Stage, database: str | None, folder: Path) -> list[shell.Done]:
    found = [c for c in shell_commands() if c.page == page and why_not(c, UNRUN) is None]
    told = _told(page, stage)
    if database is not None:
        told[DATABASE] = database
    elif unrun := [command for command in found if DATABASE in command.text]:
        warnings.warn(f"{page}: {len(unrun)} commands want a PostgreSQL server", stacklevel=1)
        found = [command for command in found if command not in unrun]
    variables = environment(folder, stage.url, "recordings" if page in PLAYS else SITE)
    variables |= {"C": stage.constraint, "E": stage.export, "LINELOOM_TOKEN": "none-needed"}
    return shell.run(found, told, folder, variables)


@pytest.mark.parametrize("page", sorted({block.page for block in blocks("python")}))
def test_the_python_of(
    page: str, stage: Stage, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    events = Client.events

    def until_now(client: Client, site: str) -> Iterator[AnyEvent]:
        return events(client, site, last_event_id="1-0", until_now=True)

    monkeypatch.setattr(Client, "events", until_now)
    monkeypatch.chdir(folder)
    monkeypatch.setenv("LINELOOM_URL", stage.url)
    names: dict[str, Any] = {"laser": map(_message, stage.rest)}
    names |= {"reference": stage.rest[0], "current": stage.rest[9]}
    for block in blocks("python"):
        if block.page == page:
            text = block.text
            for shown, meant in _told(page, stage).items():
                text = text.replace(shown, meant)
            exec(compile(text, page, "exec"), names)
    output = capsys.readouterr().out
    assert re.search(PYTHON_PRINTS[page], output), output


@pytest.mark.parametrize("page", PAGES)
def test_the_shell_commands_of(page: str, outcomes: dict[str, Future[list[shell.Done]]]) -> None:
    unlike = [
        f"`{one.command.text.strip()}` printed no {pattern}: {one.output[:1000]}"
        for one in outcomes[page].result()
        for start, pattern in EXPECTED
        if _begins(one.command, start) and not re.search(pattern, one.output)
    ]
    assert unlike == []


def test_the_commands_in_the_text(
    stage: Stage, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    for name, value in environment(folder, stage.url, "text").items():
        monkeypatch.setenv(name, value)
    # Completion is installed for the shell that it is called from: a test may have none.
    monkeypatch.setattr("shellingham.detect_shell", lambda: ("bash", "/bin/bash"))
    run = {s.text for s in spans() if why_not(s, UNRUN_SPANS) is None}
    assert CliRunner().invoke(app, ["simulate", "--duration", "2"]).exit_code == 0
    assert CliRunner().invoke(app, ["floorplan", "put", "building.dxf"]).exit_code == 4
    with Client(stage.url) as client:
        component = client.site("text").components[0].id
    failed = []
    for text in sorted(run, key=lambda text: (" simulate" not in text, " delete" in text, text)):
        words = text.replace(SITE, "text").replace(COMPONENT, component).split()[1:]
        done = CliRunner().invoke(app, [*words, *SHORTER.get(words[0], ())])
        if done.exit_code != CODES.get(text, 0):
            failed.append(f"{text}: code {done.exit_code}: {done.output} {done.exception}")
    assert failed == []


@pytest.mark.parametrize(("commands", "unrun"), [(shell_commands(), UNRUN), (spans(), UNRUN_SPANS)])
def test_what_is_not_run_is_just_what_is_listed(
    commands: list[Command], unrun: tuple[Unrun, ...]
) -> None:
    held = Counter(reason for c in commands if (reason := why_not(c, unrun)) is not None)
    counted = {one.start: one.count for one in unrun if one.count is not None}
    assert {one.start: held[one] for one in unrun if one.count is not None} == counted
    assert [one.start for one in unrun if held[one] == 0] == []


def test_what_is_expected_is_expected_of_some_command() -> None:
    starts = [start for start, _ in EXPECTED]
    assert [s for s in starts if not any(_begins(c, s) for c in shell_commands())] == []


def _begins(command: Command, start: str) -> bool:
    """Whether it begins so, a path before the program and quotes aside."""
    plain = re.sub(r"^\S*/(?=lineloom)", "", command.text.strip()).replace('"', "")
    return plain.startswith(start)


def _told(page: str, stage: Stage) -> dict[str, str]:
    """Return what the docs name that is otherwise here, and what it is here."""
    host = stage.url.removeprefix("http://")
    told = {"localhost:8765": host, "lineloom.local:8765": host, 'token="…"': 'token="t"'}
    told |= {"/backup/": "backup/", "Fleet.office(seed=0)": "Fleet.office(seed=0, duration_s=4.0)"}
    told[COMPONENT] = stage.component
    told[TOKEN_ID] = "$(lineloom token list --json | grep -o '[0-9a-f]\\{12\\}' | tail -1)"
    if page in FIRST_SCANS:
        told[SITE] = f"{SITE}-{page.count('/')}"
    return told


def _message(scan: Any) -> SimpleNamespace:
    """A driver's: it counts nothing and knows no session."""
    names = ("stamp", "angle_min", "angle_increment", "range_min", "range_max", "ranges")
    return SimpleNamespace(**{name: getattr(scan, name) for name in names})
