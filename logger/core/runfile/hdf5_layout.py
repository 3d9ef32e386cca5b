"""Names in a run's HDF5 file, for those who need no HDF5 themselves."""

import numpy as np

FORMAT = "cellwalk run"
RAW_BYTES = "raw_bytes"
FRAMES = "frames"
FRAME_DTYPE = np.dtype(
    [("number", "<u4"), ("kind", "|u1"), ("table", "S16"), ("n_rows", "<u4"), ("crc32", "<u4")]
)
"""One row for each frame of the journal; the CRC-32 of its payload shows which rows changed."""
