"""Position of a cell by every method: pure functions of arrays, without drawing or files."""
