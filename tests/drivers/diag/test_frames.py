"""Frames of the diagnostic stream: damaged, cut anywhere, in a wrapper."""

import random
import struct
from pathlib import Path

import pytest

from logger.drivers.diag.frames import FrameReader, LogRecord, is_stream
from tests.kit.diag_capture import frame, log_frame, log_packet

CAPTURES = Path("../shared/captures")
CODES = frozenset({0xB193, 0xB0C2, 0xB17F})
T_NS = 1_700_000_000 * 10**9
PAGING, RRC = 0x11EB, 0xB0C0


def records(n, rng):
    """Records of allowed codes with bodies of all bytes; their times are whole ticks."""
    for i in range(n):
        body = rng.randbytes(rng.choice([0, 1, 30, 200]))
        radio_id = rng.choice([None, 1, 2])
        yield LogRecord(rng.choice(sorted(CODES)), radio_id or 0, T_NS + i * 1_250_000, body)


def stream_of(some, rng):
    """The frames of records, some in a wrapper, and where each begins."""
    frames = [log_frame(r.code, r.time_ns, r.body, r.radio_id or None) for r in some]
    return b"".join(frames), frames


def read(data, codes=CODES):
    reader = FrameReader(codes)
    found = reader.feed(data)
    reader.end()
    return found, reader


def test_records_are_read_as_written():
    rng = random.Random(1)
    some = list(records(500, rng))
    found, reader = read(stream_of(some, rng)[0])
    assert found == some
    assert (reader.n_records, reader.n_other, reader.damaged, reader.skipped) == (500, 0, {}, {})


def test_a_stream_may_be_cut_anywhere():
    rng = random.Random(2)
    some = list(records(12, rng))
    data, frames = stream_of(some, rng)
    for cut in range(len(data)):
        reader = FrameReader(CODES)
        found = reader.feed(data[:cut])
        assert found == some[: len(found)]
        assert found + reader.feed(data[cut:]) == some
    for begin in range(0, len(data), 7):  # of a stream that began earlier one record is lost
        found, _ = read(data[begin:])
        n_whole = sum(sum(map(len, frames[:k])) >= begin for k in range(len(frames)))
        assert found == some[len(some) - n_whole :]


def test_bytes_one_by_one():
    rng = random.Random(3)
    some = list(records(20, rng))
    reader = FrameReader(CODES)
    assert [one for byte in stream_of(some, rng)[0] for one in reader.feed(bytes([byte]))] == some


def most_lost(n, seed):
    """How many records one damaged byte or bit cost at most; fails for one that is believed."""
    rng = random.Random(seed)
    some = list(records(60, rng))
    data, _ = stream_of(some, rng)
    known = set(some)
    n_lost = [0] * 3
    for _ in range(n):
        at = rng.randrange(len(data))
        window = max(0, at - 800), min(len(data), at + 800)
        whole, _ = read(data[window[0] : window[1]])
        changed = bytearray(data[window[0] : window[1]])
        value = changed[at - window[0]]
        other = (
            value ^ 1 << rng.randrange(8)
            if rng.random() < 0.5
            else rng.choice([0x7E, 0x7D, rng.randrange(256)])
        )
        changed[at - window[0]] = other
        found, _ = read(bytes(changed))
        assert set(found) <= known, "a damaged record was believed"
        n_lost[len(whole) - len(found)] += 1
    return n_lost


def test_a_damaged_byte_costs_at_most_one_record():
    kept, lost, more = most_lost(2_000, 4)
    assert more == 0
    assert lost > kept


@pytest.mark.slow
def test_100_000_damaged_bytes():
    assert most_lost(100_000, 5)[2] == 0


def test_other_codes_stay_where_they_are():
    secret = b"262011234567890"
    data = log_frame(PAGING, T_NS, secret) + log_frame(0xB193, T_NS, b"level")
    reader = FrameReader(CODES)
    assert [one.code for one in reader.feed(data)] == [0xB193]
    assert reader.skipped == {PAGING: 1}
    assert secret not in repr(vars(reader)).encode()


