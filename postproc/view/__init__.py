"""A run in the rerun viewer: what is told of it, drawn on sheets of a recording, and the programs
that show it.
"""
