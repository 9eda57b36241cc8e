"""What joining did."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ComponentMerged:
    """`absorbed` became part of `survivor` because of the constraints named."""

    survivor: str
    absorbed: str
    constraints: tuple[str, ...]
