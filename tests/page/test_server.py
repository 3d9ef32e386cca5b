"""The real server: what it gives to the phone and what it refuses to everybody else."""

import json
import socket
import threading
import time
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from itertools import count, cycle, islice
from pathlib import Path

import pytest

from logger.core.errors import ConfigError
from logger.core.types import Note
from logger.device.status import Status, write_status
from logger.page.server import (
    ALL_BURST,
    BURST,
    PER_S,
    TOKEN_S,
    WRITE_BURST,
    WRITES_PER_S,
    Limits,
    Places,
    closed_runs,
    host_names,
)
from logger.page.token import is_token, make_token, page_url, qr_code, read_token
from tests.kit import page as kit
from tests.kit import service
from tests.kit.runs import records, write_journal

PHONES = count(2)
STATUS = Status("recording", "", "run-000002.journal", 1, 9, 0, 8, 3, 2, 1, 0, 10, None, {})


@pytest.fixture
def page(tmp_path):
    with _server(tmp_path) as server:
        yield server


@pytest.fixture(scope="module")
def shared_server(tmp_path_factory):
    """A server for requests that leave nothing behind."""
    with _server(tmp_path_factory.mktemp("page")) as server:
        yield server


@contextmanager
def _server(tmp_path):
    folder, port = kit.folders(tmp_path), kit.free_port()
    write_status(folder, STATUS)
    write_journal(tmp_path / "runs/run-000002.journal", records(30), close=False)
    (tmp_path / "runs/run-000001.h5").write_bytes(b"closed" * 50_000)
    (tmp_path / "ground.pmtiles").write_bytes(bytes(range(256)) * 8000)
    table = f'[page]\nlisten = "127.0.0.1:{port}"\nmap = "{tmp_path / "ground.pmtiles"}"\n'
    config = service.site_toml(tmp_path, "/dev/a", "/dev/b", table)
    with kit.page_server(tmp_path, config, port) as server:
        yield server


def test_the_phone_gets_the_page_the_news_the_track_and_the_closed_runs(page):
    status, headers, content = page.request("")
    assert (status, b"Where to go" in content) == (200, True)
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert (headers["Referrer-Policy"], headers["Server"]) == ("no-referrer", "cellwalk")
    again = page.request("", **{"If-None-Match": headers["Etag"]})
    assert (again[0], again[2]) == (304, b"")
    track = json.loads(page.request("track")[2])
    assert (track["run"], len(track["points"]) > 5) == ("run-000002", True)
    assert json.loads(page.request("runs")[2]) == [["run-000001.h5", 300_000]]
    status, headers, content = page.request("runs/run-000001.h5")
    assert (status, len(content)) == (200, 300_000)
    assert headers["Content-Disposition"] == 'attachment; filename="run-000001.h5"'


def test_news_come_at_once(page, tmp_path):
    with socket.create_connection(("127.0.0.1", page.port)) as phone:
        phone.sendall(f"GET /{page.token}/live HTTP/1.1\r\nHost: {page.host}\r\n\r\n".encode())
        file = phone.makefile("rb")
        while not file.readline().startswith(b"data:"):
            pass
        start_s = time.monotonic()
        write_status(tmp_path / "cellwalk", Status(**{**_fields(STATUS), "fixes": 4711}))
        while b'"fixes":4711' not in file.readline():
            pass
        assert time.monotonic() - start_s < 0.5


def _fields(status):
    return {name: getattr(status, name) for name in status.__struct_fields__}


def test_what_the_walker_asks_reaches_the_recorder(page, tmp_path):
    with kit.recording(tmp_path, STATUS) as notes:
        assert page.post("mark", "here! Grüße")[0] == 202
        assert page.post("follow", "262-01-4711-2")[0] == 202
        assert page.post("within", "300")[0] == 202
        assert page.post("within", "far")[0] == 400
    asked = [("mark", "here! Grüße"), ("follow", "262-01-4711-2"), ("within", "300")]
    assert notes == [Note("info", *one) for one in asked]


