"""A mark that the page acknowledges is in the run, whatever happens to the recorder."""

import signal
import threading
import time
from collections import Counter
from http.client import HTTPException

import pytest

from logger.core.runfile import read_run
from logger.page.server import RECORDED_WITHIN_S
from tests.kit import page as kit
from tests.kit import service

N_PHONES = 40
N_ACKNOWLEDGED = 30


def _marks_under_load(page, meanwhile):
    """Marks of many phones at once, with the code that each got."""
    codes, ended = {}, threading.Event()

    def tap(phone):
        i = 0
        while not ended.is_set():
            text, i = f"mark {i} of {phone}", i + 1
            try:
                codes[text] = page.post("mark", text, source=f"127.0.2.{phone}")[0]
            except (OSError, HTTPException):  # the phone shows "no contact"
                codes[text] = 0

    phones = [threading.Thread(target=tap, args=(i,)) for i in range(1, N_PHONES + 1)]
    for phone in phones:
        phone.start()
    try:
        service.wait_for(lambda: list(codes.values()).count(202) >= N_ACKNOWLEDGED)
        meanwhile()
        time.sleep(2.0)
    finally:
        ended.set()
    for phone in phones:
        phone.join(4 * RECORDED_WITHIN_S)
        assert not phone.is_alive()
    return codes


@pytest.mark.parametrize("end", ["", "SIGTERM", "SIGKILL"])
def test_every_acknowledged_mark_is_in_the_run(tmp_path, monkeypatch, end):
    with kit.recorded_page(tmp_path, monkeypatch) as (page, start), start() as logger:
        service.wait_for(lambda: page.post("mark", "first")[0] == 202)

        def stop():
            if end:
                logger.send_signal(signal.Signals[end])

        codes = _marks_under_load(page, stop)
        if not end:
            logger.send_signal(signal.SIGTERM)
        logger.communicate(timeout=service.LIMIT_S)
        start_s = time.monotonic()
        status, _, content = page.post("mark", "too late", source="127.0.3.1")
        assert status == 503
        assert b"the recorder did not take it" in content
        assert time.monotonic() - start_s < 2 * RECORDED_WITHIN_S
    (path,) = (tmp_path / "runs").glob("*.journal" if end == "SIGKILL" else "*.h5")
    notes = read_run(path).tables["notes"]
    recorded = Counter(row["text"].decode() for row in notes if row["code"] == b"mark")
    counts = Counter(codes.values())
    acknowledged = {text for text, code in codes.items() if code == 202}
    print(f"{counts}; {len(recorded)} marks in the run")
    assert set(counts) <= {0, 202, 429, 503}
    assert counts[0] < 0.05 * len(codes)
    assert len(acknowledged) >= N_ACKNOWLEDGED
    assert acknowledged <= set(recorded)
    assert set(recorded.values()) == {1}


def test_what_stands_in_the_place_of_the_file_is_replaced(tmp_path, monkeypatch):
    """The page's folder is its own: another program may have left anything there."""
    with kit.recorded_page(tmp_path, monkeypatch) as (page, start), start() as logger:
        service.wait_for(lambda: page.post("mark", "first")[0] == 202)
        page.requests.unlink()
        page.requests.symlink_to("/dev/zero")
        page.requests.with_suffix(".new").write_bytes(b"\xff" * 100)
        assert page.post("mark", "second", source="127.0.0.2")[0] == 202
        page.requests.write_bytes(b"\xff\0" * 200_000 + b"\n")
        assert page.post("mark", "third", source="127.0.0.3")[0] == 202
        assert page.requests.stat().st_size < 1000
        service.stop_service(logger)
    (path,) = (tmp_path / "runs").glob("*.h5")
    notes = read_run(path).tables["notes"]
    texts = [row["text"].decode() for row in notes if row["code"] == b"mark"]
    assert texts == ["first", "second", "third"]


def test_a_full_disk_is_said(tmp_path, monkeypatch):
    with kit.recorded_page(tmp_path, monkeypatch) as (page, start), start() as logger:
        service.wait_for(lambda: page.post("mark", "first")[0] == 202)
        page.requests.unlink()
        page.requests.mkdir()
        status, _, content = page.post("mark", "second", source="127.0.0.2")
        assert (status, b"no room" in content) == (507, True)
        page.requests.rmdir()
        assert page.post("mark", "third", source="127.0.0.3")[0] == 202
        service.stop_service(logger)
