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
    """Create or upgrade the tables. Raises StoreError where a newer version wrote the database."""
    config = _config(connection)
    try:
        command.upgrade(config, revision)
    except CommandError as error:
        newest = ScriptDirectory.from_config(config).get_current_head()
        raise StoreError(
            "the database was written by a newer version of Lineloom "
            f"(this one knows revision {newest}): {error}"
        ) from error


def outdated(connection: Connection) -> str | None:
    """Return the revision of a database that `migrate` would upgrade; None where it is new."""
    script = ScriptDirectory.from_config(_config(connection))
    current = MigrationContext.configure(connection).get_current_revision()
    known = {step.revision for step in script.walk_revisions()}
    return current if current in known - {script.get_current_head()} else None


def downgrade(connection: Connection, revision: str) -> None:
    """Go back to an older revision; what it has no place for is lost."""
    command.downgrade(_config(connection), revision)


def _config(connection: Connection) -> Config:
    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations"))
    config.attributes["connection"] = connection
    return config
