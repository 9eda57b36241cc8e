"""The HTTP contract, one file a noun."""

from fastapi import APIRouter

from lineloom_service.routes import (
    constraints,
    events,
    graph,
    ingest,
    maps,
    match,
    robots,
    sites,
    status,
    trajectory,
    transforms,
)

ROUTERS: tuple[APIRouter, ...] = (
    ingest.router,
    sites.router,
    robots.router,
    trajectory.router,
    transforms.router,
    maps.router,
    graph.router,
    constraints.router,
    events.router,
    match.router,
    status.router,
)
"""All routers, in the order of the documentation."""
