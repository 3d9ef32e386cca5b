"""Wire protocols: bytes of a device in, events out; and what of them is personal, masked."""
