"""Bring a database to the shape this version of the service needs."""

from __future__ import annotations

from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from alembic.util import CommandError
from sqlalchemy import Connection

from lineloom_service.store.records import StoreError


def migrate(connection: Connection, revision: str = "head") -> None:
    """Create or upgrade the tables, in the caller's transaction.

    Raises StoreError where a newer version wrote the database.
    """
    config = _config(connection)
    try:
        command.upgrade(config, revision)
    except CommandError as error:
        newest = ScriptDirectory.from_config(config).get_current_head()
        raise StoreError(
            "the database was written by a newer version of Lineloom "
            f"(this one knows revision {newest}): {error}"
        ) from error


def current_revision(connection: Connection) -> str | None:
    """Return the revision of a database; None where it is new, or its making was not finished."""
    return MigrationContext.configure(connection).get_current_revision()


def is_outdated(revision: str | None) -> bool:
    """Whether `migrate` would change a database of this revision."""
    script = ScriptDirectory.from_config(_config())
    known = {step.revision for step in script.walk_revisions()}
    return revision is None or revision in known - {script.get_current_head()}


def downgrade(connection: Connection, revision: str) -> None:
    """Go back to an older revision, in the caller's transaction; what it has no room for goes."""
    command.downgrade(_config(connection), revision)


def _config(connection: Connection | None = None) -> Config:
    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations"))
    config.attributes["connection"] = connection
    return config
