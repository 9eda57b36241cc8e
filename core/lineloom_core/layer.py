"""What a line of the map is (see `fusion.layers`)."""

from __future__ import annotations

from typing import Literal

Layer = Literal["wall", "furniture", "clutter"]
