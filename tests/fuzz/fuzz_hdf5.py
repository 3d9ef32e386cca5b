"""HDF5 runs changed in their structure: `python fuzz_hdf5.py -max_total_time=3600 [-seed=1]`.

A change is one that h5py makes (types, shapes, chunks, filters, links, attributes, values, texts)
or some bytes of the file. Each file must be read or refused by `RunFileError`, within limits of
time and memory; and where every check of `info --verify` holds, all that h5py sees must be what was
recorded."""

import os
import random
import resource
import shutil
import sys
import time
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import h5py
import numpy as np

from logger.core.errors import RunFileError
from logger.core.runfile import convert_journal
from postproc.info import describe, verify
from tests.kit import hostile_runs, runs

MOST_S, MOST_MB = 8.0, 512
MOST_COPIED = 1 << 26
"""Bytes of a table that is read and written again.

What this process takes counts for those it starts.
"""
DTYPES = [
    "f8",
    "<i4",
    ">i8",
    "S7",
    "u1",
    "V8",
    h5py.string_dtype(),
    h5py.ref_dtype,
    [("a", "f8"), ("b", "S3")],
    "?",
    "c16",
]
TEXTS = [b"", b"null", b"{}", b"[]", b"\xff", b"[" * 9999, b'{"schema":3}', b"1e999", b'"x"']
VALUES = [0, 1, -1, 2**31 - 1, -(2**31), 2**62, 2**63 - 1, -(2**63)]
FLOATS = [np.nan, np.inf, -np.inf, 1e308, -1e-308, 0.0]
MAKINGS: list[dict[str, Any]] = [
    {},
    {"chunks": (1,)},
    {"chunks": (7,), "compression": "gzip"},
    {"chunks": (1 << 16,), "fletcher32": True, "shuffle": True},
    {"chunks": (64,), "compression": "lzf"},
    {"chunks": (64,), "scaleoffset": 0},
]


