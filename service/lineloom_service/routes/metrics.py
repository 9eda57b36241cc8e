"""Figures for Prometheus."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Header, Response
from prometheus_client.exposition import choose_encoder

from lineloom_service.dependencies import ServiceDep
from lineloom_service.openapi import also_as

router = APIRouter(tags=["status"])


@router.get("/metrics", response_class=Response, responses=also_as("text/plain"))
async def get_metrics(
    service: ServiceDep, accept: Annotated[str | None, Header()] = None
) -> Response:
    """Return what was counted and measured so far, as Prometheus reads it."""
    await service.look_around()
    encode, media_type = choose_encoder(accept or "")
    return Response(encode(service.metrics.registry), headers={"Content-Type": media_type})
