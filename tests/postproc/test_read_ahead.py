"""Runs that are kept: altered ones are refused, and no copy takes the place of the genuine run."""

import json
import shutil
import time
from dataclasses import replace

import h5py
import msgspec
import numpy as np
import pytest

from logger.baseline_store import BaselineStore
from logger.core.runfile import (
    RunWriter,
    convert_journal,
    read_run,
    read_sound_run,
    read_unaltered_run,
    recover,
    sealing_of,
)
from logger.core.runfile.frames import Kind, encode, scan
from logger.core.types import Scan
from postproc.cli import main
from postproc.info import verify
from postproc.survey.dataset import Survey
from tests.postproc.baseline.walks import two_cells, write_walk

CRC_BYTES = 4
"""Behind the payload of a frame."""


def _set(dataset, column, value):
    rows = dataset[()]
    rows[column][5] = value
    dataset[...] = rows


def _add_rows(file):
    file["readings"].resize((len(file["readings"]) + 3,))


def _edit_meta(file):
    text = file["meta"][()].replace(b"12345678", b"87654321")
    del file["meta"]
    file["meta"] = np.bytes_(text)


ALTERATIONS = {
    "level": lambda file: _set(file["readings"], "rssi_dbm", -33.0),
    "cell": lambda file: _set(file["readings"], "cell", b"262-01-801-666"),
    "doubt": lambda file: _set(file["readings"], "identity_unsure", 1),
    "technology": lambda file: _set(file["readings"], "rat", b"LTE"),
    "channel": lambda file: _set(file["readings"], "arfcn", 77),
    "timing advance": lambda file: _set(file["readings"], "ta", 3),
    "position": lambda file: _set(file["fixes"], "lat_deg", 48.1),
    "accuracy": lambda file: _set(file["fixes"], "acc_m", 900.0),
    "time": lambda file: _set(file["fixes"], "utc_ns", 1),
    "no fix": lambda file: _set(file["fixes"], "valid", 0),
    "rows": _add_rows,
    "description": _edit_meta,
    "attribute": lambda file: file.attrs.update({"run_id": "f" * 32}),
    "digest": lambda file: file.attrs.update({"digest": "f" * 64}),
    "member": lambda file: file.create_dataset("more", data=[1]),
}


def _alter(run, folder, kind):
    folder.mkdir(exist_ok=True)
    forged = folder / "forged.h5"
    shutil.copy(run, forged)
    with h5py.File(forged, "r+") as file:
        ALTERATIONS[kind](file)
    assert not all(check.holds for check in verify(forged))
    return forged


def _remake(run, target, change=lambda record: record, *, n=None, close=True, **meta):
    """A run written anew, with a chain of its own; the first `n` records, changed."""
    source = read_run(run)
    about = msgspec.structs.replace(source.meta, **meta)
    writer = RunWriter(target.with_suffix(".journal"), about)
    for _, record in list(source.records("fixes", "scans", "notes"))[:n]:
        writer.append(change(record))
    if not close:
        writer.sync()
        return target.with_suffix(".journal")
    writer.close(source.end.t_ns, "test")
    convert_journal(target.with_suffix(".journal"), target)
    target.with_suffix(".journal").unlink()
    return target


def _all_unsure(record):
    """All identities unsure: the digest of the content does not include that."""
    if not isinstance(record.value, Scan):
        return record
    unsure = tuple(replace(one, identity_unsure=True) for one in record.value.readings)
    return replace(record, value=replace(record.value, readings=unsure))


def _louder(record):
    if not isinstance(record.value, Scan):
        return record
    readings = tuple(replace(one, rssi_dbm=one.rssi_dbm + 9) for one in record.value.readings)
    return replace(record, value=replace(record.value, readings=readings))


@pytest.fixture(scope="module")
def genuine(tmp_path_factory):
    return write_walk(tmp_path_factory.mktemp("genuine"), 1, two_cells(), n=40)


