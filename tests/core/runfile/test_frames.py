import random

import pytest

from logger.core.runfile.frames import Frame, Kind, Skipped, encode, payload_of, scan

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
    assert found[0] == Skipped(5)
    assert found[2] == Skipped(4)
    assert found[4] == Skipped(4)


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


class _Counted:
    """Bytes that count how many of them are looked at."""

    def __init__(self, data):
        self._data = data
        self.n_read = 0

    def __len__(self):
        return len(self._data)

    def __getitem__(self, key):
        found = self._data[key]
        self.n_read += len(found)
        return found

    def find(self, *argv):
        return self._data.find(*argv)


def test_forged_headers_cost_one_pass_and_hide_nothing():
    """Each announces a frame that reaches to the end of the file, and none is whole."""
    from zlib import crc32

    from logger.core.runfile.frames import _CRC, _HEADER, MAGIC

    n, honest = 20_000, [encode(7, i, Kind.ROWS, b"x" * i) for i in range(40)]
    room = 28 * n
    forged = []
    for i in range(n):
        header = _HEADER.pack(MAGIC, 7, Kind.ROWS, 2, 3, i, room - 28 * (i + 1))
        forged.append(header + _CRC.pack(crc32(header)))
    data = _Counted(b"".join([*honest[:20], *forged, *honest[20:]]))
    frames = [event for event in scan(data) if isinstance(event, Frame)]
    assert [frame.number for frame in frames] == list(range(40))
    assert data.n_read < 20 * len(data)
