"""Qualcomm's diagnostic stream: frames, levels and identities."""
