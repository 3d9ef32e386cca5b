import pytest

from logger.core.errors import ConfigError
from logger.page.server import ALL_BURST, BURST, PER_S, TOKEN_S, Limits, Places, host_names
from logger.page.token import is_token, make_token, page_url, qr_code, read_token


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
    (tmp_path / "token").write_text("")
    with pytest.raises(ConfigError, match="is damaged"):
        make_token(tmp_path)


def test_the_code_is_square_and_dark_on_light():
    lines = qr_code("http://10.42.0.1:8080/abcdefghijklmnopqrstuv/").splitlines()
    assert set("".join(lines)) <= set(" ▀▄█")
    assert {len(line) for line in lines} == {len(lines[0])}
    assert len(lines) == (len(lines[0]) + 1) // 2
    assert lines[0] == "█" * len(lines[0])
