"""Recorded logs: every epoch is one fix."""

import itertools
import random
import re

import pytest

from logger.drivers.protocols.nmea import MAX_SENTENCE, FixAssembler, NmeaFramer, Sentence

# fixes with GGA, without GGA, without a position; sentences of GGA and of RMC; stretches without a
# position

LOGS = {
    "01_google_ublox-F9K_drive_2020": (1142, 0, 0, 1142, 1142, 0),
    "06_gpsd_telit-he910_modem-gnss_2019": (224, 0, 37, 224, 224, 1),
    "07_gpsd_quectel-eg25-g_modem-gnss_2022": (60, 0, 37, 60, 60, 3),
    "09_gpsd_quectel-l76k-dual_binary-mixed_2026": (130, 0, 0, 130, 130, 0),
    # 16 void RMC, of which 7 have their GGA, and 3 epochs with GGA only or first
    "10_gpsd_gp-320fw_week-rollover_coldboot_2019": (10, 9, 17, 10, 16, 1),
    # cut out of a longer one: the last epoch ends before its GGA
    "12_gpsd_bt451_indoor-to-car_2009": (17, 1, 4, 17, 17, 1),
    "14_gpsd_unicore-um621_lose-regain_2024": (20, 0, 4, 20, 20, 1),
}


@pytest.mark.parametrize("log", LOGS)
def test_recorded_log(corpus, log):
    data = (corpus / "nmea" / f"{log}.nmea").read_bytes()
    framer, assembler = NmeaFramer(), FixAssembler()
    sentences = [
        e
        for i in range(0, len(data), 997)
        for e in framer.feed(data[i : i + 997])
        if isinstance(e, Sentence)
    ]
    found = [fix for t, s in enumerate(sentences) for fix in assembler.feed(s, t)] + list(
        assembler.flush()
    )
    kinds = [match[1] for s in sentences if (match := re.match(r"\$..(GGA|RMC)", s.text))]
    without_gga = sum(fix.quality is None for _, fix in found)
    counts = (len(found) - without_gga, without_gga, sum(not fix.valid for _, fix in found))
    stretches = sum(not valid for valid, _ in itertools.groupby(fix.valid for _, fix in found))
    assert (*counts, kinds.count("GGA"), kinds.count("RMC"), stretches) == LOGS[log]
    assert [t for t, _ in found] == sorted({t for t, _ in found})
    assert not any(fix.lat_deg == 0.0 for _, fix in found)
    assert all(fix.utc_ns is None or fix.utc_ns >= 1_577_836_800 * 10**9 for _, fix in found)


@pytest.mark.parametrize("log", LOGS)
def test_damaged_log_gives_fixes_or_noise_and_keeps_little(corpus, log):
    data = bytearray((corpus / "nmea" / f"{log}.nmea").read_bytes()[:100_000])
    chance = random.Random(log)
    for _ in range(len(data) // 50):
        data[chance.randrange(len(data))] = chance.randrange(256)
    framer, assembler, at = NmeaFramer(), FixAssembler(), 0
    while at < len(data):
        size = chance.randrange(1, 60)
        for event in framer.feed(bytes(data[at : at + size])):
            for _, fix in assembler.feed(event, at) if isinstance(event, Sentence) else ():
                assert fix.valid is (fix.lat_deg is not None)
        at += size
        assert len(framer._tail) <= MAX_SENTENCE + 10


def test_recorded_log_utc_runs_with_its_own_clock(corpus):
    data = (corpus / "nmea" / "01_google_ublox-F9K_drive_2020.nmea").read_bytes()
    assembler = FixAssembler()
    times = [
        fix.utc_ns
        for s in NmeaFramer().feed(data)
        if isinstance(s, Sentence)
        for _, fix in assembler.feed(s, 0)
    ]
    steps = {b - a for a, b in itertools.pairwise(times)}
    assert steps >= {s * 10**9 for s in (1, 6, 10, 19, 40)}
    assert all(step > 0 and step % 10**9 == 0 for step in steps)
