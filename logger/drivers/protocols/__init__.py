"""Wire protocols: bytes of a modem, a receiver or gpsd in, events out."""
