"""What requests and answers have in common, and the contract's limits."""

from __future__ import annotations

from typing import Annotated

from pydantic import AllowInfNan, BaseModel, ConfigDict, Field

ID_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"
"""Names of sites and robots."""

MAX_BATCH = 1000
"""Scans in one POST."""

MAX_BODY_BYTES = 16 * 1024 * 1024
"""Size of one POST, before and after decompression."""

MAX_BEAMS = 20_000
"""More beams than any 2D lidar has; a longer list is a mistake of the sender."""

MAX_COUNTER = 2**63 - 1
"""The largest `seq`: what every database holds as an integer."""

Number = Annotated[float, AllowInfNan(False)]
"""A finite number."""

Covariance = list[list[float | None]]
"""3x3 over x, y, theta; null where a direction is not known at all."""


class Request(BaseModel):
    """Something a client sends: types are taken literally, nothing is coerced."""

    model_config = ConfigDict(strict=True, extra="ignore")


class Answer(BaseModel):
    """Something the service answers."""

    model_config = ConfigDict(extra="ignore", frozen=True)


Settled = Annotated[
    bool,
    Field(
        description="Poses are the optimum of all constraints, as in every export and while the "
        "site is idle; otherwise they are within millimetres of it."
    ),
]
"""A version is shown unsettled first, and settled where nothing comes after it for a while."""

Seq = Annotated[int, Field(ge=0, le=MAX_COUNTER)]
"""A scan's number within its session."""
