import random

import pytest

from logger.drivers.privacy import Blanker, blanked

SECRETS = [
    b"IMEI: 490154203237518\r\n",
    b'+CIMI: "262011234567890"\r\n',
    b"3568680000414120\r\n",
    b"+CCID: 8949001200000000000F\r\n",
    b'+CLIP: "+4915112345678",145\r\n',
    b"IMEI 49-015420-323751-8\r\n",
]
HARMLESS = [
    b'+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"\r\n',
    b"+CGNSINF: 1,1,20161124025208.000,31.222014,121.354368,114.600,0.28,0.0,1,,1.9\r\n",
    b"+CNWINFO: LTE,20820130336514,0x7C4C7,0,0,UNKOWN,UNKOWN,0,0,-99\r\n",
    b'+QENG: "NR5G-SA","TDD",310,260,170C2C5F0,684,7D3C00,520110,41,12,-90,-11,20,1,50\r\n',
    b"0000012500 [app] INFO: +CSQ: 19,99\r\n",
    b"2026-11-21 12:00:00.123456 AT\r\n",
]


@pytest.mark.parametrize("line", SECRETS)
def test_numbers_of_people_and_devices_are_blanked_whatever_the_chunks(line):
    for seed in range(50):
        rng = random.Random(seed)
        data = b"ATI\r\n" + line + b"OK\r\n"
        blanker, out = Blanker(), b""
        while data:
            n = rng.randint(1, 8)
            out, data = out + blanker.feed(data[:n]), data[n:]
        out += blanker.flush()
        assert out == b"ATI\r\n" + blanked(line) + b"OK\r\n"
        assert not any(run.isdigit() and len(run) > 8 for run in out.replace(b"F", b" ").split())
    assert len(blanked(line)) == len(line)
    assert b"xxxxxxx" in blanked(line).replace(b"-", b"")


@pytest.mark.parametrize("line", HARMLESS)
def test_what_tells_of_cells_places_and_times_is_left_alone(line):
    assert blanked(line) == line
    assert b"".join(map(Blanker().feed, (line[i : i + 1] for i in range(len(line))))) == line


def test_memory_is_bounded_in_an_endless_run_of_digits():
    blanker = Blanker()
    out = sum(len(blanker.feed(b"7" * 100)) for _ in range(100))
    assert 10_000 - 100 <= out <= 10_000
    assert b"7" not in blanker.flush()[:-20]
