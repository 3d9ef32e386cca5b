"""Redaction of personal numbers and messages, on the bytes of every port."""
