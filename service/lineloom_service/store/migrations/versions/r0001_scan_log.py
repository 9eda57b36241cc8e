"""The scan log: sites, robots, their sessions, and what was accepted in which order."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

_ID = sa.BigInteger().with_variant(sa.Integer, "sqlite")


def upgrade() -> None:
    """Create the log."""
    _create_sites()
    _create_robots()
    op.create_table(
        "streams",
        sa.Column("id", _ID, primary_key=True),
        sa.Column("robot_id", _ID, sa.ForeignKey("robots.id"), nullable=False),
        sa.Column("session", sa.String(128), nullable=False),
        sa.Column("released", sa.BigInteger),
        sa.Column("highest", sa.BigInteger, nullable=False, server_default=sa.text("-1")),
        sa.Column("accepted", sa.BigInteger, nullable=False, server_default=sa.text("0")),
        sa.UniqueConstraint("robot_id", "session", name="ux_streams_robot_session"),
    )
    _create_entries()


def downgrade() -> None:
    """Remove the log and all that was accepted."""
    for table in ("entries", "streams", "robots", "sites"):
        op.drop_table(table)


def _create_sites() -> None:
    op.create_table(
        "sites",
        sa.Column("id", _ID, primary_key=True),
        sa.Column("name", sa.String(64), nullable=False),
        sa.Column("position", sa.BigInteger, nullable=False, server_default=sa.text("0")),
        sa.Column("deleted", sa.Boolean, nullable=False, server_default=sa.false()),
        sqlite_autoincrement=True,
    )
    op.create_index(
        "ux_sites_name",
        "sites",
        ["name"],
        unique=True,
        sqlite_where=sa.text("deleted = 0"),
        postgresql_where=sa.text("NOT deleted"),
    )


def _create_robots() -> None:
    op.create_table(
        "robots",
        sa.Column("id", _ID, primary_key=True),
        sa.Column("site_id", _ID, sa.ForeignKey("sites.id"), nullable=False),
        sa.Column("name", sa.String(64), nullable=False),
        sa.Column("mount", sa.LargeBinary),
        sa.Column("forgotten", sa.Boolean, nullable=False, server_default=sa.false()),
    )
    op.create_index(
        "ux_robots_site_name",
        "robots",
        ["site_id", "name"],
        unique=True,
        sqlite_where=sa.text("forgotten = 0"),
        postgresql_where=sa.text("NOT forgotten"),
    )


def _create_entries() -> None:
    op.create_table(
        "entries",
        sa.Column("id", _ID, primary_key=True),
        sa.Column("site_id", _ID, sa.ForeignKey("sites.id"), nullable=False),
        sa.Column("robot_id", _ID, sa.ForeignKey("robots.id"), nullable=False),
        sa.Column("kind", sa.String(8), nullable=False),
        sa.Column("stream_id", _ID, sa.ForeignKey("streams.id")),
        sa.Column("seq", sa.BigInteger),
        sa.Column("body", sa.LargeBinary),
        sa.Column("position", sa.BigInteger),
        sa.UniqueConstraint("stream_id", "seq", name="ux_entries_stream_seq"),
        sa.UniqueConstraint("site_id", "position", name="ux_entries_site_position"),
    )
    op.create_index(
        "ix_entries_held",
        "entries",
        ["site_id"],
        sqlite_where=sa.text("position IS NULL"),
        postgresql_where=sa.text("position IS NULL"),
    )
