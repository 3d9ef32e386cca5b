"""Several small runs read by one process."""

import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import convert_journal, read_small_runs, read_sound_run
from tests.kit.runs import records, write_journal


@pytest.fixture
def paths(tmp_path):
    made = []
    for number in range(3):
        journal = tmp_path / f"run-{number:06d}.journal"
        write_journal(journal, records(10 + number), run_id=f"{number:032x}")
        made.append(journal.with_suffix(".h5"))
        convert_journal(journal, made[-1])
    return made


def test_runs_read_together_are_those_read_alone(paths):
    for run, path in zip(read_small_runs(paths), paths, strict=True):
        alone = read_sound_run(path)
        assert (run.path, run.meta, run.end, run.damage) == (
            alone.path, alone.meta, alone.end, alone.damage,
        )  # fmt: skip
        assert (run.digest, run.n_raw_bytes) == (alone.digest, alone.n_raw_bytes)
        assert run.raw_bytes.tobytes() == alone.raw_bytes.tobytes()
        assert {name: rows.tobytes() for name, rows in run.tables.items()} == {
            name: rows.tobytes() for name, rows in alone.tables.items()
        }


@pytest.mark.parametrize("bad", [b"", b"no run", None])
def test_one_that_cannot_be_read_is_an_error(paths, bad):
    if bad is None:
        paths[1].unlink()
    else:
        paths[1].write_bytes(bad)
    with pytest.raises(RunFileError):
        read_small_runs(paths)
