import pytest

from logger.core.errors import ConfigError
from logger.page.guard import ALL_BURST, BURST, PER_S, Limits, host_names
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
