"""What is made once of things that stay the same from frame to frame, such as the maps at rest."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")


class IdentityCache:
    """Remembers, by name, what was made last and of what. Arrays that may be written into are made of anew."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self._made: dict[str, tuple[tuple[object, ...], Any]] = {}

    def of(self, name: str, sources: tuple[object, ...], make: Callable[[], T]) -> T:
        """Return what `make` gives; what it gave before where all `sources` are the same objects as then.

        A source is an array, or a value that never changes.
        """
        if any(isinstance(source, np.ndarray) and source.flags.writeable for source in sources):
            self._made.pop(name, None)  # it would keep their memory
            return make()
        known = self._made.get(name)
        if known is None or any(source is not before for source, before in zip(sources, known[0], strict=True)):
            known = self._made[name] = sources, make()
        made: T = known[1]
        return made
