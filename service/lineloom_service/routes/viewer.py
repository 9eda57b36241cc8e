"""The live viewer: a page and its static files, shipped with the service."""

from __future__ import annotations

from pathlib import Path

from fastapi import APIRouter, FastAPI, Response
from fastapi.responses import FileResponse
from fastapi.staticfiles import StaticFiles
from starlette.types import Scope

FOLDER = Path(__file__).parents[1] / "viewer"
"""Where the files lie: package data of the wheel."""

_FRESH = {"Cache-Control": "no-cache"}
"""Ask each time whether the file has changed: a new service must not meet an old page."""

router = APIRouter(include_in_schema=False)


@router.get("/")
async def get_viewer() -> FileResponse:
    """Return the page. It holds no data of any site, and so needs no token."""
    return FileResponse(FOLDER / "index.html", media_type="text/html", headers=_FRESH)


class _Files(StaticFiles):
    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        response.headers.update(_FRESH)
        return response


def mount(app: FastAPI) -> None:
    """Serve what the page loads."""
    app.mount("/viewer", _Files(directory=FOLDER), name="viewer")
