"""Whatever stands at a path and is no plain file is refused at once, by every reader of one."""

import os
import socket

import pytest

from logger.core.foreign import check_regular, open_regular
from postproc.cli import main as postproc

WORDS = {
    "pipe": "pipe",
    "socket": "socket",
    "folder": "folder",
    "device": "device",
    "link": "pipe",
    "loop": "symbolic links",
    "none": "No such file",
}


def _make(folder, what):
    path = folder / "x"
    match what:
        case "pipe":
            os.mkfifo(path)
        case "socket":
            with socket.socket(socket.AF_UNIX) as server:
                server.bind(str(path))
        case "folder":
            path.mkdir()
        case "device":
            path.symlink_to("/dev/zero")
        case "link":
            os.mkfifo(folder / "pipe")
            path.symlink_to(folder / "pipe")
        case "loop":
            path.symlink_to(path)
    return path


@pytest.mark.parametrize("what", WORDS)
def test_what_is_no_plain_file_is_not_opened(tmp_path, what):
    path = _make(tmp_path, what)
    for read in (check_regular, open_regular):
        with pytest.raises(OSError, match=r".") as caught:
            read(path)
        assert WORDS[what] in caught.value.strerror


def test_a_plain_file_and_a_link_to_it(tmp_path):
    (tmp_path / "a").write_bytes(b"abc")
    (tmp_path / "b").symlink_to("a")
    for name in "ab":
        assert check_regular(tmp_path / name) == 3
        with open_regular(tmp_path / name) as file:
            assert file.read() == b"abc"


@pytest.mark.parametrize(
    "argv",
    [
        ["import", "x", "-o", "run.h5"],
        ["import", "log.csv", "--track", "x", "-o", "run.h5"],
        ["celldb", "import", "x", "-o", "cells.db"],
        ["smooth", "x"],
        ["view", "x"],
        ["report", "run.h5", "--basemap", "x"],
        ["verify", "run.h5", "--claims", "x"],
        ["suspect", "run.h5", "--baseline", "x"],
        ["next", "run.h5", "--streets", "x"],
    ],
)
@pytest.mark.parametrize("what", ["pipe", "device", "folder"])
def test_each_command_refuses_what_is_no_plain_file(tmp_path, monkeypatch, capsys, argv, what):
    _make(tmp_path, what)
    (tmp_path / "log.csv").write_text("t_s,lat,lon,rssi_dbm\n0,52,13,-70\n1,52,13,-71\n")
    monkeypatch.chdir(tmp_path)
    assert postproc(argv) == 2
    error = capsys.readouterr().err
    assert f"x: is a {what}" in error
    assert len(error.splitlines()) == 1
