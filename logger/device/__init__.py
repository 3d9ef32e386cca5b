"""What the Pi does: the only folder that opens ports, waits, tells the time and hears signals."""
