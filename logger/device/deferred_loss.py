"""A port whose loss is raised late, so that the reply received until then is still read."""

from logger.core.errors import DeviceError
from logger.device.link import Link


class Wire:
    """Reads and writes a link until it is lost or stopped.

    `received_ns` is the time of the last chunk. None of its bytes came before `since_ns`: on a busy
    machine some time passes until a chunk is read.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._loss: DeviceError | None = None
        self.received_ns = 0
        self.has_heard = False
        self.since_ns = self._asked_ns = link.clock.now_ns()

    @property
    def is_over(self) -> bool:
        """Whether nothing more can be received."""
        return self._loss is not None or self._link.stop.is_set()

    def read(self) -> bytes:
        """Read the next chunk; empty after a silence, and always after a loss."""
        self.has_heard = False
        if self._loss is None:
            # what this read returns was not there yet when the last one began
            self.since_ns, self._asked_ns = self._asked_ns, self._link.clock.now_ns()
            try:
                self.received_ns, data = self._link.read()
            except DeviceError as error:
                self._loss = error
            else:
                self.has_heard = self._link.has_heard
                return data
        return b""

    def write(self, data: bytes) -> None:
        """Write all data; nothing after a loss."""
        if self._loss is None:
            try:
                self._link.write(data)
            except DeviceError as error:
                self._loss = error

    def raise_loss(self) -> None:
        """Raise the `DeviceError` of a loss."""
        if self._loss is not None:
            raise self._loss
