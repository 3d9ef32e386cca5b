"""Whether the libraries of a survey are installed; nothing else of the product needs them."""

from importlib.util import find_spec

from logger.core.errors import ConfigError


def check_libraries(*names: str) -> None:
    """Raise `ConfigError`, with what to install, where a library is missing."""
    missing = [name for name in names if find_spec(name) is None]
    if missing:
        raise ConfigError(f"{missing[0]} is missing: pip install 'cellwalk[survey]'")
