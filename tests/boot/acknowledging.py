"""`fieldlogger` that also prints which records are durable; it runs inside the image."""

import sys

from logger.cli import main
from logger.core.runfile import RunWriter

sync = RunWriter.sync


def acknowledged_sync(writer):
    records = writer._seq
    sync(writer)
    print(f"synced {writer.path.stem} {records}", flush=True)


RunWriter.sync = acknowledged_sync
sys.exit(main())
