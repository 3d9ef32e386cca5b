"""pyserial's port as the logger opens it: what came before the opening is kept."""

import serial


class UnflushedSerial(serial.Serial):
    """A port that is not flushed when it is opened."""

    def _reset_input_buffer(self) -> None:
        """Keep it."""