@pytest.mark.parametrize(
    ("path", "headers", "code"),
    [
        ("/", {}, 403),
        ("/x/", {}, 403),
        ("/x/live", {}, 403),
        ("/" + "x" * 22 + "/track", {}, 403),
        ("", {"Host": "cellwalk.example"}, 421),
        ("", {"Host": ""}, 421),
        ("", {"Origin": "http://evil.example"}, 403),
        ("nothing.js", {}, 404),
        ("__init__.py", {}, 403),
        ("../../etc/passwd", {}, 403),
        ("%2e%2e%2f%2e%2e%2fetc%2fpasswd", {}, 403),
        ("runs/..%2fsite.toml", {}, 404),
        ("runs/run-000002.journal", {}, 404),
        ("runs/run-000009.h5", {}, 404),
        ("track?point=-1", {}, 400),
        ("track?point=" + "9" * 30, {}, 400),
    ],
)
def test_strangers_and_other_paths_are_refused(shared_server, path, headers, code):
    status, found, content = shared_server.request(path, **headers)
    assert status == code
    assert len(content) < 60
    assert "Content-Security-Policy" in found


@pytest.mark.parametrize(
    ("headers", "body", "code"),
    [
        ({"Origin": "http://evil.example"}, b'"x"', 403),
        ({"Origin": "null"}, b'"x"', 403),
        ({"Content-Type": "text/plain"}, b'"x"', 415),
        ({"Origin": ""}, b'"x"', 403),
        ({}, b"x", 400),
        ({}, b'"\xff"', 400),
        ({}, b'"\xc3\x28"', 400),
        ({}, b'"a\0b"', 400),
        ({}, b'"\\ud800"', 400),
        ({}, b"9" * 400, 400),
        ({}, b"[" * 1000, 400),
        ({}, b'{"a":' * 150, 400),
        ({}, b"", 400),
        ({}, b"null", 400),
        ({}, b'{"a":1}', 400),
        ({}, b'"%s"' % (b"x" * 121), 400),
    ],
)
def test_other_pages_cannot_ask_the_recorder(shared_server, headers, body, code):
    known = {"Content-Type": "application/json", "Origin": f"http://{shared_server.host}"}
    source = f"127.0.1.{next(PHONES)}"
    request = partial(shared_server.request, method="POST", source=source)
    assert request("mark", body=body, **{**known, **headers})[0] == code
    del known["Origin"]
    assert request("mark", body=b'"x"', **known)[0] == 403
    assert request("shutdown", body=b'"x"')[0] in {403, 404, 405}
    assert not shared_server.requests.exists()


@pytest.mark.parametrize(
    ("span", "code", "size"),
    [
        ("bytes=10-19", 206, 10),
        ("bytes=2047990-2999999", 206, 10),
        ("bytes=0-2000000", 416, None),
        ("bytes=2048000-2048001", 416, None),
        ("bytes=9-3", 416, None),
        ("bytes=0-", 404, None),
        ("bytes=0-1,3-4", 404, None),
        ("", 404, None),
    ],
)
def test_the_map_is_given_in_small_parts(shared_server, span, code, size):
    status, headers, content = shared_server.request("map", Range=span)
    assert status == code
    if size is not None:
        assert len(content) == size
        assert headers["Content-Range"].startswith(span.replace("=", " ")[:11])
        assert headers["Content-Range"].endswith("/2048000")


def test_the_newest_runs_come_first(tmp_path):
    for number in (999_998, 999_999, 1_000_000):
        (tmp_path / f"run-{number}.h5").write_bytes(b"x")
    names = ["run-1000000.h5", "run-999999.h5", "run-999998.h5"]
    assert closed_runs(tmp_path) == [(name, 1) for name in names]


def test_a_link_among_the_runs_is_not_followed(page, tmp_path):
    (tmp_path / "runs/run-000003.h5").symlink_to("/etc/passwd")
    assert page.request("runs/run-000003.h5")[0] == 404


def _exchange(page, data, seconds):
    """What comes back until the server closes the connection; None where it does not."""
    with socket.create_connection(("127.0.0.1", page.port)) as stranger:
        stranger.settimeout(seconds)
        try:
            stranger.sendall(data)
            got = b""
            while piece := stranger.recv(4096):
                got += piece
        except TimeoutError:
            return None
        except ConnectionError:
            return b""
        return got


