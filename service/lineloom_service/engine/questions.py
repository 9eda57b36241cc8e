"""What can be asked of a mapper, and how questions and their answers travel between processes.

A question's name, its arguments and its answer are of the types told here, whoever wrote them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from lineloom_core.codec import CodecError, decode, encode
from lineloom_core.mapping.belief.claim import Claim
from lineloom_core.scan import Scan

from lineloom_service.engine.mapper import load


@dataclass(frozen=True, slots=True)
class _Question:
    """arguments: their annotation. answer: where its class is; a process imports what it asks for.

    The answer is None where there is nothing to say.
    """

    arguments: object
    answer: str


_ANSWERS = "lineloom_core.mapping.answers"
_QUESTIONS = {
    "what_if": _Question(tuple[str], f"{_ANSWERS}.evidence:WhatIf"),
    "explain": _Question(tuple[str], f"{_ANSWERS}.evidence:Evidence"),
    "try_join": _Question(tuple[Claim, bool], f"{_ANSWERS}.evidence:JoinTrial"),
    "localise": _Question(tuple[Sequence[Scan]], f"{_ANSWERS}.localisation:Localisation"),
    "rays": _Question(tuple[str, bool], "lineloom_core.fusion.occupancy:Rays"),
    "factors": _Question(tuple[()], f"{_ANSWERS}.factor_graph:FactorGraph"),
    "settled": _Question(tuple[()], f"{_ANSWERS}.view_change:ViewChange"),
}
"""Methods of the mapper that answer and change nothing: what `Engine.ask` may name."""


def unpack_arguments(question: str, data: bytes) -> tuple[Any, ...]:
    """Return the arguments that `encode` wrote. Raises CodecError for others, or no question."""
    arguments: tuple[Any, ...] = decode(data, _known(question).arguments)
    return arguments


def unpack_answer(question: str, data: bytes) -> Any:
    """Return the answer that `encode` wrote. Raises CodecError for anything else."""
    return decode(data, load(_known(question).answer) | None)


def pack_question(site_id: int, question: str, arguments: tuple[object, ...]) -> bytes:
    """Return a question to the mapper of a site."""
    return encode((site_id, question, encode(arguments)))


def unpack_question(data: bytes) -> tuple[int, str, tuple[Any, ...]]:
    """Return what `pack_question` wrote. Raises CodecError for anything else."""
    site_id, question, arguments = decode(data, tuple[int, str, bytes])
    return site_id, question, unpack_arguments(question, arguments)


def _known(question: str) -> _Question:
    known = _QUESTIONS.get(question)
    if known is None:
        raise CodecError(f"no question {question!r}")
    return known