@pytest.mark.parametrize(
    ("packet", "reason"),
    [
        (log_packet(0xB193, T_NS, b"x" * 20)[:-1], "lengths"),
        (log_packet(0xB193, T_NS, b"x" * 20) + b"y", "lengths"),
        (log_packet(0xB193, T_NS, b"")[:10], "lengths"),
        (
            log_packet(0xB193, T_NS, b"")[:4] + b"\xff\xff" + log_packet(0xB193, T_NS, b"")[6:],
            "lengths",
        ),
        (log_packet(0xB193, T_NS, b"")[:8] + b"\xff" * 8, "lengths"),
    ],
)
def test_a_right_frame_with_wrong_lengths_is_no_record(packet, reason):
    found, reader = read(frame(packet))
    assert not found
    assert reader.damaged == {reason: 1}


def test_other_packets_and_what_is_no_frame():
    data = frame(b"\x79hello") + b"\x7e\x7e" + frame(b"") + frame(b"\x10") + frame(b"\x98\x01")
    found, reader = read(data + b"\x10cut")
    assert not found
    assert reader.n_other == 3
    assert reader.damaged == {"cut": 1}


def test_memory_stays_bounded_without_an_end():
    reader = FrameReader(CODES)
    for _ in range(40):
        assert not reader.feed(b"\x10" * 100_000)
    assert reader.damaged == {"longer than any frame": 1}
    good = log_frame(0xB193, T_NS, b"level")
    assert not reader.feed(b"rest\x7e")
    assert len(reader.feed(good)) == 1


def test_what_a_stream_looks_like():
    assert is_stream(b"rest\x7e" + log_frame(PAGING, T_NS, b"x"))
    assert is_stream(log_frame(PAGING, T_NS, b"x", radio_id=1) + b"cut")
    assert not is_stream(frame(b"\x79hello"))
    assert not is_stream(random.Random(6).randbytes(100_000))
    assert not is_stream(b"")


def test_rayhunters_frames():
    # of the tests of EFForg/rayhunter, lib/src: a frame, a time, and packets that ended it
    assert frame(bytes([1, 2, 3, 4])) == bytes([1, 2, 3, 4, 145, 57, 126])
    time = struct.pack("<Q", 72_659_535_985_485_082)
    packet = struct.pack("<BBHHH", 16, 0, 12, 12, 0xB193) + time
    ((_, _, time_ns, _),) = read(frame(packet))[0]
    assert abs(time_ns - 1_701_835_466_227 * 10**6) < 10**6
    for cut in (
        "10000000050000000000000000000000",
        "10001400020093b10000000000000000000100" + "00",
        "10001400020093b100000000000000000300",
    ):
        found, reader = read(frame(bytes.fromhex(cut)))
        assert (found, reader.damaged.total() + reader.skipped.total()) == ([], 1)


def fuzz(n, seed):
    """Random bytes, and frames with right sums around random packets."""
    rng = random.Random(seed)
    reader = FrameReader(CODES)
    for _ in range(n):
        match rng.randrange(4):
            case 0:
                data = rng.randbytes(rng.randrange(60))
            case 1:
                data = frame(rng.randbytes(rng.randrange(40)))
            case 2:
                data = frame(rng.choice([b"\x10", b"\x98"]) + rng.randbytes(rng.randrange(40)))
            case _:
                packet = bytearray(
                    log_packet(
                        0xB193, T_NS, rng.randbytes(rng.randrange(20)), rng.choice([None, 1])
                    )
                )
                packet[rng.randrange(len(packet))] = rng.randrange(256)
                data = frame(bytes(packet))
        for record in reader.feed(data):
            assert record.code in CODES
            assert 0 <= record.time_ns < 1 << 62


def test_any_bytes():
    fuzz(5_000, 7)


@pytest.mark.slow
def test_a_million_inputs():
    fuzz(1_000_000, 8)


@pytest.mark.skipif(not CAPTURES.is_dir(), reason="needs ../shared/captures")
def test_every_frame_of_a_telephone_with_two_receivers():
    found, reader = read((CAPTURES / "mi10_20201116_165145.mi2log").read_bytes(), frozenset({RRC}))
    assert len(found) == reader.n_records + reader.n_other + reader.skipped.total() == 1754
    assert {one.radio_id for one in found} == {1, 2}
    assert not reader.damaged