def test_a_megabyte_of_headers_and_a_large_body_are_refused(page):
    head = f"GET /{page.token}/ HTTP/1.1\r\nHost: {page.host}\r\n".encode()
    got = _exchange(page, head + b"X-A: " + b"a" * 1_000_000 + b"\r\n\r\n", 20)
    assert got is not None
    assert b"200 OK" not in got
    post = head.replace(b"GET", b"POST") + b"Content-Length: 1000000\r\n\r\n"
    got = _exchange(page, post + b"a" * 1_000_000, 20)
    assert got is not None
    assert b"202" not in got
    assert page.request("")[0] == 200


@pytest.mark.slow
def test_a_request_that_never_ends_is_closed(page):
    with socket.create_connection(("127.0.0.1", page.port)) as slow:
        slow.settimeout(0.5)
        start_s = time.monotonic()
        is_open = True
        while is_open and time.monotonic() - start_s < 30.0:
            try:
                slow.sendall(b"G")
                is_open = slow.recv(1) != b""
            except TimeoutError:
                pass
            except ConnectionError:
                is_open = False
        assert not is_open
        assert time.monotonic() - start_s < 20.0


def _half_open(page, host):
    """A connection that has brought nothing."""
    return _connect(page, host, b"")


def _half_line(page, host):
    return _connect(page, host, b"GET /x")


def _half_headers(page, host):
    return _connect(page, host, b"GET / HTTP/1.1\r\nHost: x\r\nX-A: ")


def _no_body(page, host):
    head = f"POST /{page.token}/mark HTTP/1.1\r\nHost: {page.host}\r\nContent-Length: 1000\r\n\r\n"
    return _connect(page, host, head.encode())


def _bad_host(page, host):
    """A stranger that keeps its connection after the answer."""
    return _connect(page, host, f"GET /x/ HTTP/1.1\r\nHost: {page.host}\r\n\r\n".encode())


def _slow_reader(page, host):
    path = f"/{page.token}/runs/run-000001.h5"
    return _connect(page, host, f"GET {path} HTTP/1.1\r\nHost: {page.host}\r\n\r\n".encode())


def _stream(page, host):
    head = f"GET /{page.token}/live HTTP/1.1\r\nHost: {page.host}\r\n\r\n"
    return _connect(page, host, head.encode())


def _kept_open(page, host):
    """A connection that waits for its next request."""
    head = f"GET /{page.token}/icon.svg HTTP/1.1\r\nHost: {page.host}\r\n\r\n"
    return _connect(page, host, head.encode())


def _connect(page, host, data):
    one = socket.socket()
    one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    one.bind((f"127.0.0.{host}", 0))
    one.connect(("127.0.0.1", page.port))
    one.sendall(data)
    return one


KINDS = (
    *(_half_open, _half_line, _half_headers, _no_body, _bad_host),
    *(_slow_reader, _stream, _kept_open),
)


@pytest.mark.parametrize("kinds", [*[(kind,) for kind in KINDS], KINDS])
def test_a_phone_is_served_while_six_others_hold_all_they_can(page, tmp_path, kinds):
    with (tmp_path / "runs/run-000001.h5").open("r+b") as file:
        file.truncate(20_000_000)
    ended = threading.Event()

    def drip(held):
        """A byte each second, and another connection for each that was closed."""
        while not ended.wait(0.5):
            for i, (one, make, host) in enumerate(held):
                try:
                    if make in {_half_open, _half_line, _half_headers}:
                        one.send(b"a")
                    one.setblocking(False)
                    with suppress(BlockingIOError):
                        if make is not _slow_reader and not one.recv(4096):
                            raise ConnectionError
                    one.setblocking(True)
                except OSError:
                    one.close()
                    with suppress(OSError):
                        held[i] = make(page, host), make, host

    held = [
        (make(page, host), make, host) for host in range(2, 8) for make in islice(cycle(kinds), 12)
    ]
    attack = threading.Thread(target=drip, args=(held,))
    attack.start()
    took_s = []
    try:
        for i in range(20):
            start_s = time.monotonic()
            what = ("", "track", "runs", "page.js")[i % 4]
            assert page.request(what, source="127.0.0.99")[0] == 200
            took_s.append(time.monotonic() - start_s)
            time.sleep(0.1)
        with _stream(page, 99) as phone:
            phone.settimeout(5.0)
            assert b"200 OK" in phone.recv(100)
            for _ in range(3):
                assert phone.recv(4096)
    finally:
        ended.set()
        attack.join()
        for one, _, _ in held:
            one.close()
    print(f"the slowest of {len(took_s)} took {max(took_s):.2f} s; {page.memory_kb / 1000:.0f} MB")
    assert max(took_s) < 2.0
    assert page.memory_kb < 48_000  # three quarters of what the unit allows
    assert len(list(Path(f"/proc/{page.process.pid}/fd").iterdir())) < 64 + 30