class _Kept:
    """`baseline add` or `survey add`, file by file."""

    def __init__(self, command, folder, capsys):
        self._command, self._capsys = command, capsys
        self._target = folder / {"baseline": "b.db", "survey": "s"}[command]

    def add(self, *files):
        option = {"baseline": "-b", "survey": "-o"}[self._command]
        self._capsys.readouterr()
        arguments = [*map(str, files), option, str(self._target), "--json"]
        code = main([self._command, "add", *arguments])
        shown = self._capsys.readouterr()
        document = json.loads(shown.out)
        rows = document["runs" if self._command == "baseline" else "files"]
        return code, rows, shown.err

    @property
    def names(self):
        if self._command == "baseline":
            with BaselineStore(self._target) as store:
                return sorted(walk.name for walk in store.walks())
        survey = Survey.open(self._target)
        heard = set(survey.cells_of_runs["run"].to_pylist())
        assert heard == set(survey.runs)
        return sorted(run.name for run in survey.runs.values())


@pytest.fixture(params=["baseline", "survey"])
def keeper(request, tmp_path, capsys):
    return _Kept(request.param, tmp_path, capsys)


def test_altered_runs_are_refused_with_the_reason(genuine, tmp_path, keeper):
    forged = [_alter(genuine, tmp_path / kind, kind) for kind in ALTERATIONS]
    code, rows, error = keeper.add(*forged, genuine)
    assert (code, [bool(row["problem"]) for row in rows]) == (3, [True] * len(forged) + [False])
    for row in rows[:-1]:
        assert f"{row['path']} was altered: " in row["problem"]
        assert row["problem"] in error
    assert keeper.names == ["run-000001.h5"]
    # the other order
    code, rows, _ = keeper.add(genuine, forged[0])
    assert [(row["is_known"], bool(row["problem"])) for row in rows] == [
        (True, False),
        (False, True),
    ]
    assert keeper.names == ["run-000001.h5"]


def test_an_altered_journal_is_refused(genuine, tmp_path, keeper):
    """A frame after the seal; its own checksum is right."""
    journal = tmp_path / "run-000001.journal"
    content = genuine.with_suffix(".journal").read_bytes()
    frames = [event for event in scan(content) if hasattr(event, "number")]
    last = max(frames, key=lambda frame: frame.number)
    more = encode(last.run, last.number + 1, Kind.META, read_run(genuine).meta.run_id.encode(), 4)
    end = last.start + last.length + CRC_BYTES
    journal.write_bytes(content[:end] + more)
    assert not all(check.holds for check in verify(journal))
    code, rows, _ = keeper.add(journal, genuine)
    assert (code, [bool(row["problem"]) for row in rows]) == (3, [True, False])
    assert keeper.names == ["run-000001.h5"]


@pytest.mark.parametrize("genuine_first", [True, False])
@pytest.mark.parametrize("forgery", ["same content", "other levels", "import", "other run"])
def test_a_copy_that_was_sealed_anew_displaces_nothing(
    genuine, tmp_path, keeper, forgery, genuine_first
):
    change = {} if forgery != "import" else {"origin": "import of x.csv"}
    change |= {"run_id": "e" * 32} if forgery == "other run" else {}
    forged = _remake(genuine, tmp_path / "forged.h5", _all_unsure, **change)
    if forgery == "other levels":
        forged.unlink()
        forged = _remake(genuine, forged, _louder)
    assert all(check.holds for check in verify(forged))  # nobody can tell without the noted digest
    files = [genuine, forged] if genuine_first else [forged, genuine]
    for file in files:
        keeper.add(file)
    assert "run-000001.h5" in keeper.names
    code, rows, _ = keeper.add(*files)
    assert (code, [row["is_known"] for row in rows]) == (0, [True, True])


def test_the_contradiction_is_said(genuine, tmp_path, keeper):
    forged = _remake(genuine, tmp_path / "forged.h5", _louder)
    keeper.add(forged)
    code, rows, error = keeper.add(genuine)
    assert code == 0
    assert "sealed anew" in rows[0]["remark"]
    assert "sealed anew" in error


