"""Snapshots of a site's mapper, and entries it is never fed again."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

_ID = sa.BigInteger().with_variant(sa.Integer, "sqlite")


def upgrade() -> None:
    """Add both; a log without them replays from its start."""
    op.create_table(
        "skips",
        sa.Column("site_id", _ID, sa.ForeignKey("sites.id"), primary_key=True, autoincrement=False),
        sa.Column("position", sa.BigInteger, primary_key=True, autoincrement=False),
        sa.Column("reason", sa.String, nullable=False),
    )
    op.create_table(
        "snapshots",
        sa.Column("site_id", _ID, sa.ForeignKey("sites.id"), primary_key=True, autoincrement=False),
        sa.Column("position", sa.BigInteger, primary_key=True, autoincrement=False),
        sa.Column("scans", sa.BigInteger, nullable=False),
        sa.Column("producer", sa.String(128), nullable=False),
        sa.Column("data", sa.LargeBinary, nullable=False),
    )


def downgrade() -> None:
    """Remove both."""
    op.drop_table("snapshots")
    op.drop_table("skips")