def test_a_flood_gets_429_and_another_phone_its_page(page, tmp_path):
    _check_flood(lambda: page.request("runs", source="127.0.0.66")[0], 200, PER_S, BURST)
    assert page.request("", source="127.0.0.7")[0] == 200
    with kit.recording(tmp_path, STATUS):
        _check_flood(
            lambda: page.post("mark", "x", source="127.0.0.8")[0], 202, WRITES_PER_S, WRITE_BURST
        )


def _check_flood(request, accepted, per_s, burst):
    """Requests until some are refused; no more are accepted than time allows, however slow."""
    codes, start_s = [], time.monotonic()
    while codes.count(429) < 5 and len(codes) < 2000:
        codes.append(request())
    most = burst + per_s * (time.monotonic() - start_s)
    assert set(codes) == {accepted, 429}
    assert burst <= codes.count(accepted) <= most


def test_phones_that_do_not_read_a_download_take_no_memory(page, tmp_path):
    with (tmp_path / "runs/run-000001.h5").open("r+b") as file:
        file.truncate(200_000_000)
    with ExitStack() as stack:
        for host in range(2, 42):
            one = stack.enter_context(socket.socket())
            one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            one.bind((f"127.0.0.{host}", 0))
            one.connect(("127.0.0.1", page.port))
            path = f"/{page.token}/runs/run-000001.h5"
            one.sendall(f"GET {path} HTTP/1.1\r\nHost: {page.host}\r\n\r\n".encode())
        time.sleep(2.0)
        assert page.request("", source="127.0.0.99")[0] == 200
    print(f"the page took {page.memory_kb / 1000:.0f} MB at most")
    assert page.memory_kb < 48_000  # three quarters of what the unit allows


def test_an_eleventh_phone_is_told_to_come_later(page):
    with ExitStack() as stack:
        for host in range(2, 12):
            one = stack.enter_context(socket.socket())
            one.bind((f"127.0.0.{host}", 0))
            one.connect(("127.0.0.1", page.port))
            one.sendall(f"GET /{page.token}/live HTTP/1.1\r\nHost: {page.host}\r\n\r\n".encode())
            assert b"200 OK" in one.recv(100)
        assert page.request("live", source="127.0.0.50")[0] == 503


def test_the_token_is_kept_private_and_stays(page, tmp_path):
    token = tmp_path / "state/token"
    assert token.stat().st_mode & 0o777 == 0o600
    assert len(page.token) == 22


def test_a_phone_may_ask_as_the_page_does_and_no_faster():
    now_s = 0.0
    limits = Limits(lambda: now_s)
    assert sum(limits.allows("a", write=False) for _ in range(1000)) == BURST
    now_s = 10.0
    assert sum(limits.allows("a", write=False) for _ in range(1000)) == min(BURST, 10 * PER_S)
    assert limits.allows("b", write=True)


def test_all_together_are_bounded_too():
    limits = Limits(lambda: 0.0)
    allowed = sum(limits.allows(f"10.42.0.{i % 200}", write=False) for i in range(5000))
    assert allowed == ALL_BURST


class _Connection:
    def __init__(self):
        self.is_closed, self.is_writing = False, False

    def close(self):
        self.is_closed = True

    def closed(self):
        return self.is_closed

    def writing(self):
        return self.is_writing


