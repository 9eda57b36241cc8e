"""What keeps a log whole: checksums of its entries, and what was deleted on purpose."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None

_ID = sa.BigInteger().with_variant(sa.Integer, "sqlite")


def upgrade() -> None:
    """Add both; entries from before have no checksum, and are read as they are."""
    op.add_column("entries", sa.Column("crc", sa.BigInteger))
    op.create_table(
        "tombstones",
        sa.Column("id", _ID, primary_key=True),
        sa.Column("kind", sa.String(16), nullable=False),
        sa.Column("site_id", sa.BigInteger, nullable=False),
        sa.Column("name", sa.String(128), nullable=False),
        sa.Column("at", sa.Double, nullable=False),
    )


def downgrade() -> None:
    """Remove them."""
    op.drop_table("tombstones")
    op.drop_column("entries", "crc")
