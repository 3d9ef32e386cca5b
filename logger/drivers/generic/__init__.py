"""The driver of every other modem."""
