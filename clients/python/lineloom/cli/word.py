"""Choices of an option that are their own words, on Pythons before `enum.StrEnum` as well."""

from __future__ import annotations

from enum import Enum


class Word(str, Enum):
    """A choice; its text is its value."""

    __str__ = str.__str__
