"""What a check of `lineloom doctor` finds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["ok", "note", "wrong"]


@dataclass(frozen=True, slots=True)
class Finding:
    """check: what was looked at. advice: what to do, where something is to be done."""

    check: str
    verdict: Verdict
    found: str
    advice: str = ""


def ok(check: str, found: str) -> Finding:
    """It is as it should be."""
    return Finding(check, "ok", found)


def noted(check: str, found: str, advice: str = "") -> Finding:
    """Good to know; nothing fails by it."""
    return Finding(check, "note", found, advice)


def wrong(check: str, found: str, advice: str) -> Finding:
    """This has to be mended."""
    return Finding(check, "wrong", found, advice)
