"""Messages of ROS 2 decoded by `rosbags`, by nothing but the definition that came with them."""

from functools import cache
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

NAME = "it/msg/It"


def decoded(content: bytes, definition: str) -> Any:
    """Return the message; what is not read to its last byte, but for padding to 4, is refused."""
    return _reader(definition).deserialize_cdr(content, NAME)


@cache
def _reader(definition: str) -> Any:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition, NAME))
    return store
