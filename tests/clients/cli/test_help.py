"""The help is part of the product: every command shows how it is used, and says all its options."""

from __future__ import annotations

import re
import shlex
from typing import Any

import pytest
import typer.main
from lineloom.cli.app import app
from lineloom.cli.failure import EXIT_CODES, Exit
from typer.testing import CliRunner

ROOT: Any = typer.main.get_command(app)
NAMES = sorted(ROOT.commands)


def help_of(name: str) -> str:
    result = CliRunner().invoke(app, [name, "--help"])
    assert result.exit_code == 0, result.output
    return result.output


def examples(name: str) -> list[str]:
    lines = help_of(name).split("Example:", 1)[1].split("\n\n", 1)[0].splitlines()
    return [line.strip() for line in lines if line.strip()]


def test_these_are_the_commands() -> None:
    assert NAMES == [
        "bench",
        "bridge",
        "config",
        "constraints",
        "db",
        "delete",
        "demo",
        "doctor",
        "events",
        "experiment",
        "export",
        "floorplan",
        "graph",
        "join",
        "localize",
        "map",
        "match",
        "mount",
        "replay",
        "robots",
        "serve",
        "simulate",
        "status",
        "token",
        "trajectory",
        "transform",
        "watch",
    ]


@pytest.mark.parametrize("name", NAMES)
def test_every_command_has_an_example_that_parses(name: str) -> None:
    lines = examples(name)
    assert any(line.startswith(f"lineloom {name}") for line in lines)
    for line in lines:
        program, command, *arguments = shlex.split(line)
        assert program == "lineloom"
        # Parsing alone: an option that was renamed makes the example fail here.
        ROOT.commands[command].make_context(command, arguments)


@pytest.mark.parametrize("name", NAMES)
def test_every_option_and_argument_is_described(name: str) -> None:
    for parameter in ROOT.commands[name].params:
        if "--help" in parameter.opts:
            continue
        described = getattr(parameter, "help", None)
        assert described, f"{name}: {parameter.opts} has no help"
        assert described.endswith("."), f"{name}: {parameter.opts}: {described!r}"


def test_the_exit_codes_are_documented() -> None:
    text = CliRunner().invoke(app, ["--help"]).output
    assert EXIT_CODES.splitlines()[0] in text
    documented = {int(found) for found in re.findall(r"^    (\d)  ", text, re.MULTILINE)}
    assert documented == {int(code) for code in Exit}


def test_the_version_is_told() -> None:
    result = CliRunner().invoke(app, ["--version"])
    assert result.exit_code == 0
    assert re.fullmatch(r"lineloom \d+\.\d+\.\d+\n", result.output)


def test_every_query_has_output_for_scripts() -> None:
    queries: list[Any] = [ROOT.commands[n] for n in ("map", "trajectory", "graph", "match")]
    queries += [ROOT.commands[n] for n in ("status", "doctor", "replay", "simulate", "demo")]
    for group, names in (("export", ("create", "list")), ("floorplan", ("put", "show"))):
        queries += [ROOT.commands[group].commands[n] for n in names]
    queries += [
        ROOT.commands[n] for n in ("join", "localize", "robots", "mount", "transform", "events")
    ]
    queries += ROOT.commands["constraints"].commands.values()
    queries.append(ROOT.commands["floorplan"].commands["differences"])
    for command in queries:
        assert any("--json" in p.opts for p in command.params), command.name


@pytest.mark.parametrize("group", [n for n in NAMES if hasattr(ROOT.commands[n], "commands")])
def test_every_command_of_a_group_has_an_example_and_describes_its_options(group: str) -> None:
    for name, command in ROOT.commands[group].commands.items():
        text = CliRunner().invoke(app, [group, name, "--help"]).output
        assert f"lineloom {group} {name}" in text.split("Example:", 1)[1], name
        for parameter in command.params:
            if "--help" not in parameter.opts:
                assert getattr(parameter, "help", None), (group, name, parameter.opts)


def test_completion_names_the_commands() -> None:
    words = {"_LINELOOM_COMPLETE": "complete_bash", "COMP_WORDS": "lineloom do", "COMP_CWORD": "1"}
    done = CliRunner().invoke(app, [], env=words, prog_name="lineloom")
    assert set(done.output.split()) == {"doctor"}