def test_a_run_that_was_cut_gives_way_to_what_continues_it(tmp_path, keeper):
    folder = tmp_path / "whole"
    folder.mkdir()
    whole = write_walk(folder, 1, two_cells(), n=40)
    journal = _journal_in_steps(whole, folder / "steps.journal")
    states = []
    for number, share in enumerate((0.3, 0.7)):
        state = tmp_path / f"state{number}.journal"
        content = journal.read_bytes()
        state.write_bytes(content[: _last_frame(content, share)])
        states.append(state)
    for state in states:
        code, rows, _ = keeper.add(state)
        assert (code, rows[0]["problem"]) == (0, ""), rows
        assert keeper.names == [state.name]
        # recovered, it is the same run
        recovered = state.with_suffix(".h5")
        convert_journal(state, recovered)
        assert read_run(recovered).end is None
        assert keeper.add(recovered)[1][0]["is_known"]
    code, rows, _ = keeper.add(journal)
    assert (code, rows[0]["problem"], rows[0]["remark"]) == (0, "", "")
    assert keeper.names == ["steps.journal"]
    # a part of what is there
    code, rows, _ = keeper.add(states[0])
    assert keeper.names == ["steps.journal"]


def _journal_in_steps(run, target):
    """The same records, made durable in many frames."""
    source = read_run(run)
    writer = RunWriter(target, source.meta)
    for number, (_, record) in enumerate(source.records("fixes", "scans", "notes")):
        writer.append(record)
        if number % 4 == 0:
            writer.sync()
    writer.close(source.end.t_ns, "test")
    return target


def _last_frame(content, share):
    """Where the last whole frame before a share of the journal ends."""
    ends = [
        event.start + event.length + CRC_BYTES
        for event in scan(content)
        if hasattr(event, "number")
    ]
    return max(end for end in ends if end <= share * len(content))


def test_a_forged_state_that_was_cut_displaces_nothing(genuine, tmp_path, keeper):
    forged = _remake(genuine, tmp_path / "forged.h5", _louder, n=50, close=False)
    assert keeper.add(forged)[0] == 0
    code, rows, _ = keeper.add(genuine)
    assert (code, rows[0]["problem"]) == (0, "")
    assert "run-000001.h5" in keeper.names


def test_a_damaged_copy_displaces_nothing(genuine, tmp_path, capsys):
    """A frame in the middle is missing; the seal that it states is that of the whole run."""
    keeper = _Kept("baseline", tmp_path, capsys)
    journal = _journal_in_steps(genuine, tmp_path / "whole.journal")
    content = journal.read_bytes()
    frames = [event for event in scan(content) if hasattr(event, "number")]
    gone = frames[len(frames) // 2]
    damaged = tmp_path / "damaged.journal"
    hole = bytearray(content)
    hole[gone.start : gone.start + gone.length] = bytes(gone.length)
    damaged.write_bytes(hole)
    assert read_sound_run(damaged).damage.missing_frames
    assert keeper.add(damaged)[0] == 0
    assert keeper.add(journal)[0] == 0
    assert keeper.names == ["whole.journal"]
    assert "another state" in keeper.add(damaged)[1][0]["problem"]


def test_a_shared_copy_is_the_same_walk(tmp_path, keeper):
    walk = write_walk(tmp_path, 1, two_cells(), n=400)
    copy = tmp_path / "copy.h5"
    assert main(["share", str(walk), "-o", str(copy), "--blur-m", "50"]) == 0
    for file in (copy, walk, copy):
        assert keeper.add(file)[0] == 0
    assert keeper.names == ["run-000001.h5"]


def test_a_run_is_verified_in_little_more_than_the_time_to_read_it(tmp_path):
    walk = write_walk(tmp_path, 1, two_cells(), n=5000)
    took_s = []
    for read in (read_sound_run, read_unaltered_run):
        read(walk)
        began_s = time.process_time()
        assert len(read(walk).tables["readings"]) == 10_000
        took_s.append(time.process_time() - began_s)
    assert took_s[1] < took_s[0] + 0.5


def test_a_recovered_run_is_no_altered_one(tmp_path, genuine):
    """What `recover` makes of a journal that was cut anywhere."""
    content = genuine.with_suffix(".journal").read_bytes()
    for share in (0.8, 0.97):
        cut = tmp_path / f"run-{share}.journal"
        cut.write_bytes(content[: int(share * len(content))])
        (recovered,) = recover(cut)
        for path in (cut, recovered.run):
            assert sealing_of(path).alterations == ()
