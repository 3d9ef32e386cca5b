"""The files of the page, read once: a request names an entry of this table, never a path."""

import hashlib
from dataclasses import dataclass
from importlib.resources import files

_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mjs": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".mp4": "video/mp4",
    ".txt": "text/plain; charset=utf-8",
}


@dataclass(frozen=True, slots=True)
class Asset:
    """One file with its media type and the digest of its content."""

    media_type: str
    content: bytes
    etag: str


def assets(*, with_map: bool = False) -> dict[str, Asset]:
    """Every file of this folder by its name, and the programs of the map if it is shown.

    `make page-map` puts those into the folder `map`; the plan has a plain grid without them.
    """
    here = files(__package__)
    folders = [here, here / "map"] if with_map else [here]
    found = {}
    for file in (file for folder in folders if folder.is_dir() for file in folder.iterdir()):
        media_type = _TYPES.get(f".{file.name.rpartition('.')[2]}")
        if media_type and file.is_file():
            content = file.read_bytes()
            digest = hashlib.sha256(content).hexdigest()[:32]
            found[file.name] = Asset(media_type, content, f'"{digest}"')
    return found
