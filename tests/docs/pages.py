"""The documentation as data: its pages, their code blocks, and the commands in those."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]

_PLACES = (
    "*.md",
    "core/**/*.md",
    "service/**/*.md",
    "clients/**/*.md",
    "docker/*.md",
    ".github/*.md",
)
_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_SPAN = re.compile(r"`(lineloom [^`]+)`")


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block. page: path from the root."""

    page: str
    language: str
    text: str


@dataclass(frozen=True, slots=True)
class Command:
    """One command of a block, which may span lines. text: as a shell takes it."""

    page: str
    text: str
    words: tuple[str, ...]


def pages() -> dict[str, str]:
    """Every page of the documentation by its path from the root."""
    found = sorted({path for place in _PLACES for path in ROOT.glob(place)})
    return {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in found}


def blocks(language: str | None = None) -> list[Block]:
    """All fenced blocks, or those of one language."""
    return [
        Block(page, found, text)
        for page, content in pages().items()
        for found, text in _BLOCK.findall(content)
        if language in {None, found}
    ]


def shell_commands() -> list[Command]:
    """Every command in the sh blocks."""
    return [command for block in blocks("sh") for command in commands(block)]


def command_lines() -> list[tuple[str, list[str]]]:
    """(page, words after `lineloom`) wherever the docs show its command line."""
    in_blocks = [
        (command.page, list(command.words[1:]))
        for command in shell_commands()
        if command.words[0].rsplit("/", 1)[-1] == "lineloom"
    ]
    return in_blocks + [(span.page, list(span.words[1:])) for span in spans()]


def spans() -> list[Command]:
    """Every `lineloom …` within the text, as it stands there."""
    return [
        Command(page, " ".join(span.split()), tuple(shlex.split(span)))
        for page, content in pages().items()
        for span in _SPAN.findall(_BLOCK.sub("", content))
    ]


def commands(block: Block) -> Iterator[Command]:
    """Commands of a block: a quote or a backslash makes one go on in the next line."""
    pending = ""
    for line in block.text.splitlines():
        pending += line + "\n"
        if pending.endswith("\\\n"):
            continue
        try:
            words = shlex.split(pending.replace("\\\n", ""), comments=True)
        except ValueError:  # a quotation is still open
            continue
        text, pending = pending, ""
        if words:
            yield Command(block.page, text, tuple(words))
    assert not pending, f"a quotation is never closed: {pending}"
