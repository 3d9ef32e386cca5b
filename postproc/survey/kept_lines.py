"""Results that are kept as lines of JSON: each is durable when it is written, torn ones are not."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TypeVar

import msgspec

from logger.core.errors import RunFileError

Line = TypeVar("Line", bound=msgspec.Struct)


def append_lines(path: Path, lines: Sequence[msgspec.Struct]) -> None:
    """Add lines; raises `RunFileError` where they cannot be written."""
    text = b"".join(msgspec.json.encode(line) + b"\n" for line in lines)
    try:
        with path.open("ab") as file:
            # a torn line must not swallow the next one
            file.write(b"\n" + text if file.tell() else text)
    except OSError as error:
        raise RunFileError(
            f"cannot write {path}: {error.strerror}; what was computed before is kept"
        ) from error


def whole_lines(path: Path, kind: type[Line]) -> Iterator[Line]:
    """The lines that are whole; none where there is no file."""
    decoder = msgspec.json.Decoder(kind)
    for text in path.read_bytes().splitlines() if path.exists() else []:
        try:
            yield decoder.decode(text)
        except msgspec.MsgspecError:
            continue
