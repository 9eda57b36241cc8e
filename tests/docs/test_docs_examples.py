"""What the docs show can be typed: commands and options exist, links lead somewhere.

`test_docs_run.py` runs the examples; here also what it cannot run is held to the code.
"""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
import typer
from lineloom.cli.app import app as command_line

from tests.docs.curl import requests
from tests.docs.pages import ROOT, blocks, command_lines, pages

_LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")


def parse(words: list[str]) -> None:
    """Find the command and read its options. Raises an exception that names what there is not."""
    command: Any = typer.main.get_command(command_line)
    rest = list(words)
    while hasattr(command, "commands") and rest and not rest[0].startswith("-"):
        name = rest.pop(0)
        if name not in command.commands:
            raise LookupError(f"there is no command {name!r}")
        command = command.commands[name]
    command.make_parser(command.context_class(command)).parse_args(args=rest)


def test_every_command_line_is_understood() -> None:
    lines = command_lines()
    assert len(lines) > 20, "the search for command lines is broken"
    wrong = []
    for page, words in lines:
        try:
            parse(words)
        except Exception as error:  # whatever kind: it is named
            wrong.append(f"{page}: lineloom {' '.join(words)}: {error}")
    assert wrong == []


@pytest.mark.parametrize("words", [["maps"], ["map", "--fromat", "svg"], ["token", "make"]])
def test_a_wrong_command_line_is_found(words: list[str]) -> None:
    with pytest.raises(Exception, match=r"(?i)no such|there is no"):
        parse(words)


def test_json_is_json() -> None:
    for block in blocks("json"):
        json.loads(block.text)
    bodies = [r.body for r in requests() if r.body is not None and not r.body.startswith("@")]
    assert bodies, "the search for bodies is broken"
    for body in bodies:
        json.loads(body)


def test_links_lead_to_files() -> None:
    broken = [
        f"{page}: {target}"
        for page, text in pages().items()
        for target in _LINK.findall(text)
        if "://" not in target and not (ROOT / page).parent.joinpath(target).exists()
    ]
    assert broken == []
