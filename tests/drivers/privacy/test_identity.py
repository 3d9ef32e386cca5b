import pytest

from logger.drivers.privacy.redaction import redact
from logger.drivers.registry import FAMILIES, IDENTITY, family_of
from logger.sim.modem import frame_text
from tests.drivers.test_claims import answers_of
from tests.kit.dialects import DIALECTS


@pytest.mark.parametrize("name", FAMILIES)
def test_a_modem_is_identified_by_what_is_left_of_its_answers(name):
    for answer in answers_of(name):
        for command in IDENTITY:
            left = redact(f"\r\n{answer}\r\n\r\nOK\r\n".encode(), command).decode()
            assert family_of(left).name == name, left


@pytest.mark.parametrize("before", [b"", b"\r\n+XNEW: 1\r\n", b"\r\nStarting the stack\r\n"])
@pytest.mark.parametrize("name", DIALECTS)
def test_a_simulated_modem_is_identified_also_after_a_line_that_nobody_knows(name, before):
    whole, left = "", ""
    for command, blocks in DIALECTS[name].identity.items():
        reply = before + frame_text(*blocks, "OK")
        whole += reply.decode()
        left += redact(reply, f"AT{command}").decode()
    assert family_of(left) == family_of(whole)
    assert (DIALECTS[name].identity["+CGMM"][0] in left) or before


def test_what_a_modem_prints_of_itself_loses_its_serial_numbers_alone():
    ati = (
        b"\r\nManufacturer: Sierra Wireless, Incorporated\r\nModel: MC7455\r\n"
        b"Revision: SWI9X30C_02.24.05.06 r7040 CARMD-EV-FRMWR2 2017/05/19 06:23:09\r\n"
        b"MEID: 35907206022883\r\nIMEI: 359072060228832\r\nIMEI SV: 17\r\nFSN: LF728387390410\r\n"
        b"+GCAP: +CGSM\r\n\r\nOK\r\n"
    )
    left = (
        ati.replace(b"35907206022883", b"x" * 14)
        .replace(b"x2\r", b"xx\r")
        .replace(b"SV: 17", b"SV: xx")
        .replace(b"LF728387390410", b"x" * 14)
    )
    out = redact(ati, "ATI")
    assert out.replace(b"+xxxx", b"+CGSM") == left
    unknown = b"\r\nACME 2000\r\n\r\nOK\r\n\r\nVersion 1.0.3 build A7\r\n\r\nOK\r\n"
    assert redact(unknown, "ATI") == unknown
    assert redact(b"Example\r\n", "AT+CGMI") == b"Example\r\n"
