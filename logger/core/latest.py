"""A dict with bounded memory."""

from typing import TypeVar

T = TypeVar("T")


class Latest(dict[str, T]):
    """The entries put last, in the order of their time, at most `most` of them."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most

    def put(self, key: str, value: T) -> None:
        """Set an entry; if there are too many, the one set longest ago gives way."""
        self.pop(key, None)
        self[key] = value
        if len(self) > self._most:
            del self[next(iter(self))]
