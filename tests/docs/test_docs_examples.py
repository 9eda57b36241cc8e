"""What the docs show can be typed: commands and options exist, code compiles, links lead somewhere.

The examples are held to the code, not run: most need robots' files or a service with a map.
"""

from __future__ import annotations

import ast
import importlib
import json
import re
from typing import Any

import pytest
import typer
from lineloom import Client, Outbox
from lineloom.cli.app import app as command_line
from lineloom_core.mapping.site_mapper import SiteMapper

from tests.docs.curl import requests
from tests.docs.pages import ROOT, Block, blocks, command_lines, pages

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


@pytest.mark.parametrize("block", blocks("python"), ids=lambda block: block.page)
def test_python_compiles_and_its_imports_are_there(block: Block) -> None:
    flags = ast.PyCF_ALLOW_TOP_LEVEL_AWAIT | ast.PyCF_ONLY_AST
    tree = compile(block.text, block.page, "exec", flags=flags)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                importlib.import_module(alias.name)
        if isinstance(node, ast.ImportFrom):
            module = importlib.import_module(node.module or "")
            missing = [alias.name for alias in node.names if not hasattr(module, alias.name)]
            assert missing == []


@pytest.mark.parametrize("block", blocks("python"), ids=lambda block: block.page)
def test_python_calls_what_there_is(block: Block) -> None:
    kinds = {"client": Client, "outbox": Outbox, "mapper": SiteMapper}
    flags = ast.PyCF_ALLOW_TOP_LEVEL_AWAIT | ast.PyCF_ONLY_AST
    missing = [
        f"{node.value.id}.{node.attr}"
        for node in ast.walk(compile(block.text, block.page, "exec", flags=flags))
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id in kinds
        and not hasattr(kinds[node.value.id], node.attr)
    ]
    assert missing == []


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
