"""Values as JSON text."""

from typing import Any

import msgspec
import numpy as np

Json = dict[str, Any]


def as_json(value: Any) -> str:
    """JSON text; NaN and infinity become null."""
    return msgspec.json.format(msgspec.json.encode(value, enc_hook=_plain), indent=2).decode()


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"no JSON for {type(value).__name__}")
