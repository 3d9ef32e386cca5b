"""What every framer must keep: the same events however the bytes come in, and no exception."""

import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Protocol

from logger.drivers.protocols.line_noise import Garbage


class Framer(Protocol):
    def feed(self, data: bytes) -> Iterator[Any]: ...


def merge_garbage(events: Iterable[Any]) -> list[Any]:
    """Events with neighbouring Garbage joined, since noise is reported as it comes."""
    result: list[Any] = []
    for event in events:
        if isinstance(event, Garbage) and result and isinstance(result[-1], Garbage):
            result[-1] = Garbage(result[-1].data + event.data)
        else:
            result.append(event)
    return result


def feed_all(framer: Framer, chunks: Iterable[bytes]) -> list[Any]:
    return merge_garbage(event for chunk in chunks for event in framer.feed(chunk))


def split_at(data: bytes, sizes: Sequence[int]) -> list[bytes]:
    """Pieces of these sizes and a last piece with the rest."""
    chunks, start = [], 0
    for size in sizes:
        chunks.append(data[start : start + size])
        start += size
    return [*chunks, data[start:]]


def check_framer(
    make: Callable[[], Framer], data: bytes, expected: Iterable[Any], trailing: bytes
) -> None:
    """Feed `data` whole, byte by byte, in random chunks, and followed by `trailing`.

    `trailing` is an incomplete piece of input, which must stay in the framer without any event.
    """
    wanted = merge_garbage(expected)
    sizes = random.Random(data)
    ways = {
        "whole": [data],
        "byte by byte": [data[i : i + 1] for i in range(len(data))],
        "with nothing in between": [b"", data, b""],
        "with trailing bytes": [data + trailing],
        "with trailing bytes one by one": [
            data,
            *(trailing[i : i + 1] for i in range(len(trailing))),
        ],
    }
    for n in range(5):
        ways[f"random chunks {n}"] = split_at(
            data, [sizes.randrange(1, 40) for _ in range(len(data) // 10)]
        )
    for way, chunks in ways.items():
        assert feed_all(make(), chunks) == wanted, way
