"""The file of a picture: its format by its suffix."""

from pathlib import Path

from logger.core.errors import ConfigError
from postproc.atomic_write import check_output


def kind_of(path: Path) -> str:
    """Format by the suffix, PNG without one; raises `ConfigError`."""
    from matplotlib.backend_bases import FigureCanvasBase  # noqa: PLC0415 (heavy)

    kind, known = path.suffix[1:].lower() or "png", FigureCanvasBase.filetypes
    if kind not in known:
        raise ConfigError(
            f"{path}: a picture ends in {', '.join('.' + name for name in sorted(known))}"
        )
    return kind


def check_picture(path: Path) -> None:
    """Check that a picture can be written, before it is drawn.

    Raises `ConfigError` or `RunFileError`.
    """
    kind_of(path)
    check_output(path)
