"""How much a run file may unpack to: a file of some megabytes that claims gigabytes is no walk.

Honest files, packed, hold 4 to 5 times their size, 35 times where all levels are the same, and 90
times in a simulated run without raw bytes, most of whose columns are unknown.
"""

_MB = 1 << 20


def most_memory_bytes(file_bytes: int) -> int:
    """Of tables, or of raw bytes, that are held in memory at once."""
    return 64 * _MB + 120 * file_bytes


def most_unpacked_bytes(file_bytes: int) -> int:
    """Limit of all unpacked blocks of a file together.

    A port that is stuck for a day gives 1 GB of zeros, which pack to 1 MB.
    """
    return 1024 * _MB + 100 * file_bytes


def most_cpu_s(file_bytes: int) -> int:
    """Of reading; a Raspberry Pi reads an honest file twenty times faster."""
    return 4 + round(0.4 * file_bytes / 1e6)
