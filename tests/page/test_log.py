"""Nothing that the page prints contains its token, whatever is asked."""

import contextlib
import socket
import sys

import pytest

from tests.kit import page as kit
from tests.kit import service

FAULTY = """
import asyncio, sys
from logger import cli
from logger.page import server

class PlantedError(Exception):
    pass

class PlantedInTaskError(Exception):
    pass

async def track(self, _token):
    async def fail():
        raise PlantedInTaskError(self.request.uri)
    self.application.tasks = [asyncio.create_task(fail())]
    await asyncio.sleep(0.01)
    del self.application.tasks
    raise PlantedError(self.request.uri, self.request)

server.TrackHandler.get = track
sys.exit(cli.main(["page", *sys.argv[1:]]))
"""
"""The page with a bug whose error names the request."""


def _requests(token, host):
    """Requests with the token, each wrong in its own way."""
    encoded = "".join(f"%{ord(letter):02x}" for letter in token)
    for path in (
        f"/{token}/track?point=%ff",
        f"/{token}/track?%ff=1",
        f"/{token}/track?point={token}",
        f"/{encoded}/track?point=%ff",
        f"/{token}%ff/track",
        f"/{token}/%ff",
        f"/%ff/{token}",
        f"/{token}/runs/%00",
        f"/{token}/../{token}",
        f"http://{host}/{token}/track?point=%ff",
        f"/{token}/" + "a" * 9000,
        f"/{token}/nothing.js",
        f"/{token}/track HTTP/1.1 HTTP/1.1",
        f"/{token}/tr\x80ck",
    ):
        yield f"GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n".encode("latin-1")
    get = f"GET /{token}/track HTTP/1.1\r\nHost: {host}\r\n"
    for more in (
        token,
        f" {token}",
        f"X: \0{token}",
        f"{token}\0: x",
        f"Content-Length: {token}",
        f"Content-Length: 3, {token}",
        f"Content-Length: 3\r\nTransfer-Encoding: {token}",
        f"Transfer-Encoding: chunked\r\n\r\n{token}",
        f"Cookie: {token}=\x80; {token}",
        f"Range: bytes={token}",
        f"Expect: {token}",
        f"If-None-Match: {token}",
        f"Host: {token}",
        f"X: {token * 1000}",
    ):
        yield f"{get}{more}\r\n\r\n".encode("latin-1")
    post = f"POST /{token}/mark HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n"
    for kind, body in (
        ("application/json", b'"\xff"'),
        ("application/json", b"[" * 900),
        ("multipart/form-data", b"x"),
        (f"multipart/form-data; boundary={token}", b"x"),
        (f"multipart/form-data; boundary={token}", f"--{token}\r\nx\r\n\r\n--{token}--".encode()),
        ("multipart/form-data; boundary=a", f"--a\r\n{token}\r\n\r\nb\r\n--a--\r\n".encode()),
        ("application/x-www-form-urlencoded", f"{token}=%ff&&\xff=;".encode("latin-1")),
        (f"\xff{token}", b"x"),
    ):
        head = f"{post}Content-Type: {kind}\r\nContent-Length: {len(body)}\r\n\r\n"
        yield head.encode("latin-1") + body
    yield f"{post}Content-Encoding: gzip\r\nContent-Length: 3\r\n\r\nabc".encode()
    yield f"{token} /{token}/ HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()
    yield f"GET /{token}\r\n\r\n".encode()
    yield f"/{token}/track\r\n\r\n".encode()
    yield f"GET /{token}/track HTTP/9.9\r\n\r\n".encode()
    yield f"HEAD /{token}/runs HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()
    yield f"PUT /{token}/mark HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()
    yield f"GET /{token}/track HTTP/1.1\r\nHost: {host}\r\n\r\n".encode() * 3


@pytest.mark.parametrize("program", [(), (sys.executable, "-c", FAULTY)])
def test_no_request_brings_the_token_into_the_log(tmp_path, program):
    kit.folders(tmp_path)
    port = kit.free_port()
    table = f'[page]\nlisten = "127.0.0.1:{port}"\n'
    config = service.site_toml(tmp_path, "/dev/a", "/dev/b", table)
    with kit.page_server(tmp_path, config, port, program) as page:
        asked = list(_requests(page.token, page.host))
        answers = [_answer(page, i, request) for i, request in enumerate(asked)]
        token = page.token
        assert page.request("runs", source="127.0.3.1")[0] == 200
        page.process.terminate()
        page.process.wait(20)
    log = (tmp_path / "page.log").read_text(errors="replace")
    print(log)
    assert len(asked) > 40
    assert sum(b"HTTP/1.1" in answer for answer in answers) > 20
    assert ("PlantedError" in log) == ("PlantedInTaskError" in log) == bool(program)
    encoded = "%" + "%".join(f"{ord(letter):02x}" for letter in token)
    for secret in (token, token[:8], token[-8:], encoded[:24]):
        assert secret not in log


def _answer(page, number, request):
    """What comes back; the connection is cut then, also in the middle of an answer."""
    with socket.socket() as one, contextlib.suppress(OSError):
        one.settimeout(0.3)
        one.bind((f"127.0.2.{number + 2}", 0))
        one.connect(("127.0.0.1", page.port))
        one.sendall(request)
        return one.recv(4096)
    return b""


def test_the_end_beside_an_open_phone_is_no_error(tmp_path):
    kit.folders(tmp_path)
    port = kit.free_port()
    config = service.site_toml(
        tmp_path, "/dev/a", "/dev/b", f'[page]\nlisten = "127.0.0.1:{port}"\n'
    )
    with kit.page_server(tmp_path, config, port) as page, socket.socket() as phone:
        phone.connect(("127.0.0.1", port))
        phone.sendall(f"GET /{page.token}/live HTTP/1.1\r\nHost: {page.host}\r\n\r\n".encode())
        assert phone.recv(4096).startswith(b"HTTP/1.1 200")
        page.process.terminate()
        assert page.process.wait(20) == 0
    assert "ERROR" not in (tmp_path / "page.log").read_text()
