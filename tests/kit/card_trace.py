"""The system calls that a traced recorder made on its card, and their replay in another folder."""

import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_HEADER = struct.Struct("@12sIIQ")
"""Name, length of the path, length and offset of the data, as faulty_card.c writes them."""


@dataclass(frozen=True)
class Operation:
    """One system call of a trace."""

    name: str
    path: Path
    offset: int
    data: bytes


def read_trace(path: Path) -> list[Operation]:
    """System calls on the card, in order."""
    data, start, operations = path.read_bytes(), 0, []
    while start < len(data):
        name, path_length, length, offset = _HEADER.unpack_from(data, start)
        start += _HEADER.size
        target = Path(data[start : start + path_length].decode())
        start += path_length
        name = name.rstrip(b"\0").decode()
        written = data[start : start + length] if name == "pwrite" else b""
        start += len(written)
        operations.append(Operation(name, target, offset, written))
    return operations


def replay(operation: Operation, folder: Path) -> Iterator[None]:
    """Repeat a call in another folder; yields after each state that a cut may leave."""
    path = folder / operation.path.name
    match operation.name:
        case "create":
            path.touch(exist_ok=False)
        case "pwrite":
            half = len(operation.data) // 2
            for start, end in ((0, half), (half, None)):
                with path.open("r+b") as file:
                    file.seek(operation.offset + start)
                    file.write(operation.data[start:end])
                yield
            return
        case "ftruncate":
            os.truncate(path, operation.offset)
    yield