class _Bench:
    """Places, in which each connection is made by one word."""

    def __init__(self, most, most_of_one):
        self.now_s = 0.0
        self.places = Places(most, most_of_one, lambda: self.now_s)

    def arrive(self, address, state="stranger"):
        """A connection, or None where there is no place."""
        one = _Connection()
        if not self.places.admit(one, address):
            return None
        if state != "stranger":
            self.places.begin(one)
        if state in {"idle", "written"}:
            self.places.end(one)
        one.is_writing = state == "written"
        return one


def test_one_that_has_not_brought_the_token_gives_way_first_then_one_that_waits():
    bench = _Bench(4, 4)
    late, busy, idle, written = (
        bench.arrive("a", state) for state in ("stranger", "busy", "idle", "written")
    )
    bench.now_s = TOKEN_S + 0.1
    first = bench.arrive("b")
    assert late.is_closed
    second = bench.arrive("b")
    assert (idle.is_closed, busy.is_closed, written.is_closed) == (True, False, False)
    third = bench.arrive("c")
    assert (first.is_closed, second.is_closed, third.is_closed) == (True, False, False)


def test_of_those_in_use_one_of_the_address_with_most_gives_way():
    bench = _Bench(4, 4)
    taken = [bench.arrive(address, "busy") for address in "abaa"]
    assert bench.arrive("c", "busy")
    assert [one.is_closed for one in taken] == [True, False, False, False]
    assert bench.arrive("d", "busy") is not None
    assert [one.is_closed for one in taken] == [True, False, True, False]
    assert bench.arrive("e", "busy") is None  # all have one


def test_an_address_at_its_limit_loses_its_own_only():
    bench = _Bench(9, 2)
    other, *own = (bench.arrive(address) for address in "abb")
    assert bench.arrive("b")
    assert [one.is_closed for one in (other, *own)] == [False, True, False]
    for _ in range(2):
        bench.arrive("c", "busy")
    assert bench.arrive("c", "busy") is None
    assert not other.is_closed


def test_a_place_is_free_when_its_connection_has_ended():
    bench = _Bench(1, 1)
    bench.arrive("a", "busy").close()
    assert bench.arrive("b", "busy")


def test_the_host_is_the_address_with_its_port():
    assert host_names("10.42.0.1", 8080) == {"10.42.0.1:8080"}
    assert host_names("10.42.0.1", 80) == {"10.42.0.1:80", "10.42.0.1"}
    assert host_names("fe80::1", 8080) == {"[fe80::1]:8080"}


def test_a_token_is_made_once(tmp_path):
    token = make_token(tmp_path)
    assert make_token(tmp_path) == read_token(tmp_path) == token
    assert is_token(token, token)
    assert not is_token(token[:-1], token)
    assert not is_token("Grüße", token)


def test_what_is_wrong_with_a_token_is_said(tmp_path):
    with pytest.raises(ConfigError, match="systemctl restart fieldlogger-page"):
        page_url("10.42.0.1:8080", tmp_path)
    with pytest.raises(ConfigError, match=r"\[page\] listen"):
        page_url("", tmp_path)
    with pytest.raises(ConfigError, match="STATE_DIRECTORY"):  # of a page started by hand
        make_token(tmp_path / "none")
    (tmp_path / "token").write_text("")
    with pytest.raises(ConfigError, match="is damaged"):
        read_token(tmp_path)


@pytest.mark.parametrize("left", [b"", bytes(22), b"Qb7"])
def test_a_token_that_a_power_cut_has_damaged_gives_way_to_another(tmp_path, left):
    """The page is all that a Pi without a screen has."""
    (tmp_path / "token").write_bytes(left)
    (tmp_path / "token.part").write_bytes(left)
    token = make_token(tmp_path)
    assert make_token(tmp_path) == read_token(tmp_path) == token
    assert [file.name for file in tmp_path.iterdir()] == ["token"]
    assert (tmp_path / "token").stat().st_mode & 0o777 == 0o600


def test_the_code_is_square_and_dark_on_light():
    lines = qr_code("http://10.42.0.1:8080/abcdefghijklmnopqrstuv/").splitlines()
    assert set("".join(lines)) <= set(" ▀▄█")
    assert {len(line) for line in lines} == {len(lines[0])}
    assert len(lines) == (len(lines[0]) + 1) // 2
    assert lines[0] == "█" * len(lines[0])
