"""Two walks over the same ground: which cells are new, gone, moved, stronger or weaker."""
