"""HDF5 runs that no recorder writes: each is a named change of a genuine run."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

SECRET = b"a secret of this machine"

Change = Callable[[h5py.File, Path], None]
"""Changes an open run; the path is that of a file beside it that contains `SECRET`."""


def replace_dataset(file: h5py.File, name: str, **made) -> h5py.Dataset:
    del file[name]
    return file.create_dataset(name, **made)


def pack_rows(file: h5py.File, name: str, n_rows: int, chunk: int, dtype) -> None:
    """Many rows of zeros, which need almost no space in the file."""
    dataset = replace_dataset(
        file,
        name,
        shape=(n_rows,),
        dtype=dtype,
        chunks=(chunk,),
        compression="gzip",
        maxshape=(None,),
    )
    for at in range(0, n_rows, chunk):
        dataset[at : at + chunk] = np.zeros(min(chunk, n_rows - at), dtype)


def _virtual(file: h5py.File, secret: Path) -> None:
    with h5py.File(secret.with_suffix(".other"), "w") as other:
        other["bytes"] = np.frombuffer(SECRET, "u1")
    layout = h5py.VirtualLayout(shape=(len(SECRET),), dtype="u1")
    layout[:] = h5py.VirtualSource(secret.with_suffix(".other"), "bytes", shape=(len(SECRET),))
    del file["raw_bytes"]
    file.create_virtual_dataset("raw_bytes", layout)


def _link(file: h5py.File, name: str, link: object) -> None:
    if name in file:
        del file[name]
    file[name] = link


def _group(file: h5py.File, _: Path) -> None:
    del file["fixes"]
    file.create_group("fixes")


def _text(file: h5py.File, name: str, text: bytes) -> None:
    del file[name]
    file[name] = np.bytes_(text)


def _big_endian(file: h5py.File, _: Path) -> None:
    rows = file["fixes"][...]
    other = [(name, rows.dtype[name].newbyteorder(">")) for name in rows.dtype.names]
    replace_dataset(file, "fixes", data=rows.astype(other))


def _rows(name: str) -> Callable[[h5py.File], np.dtype]:
    return lambda file: file[name].dtype


ELSEWHERE: dict[str, Change] = {
    "external storage of a text": lambda f, s: replace_dataset(
        f, "config", shape=(24,), dtype="S1", external=[(s, 0, 24)]
    ),
    "external storage of bytes": lambda f, s: replace_dataset(
        f, "raw_bytes", shape=(24,), dtype="u1", external=[(s, 0, 24)]
    ),
    "external link": lambda f, s: _link(f, "config", h5py.ExternalLink(s, "/config")),
    "external link of nothing": lambda f, _: _link(f, "x", h5py.ExternalLink("nowhere", "/x")),
    "soft link": lambda f, _: _link(f, "fixes", h5py.SoftLink("/scans")),
    "soft link of nothing": lambda f, _: _link(f, "x", h5py.SoftLink("/nowhere")),
    "virtual dataset": _virtual,
}
"""Changes that refer to other files."""

UNREADABLE: dict[str, Change] = {
    "a group for a table": _group,
    "a number for a table": lambda f, _: _link(f, "fixes", np.float64(1.0)),
    "nothing for a table": lambda f, _: _link(f, "fixes", h5py.Empty("f8")),
    "no table": lambda f, _: f.__delitem__("readings"),
    "numbers for rows": lambda f, _: replace_dataset(f, "fixes", data=np.zeros(5)),
    "objects for rows": lambda f, _: replace_dataset(
        f, "fixes", shape=(5,), dtype=h5py.string_dtype()
    ),
    "references for rows": lambda f, _: replace_dataset(
        f, "notes", shape=(5,), dtype=h5py.ref_dtype
    ),
    "rows within rows": lambda f, _: replace_dataset(
        f, "fixes", shape=(5,), dtype=[("seq", [("a", "i4")])]
    ),
    "rows in two dimensions": lambda f, _: replace_dataset(
        f, "fixes", shape=(5, 5), dtype=f["fixes"].dtype
    ),
    "numbers the other way round": _big_endian,
    "a text of any length": lambda f, _: replace_dataset(
        f, "meta", data="{}", dtype=h5py.string_dtype()
    ),
    "no JSON": lambda f, _: _text(f, "meta", b"?"),
    "JSON without an end": lambda f, _: _text(f, "meta", b'{"a":' * 100_000),
    "an end that is none": lambda f, _: _text(f, "end", b"[1]"),
    "an end at no time": lambda f, _: _text(
        f, "end", b'{"t_ns":9223372036854775807,"reason":"","n_records":0}'
    ),
    "damage that is none": lambda f, _: _text(f, "damage", b"7"),
    "columns of objects": lambda f, _: _text(f, "meta", f["meta"][()].replace(b'"<f8"', b'"O"')),
    "a table that is none": lambda f, _: _text(
        f, "meta", f["meta"][()].replace(b'"notes":', b'"../../x":')
    ),
    "a filter that we do not use": lambda f, _: replace_dataset(
        f, "notes", data=f["notes"][...], compression="lzf"
    ),
    "a format of numbers": lambda f, _: f.attrs.__setitem__("format", np.arange(1000)),
    "thousands of members": lambda f, _: [f.create_group(f"g{i}") for i in range(1500)] and None,
    "10^12 rows in chunks": lambda f, _: replace_dataset(
        f, "fixes", shape=(10**12,), dtype=f["fixes"].dtype, chunks=(1024,)
    ),
    "10^12 rows": lambda f, _: replace_dataset(f, "fixes", shape=(10**12,), dtype=f["fixes"].dtype),
    "10^12 rows more": lambda f, _: f["readings"].resize((10**12,)),
    "a large chunk": lambda f, _: pack_rows(f, "raw_bytes", 1 << 25, 1 << 25, "u1"),
    "a gigabyte of rows": lambda f, _: pack_rows(
        f, "readings", 4_000_000, 16_384, f["readings"].dtype
    ),
    "more than a gigabyte of bytes": lambda f, _: replace_dataset(
        f, "raw_bytes", shape=(3 << 30,), dtype="u1", chunks=(1 << 20,), compression="gzip"
    ),
}
"""Changes that make the run unreadable."""

ALTERED: dict[str, tuple[Change, str]] = {
    "started_utc": (
        lambda f, _: f.attrs.__setitem__("started_utc", "1999-01-01T00:00:00Z"),
        "started_utc",
    ),
    "program": (lambda f, _: f.attrs.__setitem__("program", "another"), "program"),
    "run_id": (lambda f, _: f.attrs.__setitem__("run_id", "f" * 32), "run_id"),
    "stop_reason": (lambda f, _: f.attrs.__setitem__("stop_reason", "arrested"), "stop_reason"),
    "digest": (lambda f, _: f.attrs.__setitem__("digest", "0" * 64), "digest"),
    "schema": (lambda f, _: f.attrs.__setitem__("schema", 1), "schema"),
    "boot_id": (lambda f, _: f.attrs.__delitem__("boot_id"), "boot_id"),
    "an attribute more": (lambda f, _: f.attrs.__setitem__("author", "me"), "author"),
    "config": (lambda f, _: _text(f, "config", b"[run]"), "config"),
    "end": (lambda f, _: _text(f, "end", f["end"][()].replace(b'"test"', b'"sold"')), "end"),
    "time of the end": (
        lambda f, _: _text(f, "end", f["end"][()].replace(b'"t_ns":', b'"t_ns":1')),
        "end",
    ),
    "more in the end": (
        lambda f, _: _text(f, "end", f["end"][()].replace(b"{", b'{"who":"me",', 1)),
        "end",
    ),
    "no end": (lambda f, _: _text(f, "end", b"null"), "end"),
    "damage": (lambda f, _: _text(f, "damage", b'{"missing_frames":7}'), "damage"),
    "less damage": (lambda f, _: _text(f, "damage", b"{}"), "damage"),
    "meta": (lambda f, _: _text(f, "meta", f["meta"][()].replace(b'"test"', b'"sale"')), "meta"),
    "units": (lambda f, _: f["fixes"].attrs.__setitem__("columns", "lat_deg: furlongs"), "fixes"),
    "an attribute of a table": (lambda f, _: f["scans"].attrs.__setitem__("true", 1), "scans"),
    "a group": (lambda f, _: f.create_group("extra/within"), "extra"),
    "a dataset": (lambda f, _: f.create_dataset("extra", data=[1]), "extra"),
    "another name of a table": (lambda f, _: f.__setitem__("extra", f["fixes"]), "extra"),
    "a level": (lambda f, _: _change(f, "readings", "rssi_dbm", -30.0), "readings"),
    "a place": (lambda f, _: _change(f, "fixes", "lat_deg", 1.0), "fixes"),
    "a byte of a port": (lambda f, _: f["raw_bytes"].__setitem__(3, 7), "raw"),
    "a note": (lambda f, _: _change(f, "notes", "text", b"nothing"), "notes"),
    "order of the frames": (lambda f, _: _change(f, "frames", "number", 3), "frame"),
    "a frame's table": (lambda f, _: _change(f, "frames", "table", b"notes", 0), "frames"),
    "a frame's checksum": (lambda f, _: _change(f, "frames", "crc32", 3), "altered"),
    "a frame after the seal": (lambda f, _: _reseal(f), "seal"),
}
"""Changes of a readable run, and the word by which the verification names each."""


def _change(file: h5py.File, table: str, column: str, value: object, row: int = 5) -> None:
    rows = file[table][...]
    rows[column][row] = value
    file[table][...] = rows


def _reseal(file: h5py.File) -> None:
    """A description more, after the END frame that holds the digest."""
    frames = file["frames"]
    frames.resize((len(frames) + 1,))
    last = frames[-2]
    last["number"], last["kind"] = last["number"] + 1, 1
    frames[-1] = last
