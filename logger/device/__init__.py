"""The program on the Pi: the only package that opens ports, waits, reads clocks, gets signals."""
