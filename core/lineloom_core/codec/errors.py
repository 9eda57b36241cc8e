"""The one error of the codec."""

from __future__ import annotations


class CodecError(ValueError):
    """Bytes that are none of ours, or an object that is not to be stored; names class and field."""