def change(file: h5py.File, secret: Path, rng: random.Random) -> None:
    """One change; what h5py refuses to make is none."""
    name = rng.choice(sorted(file))
    node = file[name]
    known = [*hostile_runs.ELSEWHERE.values(), *(made for made, _ in hostile_runs.ALTERED.values())]
    match rng.randrange(9):
        case 0:
            rng.choice(known)(file, secret)
        case 1:
            shape = rng.choice([(), (0,), (3,), (2, 2), (10**6,), (10**12,)])
            hostile_runs.replace_dataset(
                file, name, shape=shape, dtype=rng.choice(DTYPES), **rng.choice(MAKINGS)
            )
        case 2 if node.nbytes < MOST_COPIED:
            hostile_runs.replace_dataset(
                file, name, data=node[()], **rng.choice(MAKINGS), maxshape=(None,)
            )
        case 3:
            node.resize((rng.choice([0, 1, len(node) // 2, len(node) + 1, 10**9]),))
        case 4:
            holder = rng.choice([file, node])
            what = rng.choice([*holder.attrs, "more"])
            holder.attrs[what] = rng.choice(
                ["x", 7, 1.5, np.arange(9), b"\xff", "0" * 9999, h5py.Empty("f8"), [b"a"]]
            )
        case 5 | 6 if node.nbytes < MOST_COPIED:
            change_rows(node, rng)
        case 7:
            del file[name]
            file[name] = np.bytes_(rng.choice(TEXTS))
        case 8:
            text = bytearray(bytes(file["meta"][()]))
            at = rng.randrange(len(text))
            text[at : at + rng.randrange(3)] = rng.choice(
                [b"", b"9", b"-", b'"', b"null", b"[", b"1e9"]
            )
            del file["meta"]
            file["meta"] = np.bytes_(bytes(text))


def change_rows(node: h5py.Dataset, rng: random.Random) -> None:
    rows = node[...]
    column = rng.choice(rows.dtype.names)
    kind = rows.dtype[column].kind
    value = rng.choice(FLOATS if kind == "f" else VALUES) if kind != "S" else rng.randbytes(9)
    some = slice(rng.randrange(len(rows)), None if rng.randrange(2) else len(rows))
    if kind in "iu":
        value = np.array([value], "i8").astype(rows.dtype[column])[0]
    rows[column][some] = value
    node[...] = rows


def spoil(path: Path, rng: random.Random) -> None:
    """Some bytes, mostly of the structure, which begins with words of four letters."""
    data = bytearray(path.read_bytes())
    spots = [at for word in (b"TREE", b"SNOD", b"HEAP") for at in _all(data, word)]
    for _ in range(rng.choice([1, 1, 2, 4])):
        at = min(rng.choice([0, *spots]) + rng.randrange(600), len(data) - 8)
        data[at : at + 8] = rng.choice(
            [b"\xff" * 8, bytes(8), rng.randbytes(8), rng.choice(spots).to_bytes(8, "little")]
        )
    path.write_bytes(data)


def _all(data: bytearray, word: bytes) -> list[int]:
    found, at = [], data.find(word)
    while at >= 0:
        found.append(at)
        at = data.find(word, at + 1)
    return found


def content_of(path: Path) -> dict[str, object]:
    """All that a reader sees."""
    found: dict[str, object] = {}
    with h5py.File(path) as file:
        found |= {f"@{name}": repr(value) for name, value in file.attrs.items()}
        for name in file:
            node = file[name]
            found[name] = (
                (node.dtype.descr, node.shape, node[()].tobytes())
                if isinstance(node, h5py.Dataset)
                else "group"
            )
            found |= {f"{name}@{key}": repr(value) for key, value in node.attrs.items()}
    return found


def check(path: Path, honest: dict[str, object]) -> str:
    """What became of a file; raises where it was not refused properly."""
    from logger.core.runfile import read_run, read_sound_run

    begun_s = time.process_time()
    try:
        read_run(path)
        describe(read_sound_run(path))
        checks = verify(path)
    except RunFileError:
        return "refused"
    finally:
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert time.process_time() - begun_s < MOST_S, "too slow"
        assert usage.ru_maxrss / 1024 < MOST_MB, "too much memory"
    if not all(one.holds for one in checks):
        return "read, not verified"
    assert content_of(path) == honest, "verified, though something is not as it was recorded"
    return "verified"


def main(most_s: float, seed: int) -> int:
    rng, counts, n = random.Random(seed), dict[str, int](), 0
    with TemporaryDirectory(prefix="fuzz-hdf5-") as name:
        folder = Path(name)
        runs.write_journal(folder / "a.journal", runs.records(40), config_text="[run]\n")
        convert_journal(folder / "a.journal", folder / "a.h5")
        honest, secret = content_of(folder / "a.h5"), folder / "secret"
        secret.write_bytes(hostile_runs.SECRET)
        end_s = time.monotonic() + most_s
        while time.monotonic() < end_s:
            path, n = folder / "m.h5", n + 1
            shutil.copy(folder / "a.h5", path)
            if rng.randrange(3):
                with suppress(Exception), h5py.File(path, "r+") as file:
                    for _ in range(rng.choice([1, 1, 2, 3])):
                        change(file, secret, rng)
            else:
                spoil(path, rng)
            try:
                what = check(path, honest)
            except BaseException:
                shutil.copy(path, f"crash-{seed}-{n}.h5")
                print(f"after {n} files: crash-{seed}-{n}.h5", file=sys.stderr)
                raise
            counts[what] = counts.get(what, 0) + 1
    print(f"{n} files in {most_s:.0f} s: {counts}")
    return 0


if __name__ == "__main__":
    os.environ.setdefault("HDF5_USE_FILE_LOCKING", "FALSE")
    options = dict(argument.lstrip("-").partition("=")[::2] for argument in sys.argv[1:])
    sys.exit(
        main(
            float(options.get("max_total_time", 3600)),
            int(options.get("seed", time.time_ns() % 10**6)),
        )
    )
