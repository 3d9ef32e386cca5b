"""What a run looks like: one `Picture`, drawn as a rerun recording and as a printed page."""
