"""Objects as bytes without code: msgpack of registered classes' fields by name, and plain arrays.

`decode` builds nothing but registered classes (`storable`), plain containers and arrays, and
raises `CodecError` for bytes that say anything else, whoever wrote them.
"""

from lineloom_core.codec.errors import CodecError
from lineloom_core.codec.reader import decode, inflate
from lineloom_core.codec.registry import storable
from lineloom_core.codec.writer import encode

__all__ = ["CodecError", "decode", "encode", "inflate", "storable"]
