"""The documentation as data: its pages, their code blocks, and the commands in those."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]

_PLACES = ("*.md", "core/**/*.md", "service/**/*.md", "clients/**/*.md", "docker/*.md")
_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_SPAN = re.compile(r"`(lineloom [^`]+)`")


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block. page: path from the root."""

    page: str
    language: str
    text: str


def pages() -> dict[str, str]:
    """Every page of the documentation by its path from the root."""
    found = sorted({path for place in _PLACES for path in ROOT.glob(place)})
    return {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in found}


def blocks(language: str) -> list[Block]:
    """All fenced blocks of one language."""
    return [
        Block(page, language, text)
        for page, content in pages().items()
        for found, text in _BLOCK.findall(content)
        if found == language
    ]


def shell_commands() -> list[tuple[str, list[str]]]:
    """(page, words) of every command in the sh blocks."""
    return [(block.page, words) for block in blocks("sh") for words in _commands(block.text)]


def command_lines() -> list[tuple[str, list[str]]]:
    """(page, words after `lineloom`) wherever the docs show its command line."""
    in_blocks = [
        (page, words[1:])
        for page, words in shell_commands()
        if words[0].rsplit("/", 1)[-1] == "lineloom"
    ]
    in_text = [
        (page, shlex.split(span)[1:])
        for page, content in pages().items()
        for span in _SPAN.findall(_BLOCK.sub("", content))
    ]
    return in_blocks + in_text


def _commands(text: str) -> Iterator[list[str]]:
    """Words of each command of a block: a quote or a backslash makes it go on in the next line."""
    pending = ""
    for line in text.splitlines():
        pending += line
        if pending.endswith("\\"):
            pending = pending[:-1]
            continue
        try:
            words = shlex.split(pending, comments=True)
        except ValueError:  # a quotation is still open
            pending += "\n"
            continue
        pending = ""
        if words:
            yield words
    assert not pending, f"a quotation is never closed: {pending}"
