"""A run in the rerun viewer: the view model, its recording, and the programs that show it."""
