import os
import socket

import pytest

from logger.core.runfile import read_run
from logger.core.types import Note
from logger.device.page_requests import FILE, MOST_AT_ONCE, PageRequests, requests_folder
from postproc.replay import replay
from tests.kit import service
from tests.kit.simulated_devices import simulated_devices

FOLLOW = b'{"do":"follow","text":"262-01-4711-2"}\n'
MARK = '{"do":"mark","text":"here! Grüße"}\n'.encode()


def _append(folder, data):
    with (folder / FILE).open("ab") as file:
        file.write(data)


def test_each_line_is_one_note_and_half_a_line_waits(tmp_path):
    requests = PageRequests(tmp_path)
    assert requests.take() == []
    _append(tmp_path, FOLLOW + MARK[:10])
    assert requests.take() == [Note("info", "follow", "262-01-4711-2")]
    _append(tmp_path, MARK[10:])
    assert requests.take() == [Note("info", "mark", "here! Grüße")]
    assert requests.take() == []


def test_what_stood_there_before_is_not_for_this_run_but_a_new_file_is(tmp_path):
    _append(tmp_path, FOLLOW)
    requests = PageRequests(tmp_path)
    assert requests.take() == []
    (tmp_path / "new").write_bytes(MARK)
    (tmp_path / "new").replace(tmp_path / FILE)
    assert [note.code for note in requests.take()] == ["mark"]


@pytest.mark.parametrize(
    "line",
    [
        b"\xff\xfe",
        b"[]",
        b'{"do":"shutdown"}',
        b'{"do":"mark","text":1}',
        b'{"do":"follow","text":"LTE-5780-504"}',
        b'{"do":"within","text":"0.5"}',
        b'{"do":"within","text":"nan"}',
        b'{"do":"mark","text":"%s"}' % (b"x" * 121),
        b'{"do":"mark","text":"a","run":"b"}',
        b"{" * 1000,
        b"\xff",
        b'{"do":"mark","text":"\xff"}',
        b'{"do":"\xff"}',
        b'{"\xff":1}',
        b'{"do":"mark","id":"\xc3\x28"}',
        b'{"do":"mark","id":"12345678901234567"}',
        b'{"do":"mark","text":"\\ud800"}',
        b'{"do":"mark","text":"a\0b"}',
        b"\0" * 500,
        b'{"do":"mark","text":%s}' % (b"9" * 400),
        b'{"do":"mark","text":%s}' % (b"[" * 900),
        b'{"do":"mark","x":%s}' % (b'{"a":' * 150),
        b"\xef\xbb\xbf{}",
    ],
)
def test_what_is_no_request_is_counted(tmp_path, line):
    requests = PageRequests(tmp_path)
    _append(tmp_path, line + b"\n" + MARK)
    assert [note.code for note in requests.take()] == ["mark", "page-request"]


def test_a_flood_is_read_in_portions_and_mostly_refused(tmp_path):
    requests = PageRequests(tmp_path)
    _append(tmp_path, FOLLOW * 10_000)
    notes = requests.take()
    assert [note.code for note in notes] == ["follow"] * MOST_AT_ONCE + ["page-request"]
    _append(tmp_path, b"x" * 1_000_000)
    for _ in range(500):
        assert len(requests.take()) <= MOST_AT_ONCE + 1
    _append(tmp_path, b"\n" + MARK)
    assert next(note.code for note in requests.take()) == "mark"


@pytest.mark.parametrize("make", ["pipe", "link", "loop", "device", "folder", "socket", "secret"])
def test_what_is_no_file_is_counted_once_and_not_read(tmp_path, make):
    requests, path = PageRequests(tmp_path), tmp_path / FILE
    (tmp_path / "other").write_bytes(MARK)
    match make:
        case "pipe":
            os.mkfifo(path)
        case "link":
            path.symlink_to(tmp_path / "other")
        case "loop":
            path.symlink_to(path)
        case "device":
            path.symlink_to("/dev/zero")
        case "folder":
            path.mkdir()
        case "socket":
            with socket.socket(socket.AF_UNIX) as server:
                server.bind(str(path))
        case "secret":
            if os.getuid() == 0:
                pytest.skip("root reads everything")
            path.write_bytes(MARK)
            path.chmod(0)
    codes = []
    service.assert_ends(lambda: codes.extend(note.code for note in requests.take()), 10.0)
    assert codes == ["page-request"]
    assert requests.take() == []
    (tmp_path / "new").write_bytes(MARK)
    if make == "folder":
        path.rmdir()
    (tmp_path / "new").replace(path)
    assert [note.code for note in requests.take()] == ["mark"]


