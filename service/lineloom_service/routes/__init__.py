"""The HTTP contract, one file a noun."""

from fastapi import APIRouter
from fastapi.routing import APIRoute

from lineloom_service.routes import (
    config,
    constraints,
    docs,
    events,
    exports,
    floorplan,
    graph,
    ingest,
    joins,
    localize,
    maps,
    match,
    metrics,
    robots,
    sites,
    status,
    trajectory,
    transforms,
    viewer,
)

ROUTERS: tuple[APIRouter, ...] = (
    ingest.router,
    sites.router,
    config.router,
    robots.router,
    trajectory.router,
    transforms.router,
    maps.router,
    exports.router,
    floorplan.router,
    graph.router,
    constraints.router,
    joins.router,
    events.router,
    localize.router,
    match.router,
    metrics.router,
)
"""What takes a token, where there are tokens; in the order of the documentation."""

OPEN_ROUTERS: tuple[APIRouter, ...] = (status.router, docs.router, viewer.router)
"""What never does: it says nothing about any site."""


def allowed_methods(path: str) -> list[str]:
    """Return the methods that an address answers to: one route has one of them only.

    Where a path also reads as another's, with a name in it, it is the one with fewer names.
    """
    routes = [route for router in (*ROUTERS, *OPEN_ROUTERS) for route in router.routes]
    matching = [r for r in routes if isinstance(r, APIRoute) and r.path_regex.match(path)]
    names = min((len(route.param_convertors) for route in matching), default=0)
    return sorted(
        method
        for route in matching
        if len(route.param_convertors) == names
        for method in route.methods or ()
    )
