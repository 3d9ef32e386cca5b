import random
from zlib import crc32

import pytest

from logger.core.runfile.frames import (
    _CRC,
    _HEADER,
    HEADER_SIZE,
    MAGIC,
    ForgedFramesError,
    Frame,
    Kind,
    encode,
    payload_of,
    scan,
)

PAYLOADS = [b"", b"x", b"CWJ1 looks like a magic", bytes(300), random.Random(1).randbytes(2000)]
FRAMES = [encode(7, i, Kind.ROWS, payload) for i, payload in enumerate(PAYLOADS)]
WHOLE = b"".join(FRAMES)
FRAMES_START = len(FRAMES[0])
ENDS = [sum(map(len, FRAMES[: i + 1])) for i in range(len(FRAMES))]


def _frames(data):
    return [event for event in scan(data) if isinstance(event, Frame)]


def _payload(data, frame):
    return payload_of(data[frame.start : frame.start + frame.length], frame.version)


def test_whole():
    assert [_payload(WHOLE, f) for f in _frames(WHOLE)] == PAYLOADS
    assert [f.number for f in _frames(WHOLE)] == list(range(5))
    assert all(isinstance(event, Frame) for event in scan(WHOLE))


def test_zeros_ahead_are_no_damage():
    assert list(scan(WHOLE + bytes(3_000_000))) == list(scan(WHOLE))


def test_every_truncation_keeps_every_whole_frame():
    for cut in range(len(WHOLE)):
        assert len(_frames(WHOLE[:cut])) == sum(end <= cut for end in ENDS)


def test_noise_between_frames_is_counted():
    found = list(scan(b"noise" + FRAMES[1] + b"CWJ1" + FRAMES[4] + b"tail"))
    assert found[0] == 5
    assert found[2] == 4
    assert found[4] == 4


@pytest.mark.parametrize("seed", range(300))
def test_a_flipped_bit_costs_one_frame_only(seed):
    rng = random.Random(seed)
    damaged = bytearray(WHOLE)
    at = rng.randrange(len(damaged))
    damaged[at] ^= 1 << rng.randrange(8)
    hit = next(i for i, end in enumerate(ENDS) if at < end)
    assert [f.number for f in _frames(bytes(damaged))] == [i for i in range(5) if i != hit]


@pytest.mark.parametrize("seed", range(200))
def test_no_splice_invents_a_frame(seed):
    rng = random.Random(seed)
    pieces = [WHOLE[slice(*sorted(rng.sample(range(len(WHOLE)), 2)))] for _ in range(6)]
    data = b"".join(pieces)
    assert all(_payload(data, frame) == PAYLOADS[frame.number] for frame in _frames(data))


def test_what_is_no_payload_in_spite_of_its_crc_is_none():
    assert payload_of(b"not packed", 2) is None
    assert payload_of(WHOLE[FRAMES_START:][:10], 2) is None
    assert payload_of(b"plain", 1) == b"plain"


def test_forged_headers_are_refused_at_once():
    """Each announces a frame that reaches to the end of the file: hours of checksums."""
    n, honest = 20_000, [encode(7, i, Kind.ROWS, b"x" * i) for i in range(40)]
    room = HEADER_SIZE * n
    forged = []
    for i in range(n):
        header = _HEADER.pack(MAGIC, 7, Kind.ROWS, 2, 3, i, room - HEADER_SIZE * (i + 1))
        forged.append(header + _CRC.pack(crc32(header)))
    found = scan(b"".join([*honest[:20], *forged, *honest[20:]]))
    assert [next(found).number for _ in range(20)] == list(range(20))
    with pytest.raises(ForgedFramesError, match="longer than the file"):
        next(found)
