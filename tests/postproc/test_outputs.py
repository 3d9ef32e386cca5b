"""A file that cannot be written is found out before anything is computed, by every command that
writes one.
"""

import shutil

import pytest

from logger.core.errors import RunFileError
from postproc.cli import main
from postproc.interop.importing import meta_of, write_run
from tests.kit import runs
from tests.kit.faulty_card import small_file_system

NAMES = {
    "no such folder": "none/x{suffix}",
    "it is a folder": "folder{suffix}",
    "it is no plain file": "pipe{suffix}",
    "File name too long": "x" * 300 + "{suffix}",
    "contains a NUL character": "x\0y{suffix}",
}
COMMANDS = {
    "export": (["export", "RUN", "--estimates", "-o"], ".kml"),
    "report": (["report", "RUN", "-o"], ".html"),
    "plot": (["plot", "RUN", "-o"], ".png"),
    "view": (["view", "RUN", "--save"], ".rrd"),
    "import": (["import", "CSV", "-o"], ".h5"),
    "share": (["share", "RUN", "-o"], ".h5"),
    "celldb": (["celldb", "import", "CSV", "-o"], ".db"),
    "toa": (["validate", "toa", "--runs", "10", "--plot"], ".png"),
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A run, and things in the way; whoever computes fails."""
    import os

    runs.write_journal(tmp_path / "walk.journal", runs.records(30))
    (tmp_path / "walk.csv").write_text("t_s,lat,lon,rssi_dbm\n1,52,13,-70\n")
    for _, suffix in COMMANDS.values():
        (tmp_path / f"folder{suffix}").mkdir(exist_ok=True)
        if not (tmp_path / f"pipe{suffix}").exists():
            os.mkfifo(tmp_path / f"pipe{suffix}")
    for work in (
        "postproc.smoothing.smooth_runs",
        "postproc.interop.importing.import_walk",
        "postproc.interop.share.share",
        "postproc.verification.celldb.import_exports",
        "postproc.reproductions.toa.simulate",
    ):
        monkeypatch.setattr(
            work, lambda *_, **__: pytest.fail("computed before the output was checked")
        )
    return tmp_path


def _fails(capsys, folder, command, target):
    given = {"RUN": folder / "walk.journal", "CSV": folder / "walk.csv"}
    before = sorted(folder.iterdir())
    assert main([str(given.get(word, word)) for word in command] + [str(target)]) == 2
    assert sorted(folder.iterdir()) == before
    (line,) = capsys.readouterr().err.splitlines()
    return line


@pytest.mark.parametrize("says", NAMES)
@pytest.mark.parametrize("name", COMMANDS)
def test_nothing_is_computed(capsys, folder, name, says):
    command, suffix = COMMANDS[name]
    assert says in _fails(capsys, folder, command, folder / NAMES[says].format(suffix=suffix))


@pytest.mark.parametrize("says", ["no such folder", "Not a directory"])
def test_a_folder_of_pictures_too(capsys, folder, says):
    target = folder / ("none" if says == "no such folder" else "walk.csv")
    assert "no such folder" in _fails(capsys, folder, ["report", "RUN", "--pictures"], target)


@pytest.mark.parametrize("name", ["export", "report", "plot"])
def test_a_run_is_never_replaced(capsys, folder, name):
    command, _ = COMMANDS[name]
    if name == "plot":
        (folder / "walk.png").write_bytes((folder / "walk.journal").read_bytes())
    target = folder / ("walk.png" if name == "plot" else "walk.journal")
    more = ["--format", "kml"] if name == "export" else []
    command = [*command[:2], *more, *command[2:]]
    assert "is a run" in _fails(capsys, folder, command, target)


@pytest.mark.parametrize("name", ["plot", "toa"])
def test_a_picture_of_no_known_format(capsys, folder, name):
    assert "a picture ends in" in _fails(capsys, folder, COMMANDS[name][0], folder / "x.walk")


FILLS = {
    "import": (["import", "CSV", "-o"], "x.h5", [0]),
    "view": (["view", "RUN", "--save"], "x.rrd", [0, 16384, 65536]),
    "compare": (["compare", "RUN", "OTHER", "--save"], "x.rrd", [0, 8192, 16384]),
    "survey": (["survey", "add", "RUN", "-o"], "x", [0]),
}


@pytest.mark.parametrize("name", FILLS)
def test_a_full_disk_is_named_with_the_file_and_leaves_none(capsys, tmp_path, name):
    command, target, rooms = FILLS[name]
    names = {"RUN": "walk.journal", "OTHER": "other.journal", "CSV": "walk.csv"}
    given = {word: tmp_path / name for word, name in names.items()}
    runs.write_journal(given["RUN"], runs.records(60))
    runs.write_journal(given["OTHER"], runs.on_another_day(runs.records(50)), run_id="f" * 32)
    given["CSV"].write_text("t_s,lat,lon,rssi_dbm\n" + "1,52,13,-70\n" * 9)
    words = [str(given.get(word, word)) for word in command]
    with small_file_system(tmp_path / "disk", "size=256k") as disk:
        (disk / "x").mkdir()
        for room in rooms:
            (disk / "ballast").write_bytes(bytes(shutil.disk_usage(disk).free - room))
            assert main([*words, str(disk / target)]) == 2
            *_, line = capsys.readouterr().err.splitlines()
            assert line.startswith(f"postproc: cannot write {disk / target}")
            assert line.endswith("No space left on device")
            assert sorted(path.name for path in disk.rglob("*")) == ["ballast", "x"]
            (disk / "ballast").unlink()


def test_a_run_that_is_made_without_room_speaks_of_no_journal(capsys, tmp_path):
    # the journal of an import or a copy goes with its folder; only that of a recording stays
    with small_file_system(tmp_path / "disk", "size=256k") as disk:
        with pytest.raises(RunFileError, match="no room for .*x.h5: 1 MB must be free$"):
            write_run(disk / "x.h5", meta_of("import of a log"), lambda _: 0, "imported")
        runs.write_journal(disk / "walk.journal", runs.records(9))
        assert main(["recover", str(disk / "walk.journal")]) == 2
    assert "1 MB must be free; the journal is safe" in capsys.readouterr().err
