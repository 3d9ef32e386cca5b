"""A port whose loss is told late: what has come of a reply by then is read like any other."""

from logger.core.errors import DeviceError
from logger.device.link import Link


class Wire:
    """Reads and writes a link until it is lost or stopped; `heard_ns` is when it last gave a
    chunk.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._lost: DeviceError | None = None
        self.heard_ns = 0

    @property
    def is_over(self) -> bool:
        """True when nothing more can be heard."""
        return self._lost is not None or self._link.stop.is_set()

    def read(self) -> bytes:
        """The next chunk, empty after a silence and for ever after a loss."""
        if self._lost is None:
            try:
                self.heard_ns, data = self._link.read()
            except DeviceError as error:
                self._lost = error
            else:
                return data
        return b""

    def write(self, data: bytes) -> None:
        """Write all; nothing after a loss."""
        if self._lost is None:
            try:
                self._link.write(data)
            except DeviceError as error:
                self._lost = error

    def tell_loss(self) -> None:
        """Raise the `DeviceError` of a loss."""
        if self._lost is not None:
            raise self._lost
