"""Where a cell stands, by every method: pure functions, arrays in, values out; nothing is drawn or
stored here.
"""
