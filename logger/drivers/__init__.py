"""What devices say: bytes and text in, values out; nothing here opens, waits or reads a clock."""