def test_a_file_that_was_cut_is_read_from_its_start(tmp_path):
    requests = PageRequests(tmp_path)
    _append(tmp_path, FOLLOW * 3)
    assert len(requests.take()) == 3
    (tmp_path / FILE).write_bytes(MARK)
    assert [note.code for note in requests.take()] == ["mark"]
    (tmp_path / FILE).unlink()
    assert requests.take() == []


def _requests_by(*names):
    return b"".join(b'{"do":"mark","id":"%s"}\n' % name for name in names)


def test_a_request_is_confirmed_when_its_note_is_on_the_card(tmp_path):
    requests = PageRequests(tmp_path)
    _append(tmp_path, _requests_by(b"a", b"b") + b"garbage\n")
    assert len(requests.take()) == 3
    requests.confirm(1)
    assert requests.on_card == ("a",)
    _append(tmp_path, MARK + _requests_by(b"c", b"d", b"e"))
    notes = requests.take()
    requests.drop(notes[1])  # c
    requests.confirm(4)
    assert requests.on_card == ("a", "b")
    requests.confirm(5)
    assert requests.on_card == ("a", "b", "d")
    requests.disown()
    requests.confirm(6)
    assert requests.on_card == ("a", "b", "d")
    for i in range(100):
        _append(tmp_path, _requests_by(b"%d" % i))
        requests.take()
        requests.confirm(7 + i)
    assert requests.on_card[-1] == "99"
    assert len(requests.on_card) == 2 * MOST_AT_ONCE


def test_text_that_controls_a_terminal_is_escaped(tmp_path):
    requests = PageRequests(tmp_path)
    _append(tmp_path, b'{"do":"mark","text":"\\u001b[2J"}\n')
    assert requests.take() == [Note("info", "mark", "\\u001b[2J")]


def test_the_service_records_them_before_they_act_and_replay_repeats_them(tmp_path, monkeypatch):
    status = tmp_path / "cellwalk"
    folder = requests_folder(status)
    status.mkdir()
    folder.mkdir()
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(status))
    with simulated_devices() as (modem, gnss, _):
        page = '[page]\nlisten = "127.0.0.1:1"\n[live]\nmax_fix_age_s = 100.0\n'
        config = service.site_toml(tmp_path, modem.path, gnss.path, page)
        with service.running_service(config) as logger:
            service.wait_for(lambda: service.n_recorded(tmp_path / "runs", "live") > 20)
            (journal,) = (tmp_path / "runs").glob("*.journal")
            names = {row["cell"].decode() for row in read_run(journal).tables["live"]}
            (folder / FILE).write_bytes(
                MARK + b'{"do":"follow","text":"%s"}\n' % min(names).encode()
            )
            before = service.n_recorded(tmp_path / "runs", "live")
            service.wait_for(lambda: service.n_recorded(tmp_path / "runs", "live") > before + 40)
            service.stop_service(logger)
    (path,) = (tmp_path / "runs").glob("*.h5")
    run = read_run(path)
    notes = [(row["source"], row["code"]) for row in run.tables["notes"]]
    assert {(b"page", b"mark"), (b"page", b"follow")} <= set(notes)
    assert replay(run).equal


def test_without_a_page_nothing_is_read(tmp_path, monkeypatch):
    status = tmp_path / "cellwalk"
    folder = requests_folder(status)
    status.mkdir()
    folder.mkdir()
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(status))
    with simulated_devices() as (modem, gnss, _):
        config = service.site_toml(tmp_path, modem.path, gnss.path)
        with service.running_service(config) as logger:
            service.wait_for(lambda: service.n_recorded(tmp_path / "runs", "fixes") > 2)
            (folder / FILE).write_bytes(MARK)
            before = service.n_recorded(tmp_path / "runs", "fixes")
            service.wait_for(lambda: service.n_recorded(tmp_path / "runs", "fixes") > before + 50)
            service.stop_service(logger)
    (path,) = (tmp_path / "runs").glob("*.h5")
    assert b"mark" not in read_run(path).tables["notes"]["code"].tolist()
