"""The secret in the page's address, and the address as a QR code."""

import hmac
import os
import re
import secrets
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from logger.core.errors import ConfigError
from logger.core.foreign import read_regular
from logger.core.runfile.journal import write_durably

STATE = Path("/var/lib/cellwalk-page")
"""StateDirectory= of the unit."""
_FILE = "token"
_TOKEN = re.compile(r"[\w-]{16,64}", re.ASCII)
_MOST_BYTES = 1024
_BYTES = 16
"""128 bits: nobody guesses them at any rate."""


def make_token(folder: Path) -> str:
    """The token, a new one where that is damaged; raises `ConfigError`."""
    path = folder / _FILE
    with suppress(ConfigError):
        return read_token(folder)
    try:
        path.with_suffix(".part").unlink(missing_ok=True)  # perhaps others may read it
        # a Pi may lose its power as soon as the phone has the address
        write_durably(path, secrets.token_urlsafe(_BYTES).encode(), 0o600)
    except OSError as error:
        start = "sudo systemctl start fieldlogger-page, or set STATE_DIRECTORY to a folder"
        raise ConfigError(f"the page's token {path}: {error.strerror}; {start}") from error
    return read_token(folder)


def read_token(folder: Path) -> str:
    """The token that the page has made; raises `ConfigError` without one."""
    path = folder / _FILE
    try:
        token = read_regular(path, _MOST_BYTES, follow_links=False).decode("ascii").strip()
    except FileNotFoundError:
        start = "start it with: sudo systemctl restart fieldlogger-page"
        raise ConfigError(f"the page has never been on; {start}") from None
    except PermissionError:
        raise ConfigError(f"{path} belongs to the page: use sudo") from None
    except (OSError, UnicodeDecodeError):
        token = ""
    if not _TOKEN.fullmatch(token):
        raise ConfigError(f"{path} is damaged: sudo systemctl restart fieldlogger-page")
    return token


def is_token(given: str, token: str) -> bool:
    """Compare in a time that tells nothing of the token."""
    return hmac.compare_digest(given.encode(), token.encode())


def state_folder(environ: Mapping[str, str] = os.environ) -> Path:
    """Where the token is."""
    return Path(environ.get("STATE_DIRECTORY", STATE))


def page_url(listen: str, folder: Path) -> str:
    """The complete address; raises `ConfigError` where the page is off or has never been on."""
    if not listen:
        raise ConfigError('the page is off: set [page] listen = "10.42.0.1:8080" in site.toml')
    return f"http://{listen}/{read_token(folder)}/"


def qr_code(address: str) -> str:
    """The address as a QR code of characters, for a terminal with a dark background."""
    import segno  # noqa: PLC0415  only `--show` needs it

    rows = [[*row] for row in segno.make(address, error="m").matrix_iter(border=3)]
    if len(rows) % 2:
        rows.append([0] * len(rows[0]))
    pairs = zip(rows[::2], rows[1::2], strict=True)
    return "\n".join("".join(map(_half_blocks, *pair)) for pair in pairs)


def _half_blocks(top: int, bottom: int) -> str:
    """Two modules above each other, so that the code is square; the light ones are drawn."""
    if top:
        return " " if bottom else "▄"
    return "▀" if bottom else "█"
