"""The history that snapshots go on from, in chapters that are kept once."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None

_ID = sa.BigInteger().with_variant(sa.Integer, "sqlite")


def upgrade() -> None:
    """Add the table; snapshots from before go on from nothing."""
    op.add_column(
        "snapshots",
        sa.Column("chapters", sa.BigInteger, nullable=False, server_default=sa.text("0")),
    )
    op.create_table(
        "chapters",
        sa.Column("site_id", _ID, sa.ForeignKey("sites.id"), primary_key=True, autoincrement=False),
        sa.Column("producer", sa.String(128), primary_key=True),
        sa.Column("number", sa.BigInteger, primary_key=True, autoincrement=False),
        sa.Column("crc", sa.BigInteger, nullable=False),
        sa.Column("data", sa.LargeBinary, nullable=False),
    )


def downgrade() -> None:
    """Remove it, and the snapshots that are nothing without: the log has it all."""
    op.execute("DELETE FROM snapshots WHERE chapters > 0")
    op.drop_table("chapters")
    op.drop_column("snapshots", "chapters")
