"""pyserial's port as the logger opens it: bytes received before the opening are not discarded."""

import serial


class UnflushedSerial(serial.Serial):
    """A port that is not flushed when it is opened."""

    def _reset_input_buffer(self) -> None:
        """Keep it."""
