"""Which cells of runs are suspicious, and why: `postproc suspect`."""
