"""Messages in captures: identities, reported levels, evidence, and that nobody's number is kept."""

import random
import re
import struct
import sys
from collections import Counter
from pathlib import Path
from statistics import median

import pytest

from logger.core.cell_names import Identity
from logger.core.runfile import read_run
from logger.drivers.diag.frames import FrameReader, LogRecord
from logger.drivers.diag.levels import ALLOWED_CODES, Decoder
from postproc.cli import main
from postproc.interop.readers import diag as reader
from postproc.interop.readers.diag import CODES, NAS_DOWN, NAS_UP, RRC, Messages
from postproc.suspicion.signalling import UNKNOWN, Signal, signals_of
from tests.kit import diag_capture as diag

CAPTURES = Path("../shared/captures")
needs_captures = pytest.mark.skipif(not CAPTURES.is_dir(), reason="captures stay outside")
T_NS = 1_790_028_000 * 10**9
SECOND_NS = 10**9
EARFCN, PCI = 1300, 17
BCCH, PCCH, DL_CCCH, DL_DCCH, UL_CCCH, UL_DCCH = 2, 5, 6, 7, 8, 9
"""Channels of version 20."""


def rrc_body(channel, message, earfcn=EARFCN, pci=PCI, version=20):
    """Body of B0C0."""
    head = struct.pack("<BBBBHIHBIH", version, 14, 48, 0, pci, earfcn, 0, channel, 0, len(message))
    return head + message


def encode(kind, message):
    from pycrate_asn1dir import RRCLTE

    form = getattr(RRCLTE.EUTRA_RRC_Definitions, kind)
    form.set_val({"message": message})
    return form.to_uper()


def plmn(text):
    mcc, mnc = text.split("-")
    return {"mcc": [int(d) for d in mcc], "mnc": [int(d) for d in mnc]}


def sib1(plmns, area=4711, cell_id=26_214_401):
    networks = [
        {"plmn-Identity": plmn(one), "cellReservedForOperatorUse": "notReserved"} for one in plmns
    ]
    access = {
        "plmn-IdentityList": networks, "trackingAreaCode": (area, 16),
        "cellIdentity": (cell_id, 28), "cellBarred": "notBarred",
        "intraFreqReselection": "allowed", "csg-Indication": False,
    }  # fmt: skip
    content = {
        "cellAccessRelatedInfo": access, "cellSelectionInfo": {"q-RxLevMin": -61},
        "freqBandIndicator": 3, "schedulingInfoList": [
            {"si-Periodicity": "rf8", "sib-MappingInfo": ["sibType3"]}
        ], "si-WindowLength": "ms10", "systemInfoValueTag": 1,
    }  # fmt: skip
    return encode("BCCH_DL_SCH_Message", ("c1", ("systemInformationBlockType1", content)))


def information(*blocks):
    content = {"criticalExtensions": ("systemInformation-r8", {"sib-TypeAndInfo": list(blocks)})}
    return encode("BCCH_DL_SCH_Message", ("c1", ("systemInformation", content)))


def sib3(priority):
    return "sib3", {
        "cellReselectionInfoCommon": {"q-Hyst": "dB4"},
        "cellReselectionServingFreqInfo": {
            "threshServingLow": 2, "cellReselectionPriority": priority,
        },
        "intraFreqCellReselectionInfo": {
            "q-RxLevMin": -61, "presenceAntennaPort1": True, "neighCellConfig": (2, 2),
            "t-ReselectionEUTRA": 2,
        },
    }  # fmt: skip


def sib6(*priorities):
    carriers = [
        {
            "carrierFreq": 10_600 + one, "cellReselectionPriority": one, "threshX-High": 7,
            "threshX-Low": 15, "q-RxLevMin": -60, "p-MaxUTRA": 24, "q-QualMin": -24,
        }
        for one in priorities
    ]  # fmt: skip
    return "sib6", {"carrierFreqListUTRA-FDD": carriers, "t-ReselectionUTRA": 2}


def downlink(kind, release, content):
    parts = {"rrc-TransactionIdentifier": 0, "criticalExtensions": ("c1", (release, content))}
    return encode("DL_DCCH_Message", ("c1", (kind, parts)))


def configuration(**content):
    kind = "rrcConnectionReconfiguration"
    return downlink(kind, f"{kind}-r8", {k.replace("_", "-"): v for k, v in content.items()})


def measurements(carriers):
    """Each measurement of an object with its own number."""
    objects = [
        {
            "measObjectId": number,
            "measObject": ("measObjectEUTRA", {
                "carrierFreq": carrier, "allowedMeasBandwidth": "mbw50",
                "presenceAntennaPort1": True, "neighCellConfig": (2, 2),
            }),
        }
        for number, carrier in carriers.items()
    ]  # fmt: skip
    ids = [{"measId": n, "measObjectId": n, "reportConfigId": 1} for n in carriers]
    return {"measObjectToAddModList": objects, "measIdToAddModList": ids}


def report(number, serving, neighbours):
    cells = [{"physCellId": code, "measResult": {"rsrpResult": step}} for code, step in neighbours]
    results = {
        "measId": number, "measResultPCell": {"rsrpResult": serving, "rsrqResult": 20},
        "measResultNeighCells": ("measResultListEUTRA", cells),
    }  # fmt: skip
    parts = {"criticalExtensions": ("c1", ("measurementReport-r8", {"measResults": results}))}
    return encode("UL_DCCH_Message", ("c1", ("measurementReport", parts)))


def release(target=None):
    content = {"releaseCause": "other"}
    if target is not None:
        content["redirectedCarrierInfo"] = target
    return downlink("rrcConnectionRelease", "rrcConnectionRelease-r8", content)


GERAN = (
    "geran",
    {
        "startingARFCN": 62,
        "bandIndicator": "dcs1800",
        "followingARFCNs": ("explicitListOfARFCNs", []),
    },
)


def security(cipher, integrity):
    algorithms = {"cipheringAlgorithm": cipher, "integrityProtAlgorithm": integrity}
    config = {"securityConfigSMC": {"securityAlgorithmConfig": algorithms}}
    return downlink("securityModeCommand", "securityModeCommand-r8", config)


def feed(parts, messages=None):
    """What messages say, one a second: each a channel of RRC or a code, and its bytes."""
    messages = messages or Messages()
    heard = []
    for i, (what, message, *cell) in enumerate(parts):
        body = rrc_body(what, message, *cell) if what < 100 else b"\1\x09\5\0" + message
        code = RRC if what < 100 else what
        heard += messages.feed(LogRecord(code, 0, T_NS + i * SECOND_NS, body))
    return heard, messages


def signals(heard):
    return [(one.kind, one.value) for one in heard if isinstance(one, Signal)]


def levels(heard):
    return [
        (one.channel, one.code, one.role, one.level_dbm)
        for one in heard
        if not isinstance(one, Signal) and one.is_reported
    ]


def test_a_shared_cell_has_one_name():
    heard, messages = feed([(BCCH, sib1(["262-02", "262-01"]))])
    first = Identity("262", "02", 4711, 26_214_401)
    assert [one.identity for one in heard] == [first]
    body = diag.serving_identity(EARFCN, PCI, ("262", "01", 4711, 26_214_401))
    (serving,) = Decoder().feed(LogRecord(0xB0C2, 0, T_NS, body))
    assert serving.identity.mnc == "01"
    assert messages.with_first_name(serving).identity == first
    heard, _ = feed([(DL_DCCH, release())], messages)
    assert heard[0].operator == "262-02"


def test_reported_neighbours_are_on_the_carrier_that_is_measured():
    heard, messages = feed(
        [
            (UL_DCCH, report(2, 40, [(100, 44)])),  # the capture began later than the connection
            (DL_DCCH, configuration(measConfig=measurements({1: EARFCN, 2: 2850}))),
            (UL_DCCH, report(1, 40, [(18, 44), (19, 0), (20, 97)])),
            (UL_DCCH, report(2, 40, [(100, 44)])),
        ]
    )
    serving = EARFCN, PCI, "serving", -100.5
    assert levels(heard) == [
        serving,
        (None, 100, "neighbour", -96.5),
        serving,
        (EARFCN, 18, "neighbour", -96.5),
        (EARFCN, 19, "neighbour", None),
        (EARFCN, 20, "neighbour", None),
        serving,
        (2850, 100, "neighbour", -96.5),
    ]
    assert messages.n_unnamed == 1


@pytest.mark.parametrize("later_s", [301, -301])
def test_a_capture_behind_another_knows_nothing_of_its_carriers(later_s):
    configured = rrc_body(DL_DCCH, configuration(measConfig=measurements({1: EARFCN, 2: 2850})))
    reported = rrc_body(UL_DCCH, report(2, 40, [(100, 44)]))
    refused = LogRecord(NAS_DOWN, 0, T_NS + later_s * SECOND_NS, bytes.fromhex("01000000074407"))
    messages = Messages()
    messages.feed(LogRecord(RRC, 0, T_NS, configured))
    (signal,) = messages.feed(refused)
    assert signal.cell == UNKNOWN
    messages.feed(refused._replace(code=RRC, body=reported))
    assert messages.n_unnamed == 1


def test_a_handover_exchanges_the_carriers():
    common = {"targetPhysCellId": 100, "carrierFreq": {"dl-CarrierFreq": 2850}, "t304": "ms100",
              "newUE-Identity": (18251, 16), "radioResourceConfigCommon": {
                  "prach-Config": {"rootSequenceIndex": 1},
                  "pusch-ConfigCommon": {
                      "pusch-ConfigBasic": {"n-SB": 1, "hoppingMode": "interSubFrame",
                                            "pusch-HoppingOffset": 0, "enable64QAM": True},
                      "ul-ReferenceSignalsPUSCH": {
                          "groupHoppingEnabled": True, "groupAssignmentPUSCH": 0,
                          "sequenceHoppingEnabled": False, "cyclicShift": 0}},
                  "ul-CyclicPrefixLength": "len1"}}  # fmt: skip
    algorithms = {"cipheringAlgorithm": "eea0", "integrityProtAlgorithm": "eia2"}
    intra = {
        "securityAlgorithmConfig": algorithms, "keyChangeIndicator": False,
        "nextHopChainingCount": 1,
    }  # fmt: skip
    heard, _ = feed(
        [
            (DL_DCCH, configuration(measConfig=measurements({1: EARFCN, 2: 2850}))),
            (DL_DCCH, configuration(
                mobilityControlInfo=common,
                securityConfigHO={"handoverType": ("intraLTE", intra)},
            )),
            (UL_DCCH, report(1, 40, [(101, 44)]), 2850, 100),
            (UL_DCCH, report(2, 40, [(18, 44)]), 2850, 100),
            (DL_DCCH, release(), 2850, 100),
            (UL_DCCH, report(2, 40, [(18, 44)]), 2850, 100),
        ]
    )  # fmt: skip
    neighbours = [one for one in levels(heard) if one[2] == "neighbour"]
    assert [one[:2] for one in neighbours] == [(2850, 101), (EARFCN, 18), (None, 18)]
    assert signals(heard) == [("handover security", "EEA0 EIA2"), ("release", "no redirection")]


def test_evidence_of_signalling():
    identity_request, response = bytes.fromhex("075501"), bytes.fromhex("0756082926107856341200")
    heard, messages = feed(
        [
            (BCCH, sib1(["262-01"])),
            (BCCH, information(sib3(4), sib6(2, 6))),
            (BCCH, information(sib3(4), sib6(2, 6))),  # said once
            (DL_CCCH, b"\x40\0"),
            (NAS_DOWN, identity_request),
            (NAS_UP, response),
            (NAS_DOWN, b"\7\x55\3"),
            *[(PCCH, b"")] * 11,
            (NAS_DOWN, b"\7\x5d\x02"),
            (NAS_DOWN, b"\7\x44\x0f"),
            (NAS_DOWN, b"\7\x54"),
            (NAS_DOWN, b"\x27\x44\x0f"),  # protected: its bytes are no message
            (DL_DCCH, security("eea2", "eia1")),
            (DL_DCCH, release(GERAN)),
            (NAS_DOWN, identity_request),
        ]
    )
    assert signals(heard) == [
        ("SIB6 priority", "highest 6, own 4"),
        ("reject", "RRC connection"),
        ("identity request", "IMSI, answered"),
        ("identity request", "IMEISV, not answered"),
        ("NAS security", "EEA0 EIA2"),
        ("reject", "attach, cause 15"),
        ("reject", "authentication"),
        ("RRC security", "EEA2 EIA1"),
        ("release", "to GERAN"),
    ]
    assert signals(messages.end()) == [("identity request", "IMSI, not answered")]
    found = [one for one in heard if isinstance(one, Signal)]
    assert {(one.cell, one.operator) for one in found} == {(f"LTE-{EARFCN}-{PCI}", "262-01")}


def test_the_cipher_of_gsm_is_a_signal_of_its_cell():
    messages, decoder = Messages(), Decoder()
    cell = bytes.fromhex("10800401187662f220014100ff")
    heard = []
    for code, body in (
        (0x512F, "8035030635" + "11"),  # of no cell that was named
        (0x5134, cell.hex()),
        (0x512F, "8035030635" + "11"),
        (0x512F, "8035030635" + "15"),
        (0x512F, "8035030635" + "10"),
        (0x5B2F, "00" + "8035030635" + "10"),
        (0x512F, "0032020632"),  # the answer, and another command
        (0x512F, "803f03063f11"),
        (0x512F, "80350206" + "35"),
    ):
        record = LogRecord(code, 0, T_NS, bytes.fromhex(body))
        for one in decoder.feed(record):
            messages.with_first_name(one)
        heard += messages.feed(record)
    said = [(one.value, one.cell, one.operator) for one in heard]
    here = "GSM-16-12", "262-02"
    assert said == [("A5/1", "unknown", "unknown"), ("A5/1", *here), ("A5/3", *here)] + 2 * [
        ("A5/0", *here)
    ]
    assert {one.kind for one in heard} == {"GSM cipher"}


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"\x14",
        rrc_body(BCCH, b"\xff" * 9),
        rrc_body(UL_DCCH, b"\x08"),
        rrc_body(DL_DCCH, b"\x28"),
        rrc_body(BCCH, sib1(["262-01"]) if reader.find_spec("pycrate_asn1dir") else b"")[:-1],
        rrc_body(BCCH, b"", pci=504),
        rrc_body(BCCH, b"", earfcn=262_144),
    ],
)
def test_a_message_that_cannot_be_is_counted(body):
    messages = Messages()
    assert messages.feed(LogRecord(RRC, 0, T_NS, body)) == []
    assert messages.refused.total() + messages.unknown.total() == 1


def test_an_unknown_version_of_a_message_is_counted():
    messages = Messages()
    for version in (0, 21, 30, 99):
        messages.feed(LogRecord(RRC, 0, T_NS, rrc_body(BCCH, b"", version=version)))
    messages.feed(LogRecord(NAS_DOWN, 0, T_NS, b"\2\0\0\0\7\x44\x0f"))
    assert messages.unknown == {
        **{(RRC, version): 1 for version in (0, 21, 30, 99)}, (NAS_DOWN, 2): 1,
    }  # fmt: skip


def test_without_pycrate_the_rest_is_read(monkeypatch, tmp_path, capsys):
    stream = diag.log_frame(0xB17F, T_NS, diag.serving_cell(EARFCN, PCI, -80.0))
    for message in (sib1(["262-01"]), information(sib3(3))):
        stream += diag.log_frame(RRC, T_NS, rrc_body(BCCH, message))
    stream += diag.log_frame(RRC, T_NS, rrc_body(DL_DCCH, release(GERAN)))
    source = tmp_path / "capture.qmdl"
    source.write_bytes(stream)
    monkeypatch.setattr(reader, "find_spec", lambda _: None)
    assert main(["import", str(source), "-o", str(tmp_path / "run.h5")]) == 0
    said = capsys.readouterr().err
    # of this Python, which knows our version: another would install a stranger's cellwalk
    advice = f"(pycrate is missing: {sys.executable} -m pip install 'cellwalk[diag]')"
    assert said.count(f"messages that need pycrate: 2 not read {advice}") == 1
    run = read_run(tmp_path / "run.h5")
    assert not any(sys.executable.encode() in note["text"] for note in run.tables["notes"])
    assert len(run.tables["readings"]) == 1
    assert [one.value for one in signals_of([run])] == ["to GERAN"]


def read(name):
    frames, decoder, messages = FrameReader(ALLOWED_CODES | CODES), Decoder(), Messages()
    records = frames.feed((CAPTURES / name).read_bytes())
    return records, list(reader._read_all(records, decoder, messages)), messages


def reported_by_bits(message):
    """Serving level and neighbours of a report, read bit by bit (3GPP TS 36.331 6.2.2)."""
    bits = "".join(f"{byte:08b}" for byte in message)
    at = 0

    def take(n):
        nonlocal at
        at += n
        return int(bits[at - n : at] or "0", 2)

    assert take(5) == 1
    assert take(4) == 0
    take(1)
    is_longer, has_neighbours, _, serving, _ = take(1), take(1), take(5), take(7), take(6)
    if not has_neighbours or is_longer or take(3):
        return serving, None
    cells = []
    for _ in range(take(3) + 1):
        if take(1):
            return serving, None  # with the identity of the cell
        code = take(9)
        is_longer, has_rsrp, has_rsrq = take(1), take(1), take(1)
        cells.append((code, take(7) if has_rsrp else 0))
        take(6 * has_rsrq)
        if is_longer:
            return serving, None
    return serving, cells


def in_dbm(step):
    """The middle of a step (3GPP TS 36.133 9.1.4); the first and the last have none."""
    return step - 140.5 if 0 < step < 97 else None


PUBLISHED = [
    (
        "140e300109019c1800000000090000000018000810a7145359a6054368c03bda3004a688028da2009a6840",
        (6300, 265),
        (39, [(214, 38), (323, 35), (239, 35), (74, 34), (163, 34), (154, 33)]),
    ),
    (
        (
            "0f0d21019e0014050000000009000000001c000810a5346141a31c316804401a0049167c23159f00"
            "1067c106d9e000"
        ),
        (1300, 158),
        (37, [(80, 35), (49, 32), (256, 32), (145, 31), (197, 31), (16, 31), (27, 30)]),
    ),
]
# of the tests of SCAT and Rayhunter: reports, their cell, its step and those of its neighbours


@pytest.mark.parametrize(("record", "cell", "steps"), PUBLISHED)
def test_published_reports(record, cell, steps):
    serving, neighbours = steps
    body = bytes.fromhex(record)
    assert reported_by_bits(body[19:]) == (serving, neighbours)
    assert levels(Messages().feed(LogRecord(RRC, 0, T_NS, body))) == [
        (*cell, "serving", in_dbm(serving)),
        *((None, code, "neighbour", in_dbm(step)) for code, step in neighbours),
    ]


def test_other_published_messages():
    # version 6 in 16 bits of a channel, a release, and a version that Rayhunter reads as 25
    messages = Messages()
    heard = [
        one
        for record in (
            "0609b10007012c0725340202000000120040498805c09702d3b0981c20a0818c4326d0",
            "080a72010e009c180000a933060000000002002e02",
            "1a0f400f40010e011307000000000b0000000002001015",
            "1e112011400132001914000016ad090000000002000000004c10",
        )
        for one in messages.feed(LogRecord(RRC, 0, T_NS, bytes.fromhex(record)))
    ]
    broadcast, release = heard
    assert (broadcast.channel, broadcast.code) == (1836, 263)
    assert broadcast.identity == Identity("262", "02", 49303, 2_964_233)
    assert release[1:4] == ("release", "no redirection", "LTE-6300-14")
    assert messages.unknown == {(RRC, 30): 1}
    assert messages._cells == {0: "LTE-1811-270"}


@needs_captures
@pytest.mark.parametrize(
    ("highest", "counts"), [(0xFFFF, (32, 733, 289)), (262_143, (34, 786, 327))]
)
def test_identities_and_reports_of_attaches(highest, counts):
    # captures' README has the first: its decoder knows no channel beyond 16 bits (band 66)
    records, _, _ = read("attach_sample.mi2log")
    messages, identities, n_reports = Messages(), [], 0
    for record in records:
        heard = [one for one in messages.feed(record) if not isinstance(one, Signal)]
        if heard and int.from_bytes(record.body[6:10], "little") <= highest:
            n_reports += heard[0].is_reported
            identities += [heard[0].identity] if heard[0].identity else []
    assert (len(set(identities)), len(identities), n_reports) == counts
    assert messages.refused == messages.unknown == {}


@needs_captures
def test_identities_and_reports_of_a_drive():
    records, heard, messages = read("mobility_sample.mi2log")
    assert messages.refused == messages.unknown == {}
    broadcast = [one for one in heard if not isinstance(one, Signal) and one.identity]
    broadcast = {o.identity for o in broadcast if o.role == "neighbour" and not o.is_reported}
    assert len(broadcast) == 157
    n_reports = n_neighbours = 0
    messages = Messages()
    for record in records:
        reported = levels(messages.feed(record))
        if not reported:
            continue
        serving, neighbours = reported_by_bits(record.body[19:])
        n_reports += 1
        assert reported[0][2:] == ("serving", in_dbm(serving))
        if neighbours is not None:
            n_neighbours += len(neighbours)
            assert [(code, level_dbm) for _, code, _, level_dbm in reported[1:]] == [
                (code, in_dbm(step)) for code, step in neighbours
            ]
    assert n_reports == 1215
    assert n_neighbours > 1400


@needs_captures
def test_filtered_levels_of_a_modem_are_those_that_it_reports():
    """Word 4 of B193 version 36 is what the modem filtered, for reports in steps of 1 dB."""
    records, heard, _ = read("bler_sample.mi2log")
    filtered = [
        (
            r.time_ns,
            struct.unpack_from("<IHH", r.body, 8)[0],
            struct.unpack_from("<H", r.body, 16)[0] & 511,
            (struct.unpack_from("<I", r.body, 48)[0] >> 12 & 0xFFF) / 16 - 180.0,
        )
        for r in records
        if r.code == 0xB193
    ]
    reported = [o for o in heard if not isinstance(o, Signal) and o.is_reported]
    apart_db = []
    for one in reported:
        if one.role != "serving":
            continue
        near = [f for f in filtered if f[1:3] == (one.channel, one.code) and f[0] <= one.time_ns]
        if near and one.time_ns - near[-1][0] < SECOND_NS // 4:
            apart_db.append(near[-1][3] - one.level_dbm)
    assert len(apart_db) > 30
    assert abs(median(apart_db)) <= 0.3
    assert max(map(abs, apart_db)) < 1.5


@needs_captures
def test_bits_of_release_and_security_are_those_that_pycrate_reads():
    n = Counter()
    for name in ("mobility_sample.mi2log", "attach_sample.mi2log", "bler_sample.mi2log"):
        records, heard, _ = read(name)
        found = {(o.time_ns, o.kind): o.value for o in heard if isinstance(o, Signal)}
        for record in records:
            if record.code != RRC or record.body[12] not in {6, 7}:
                continue
            kind = record.body[19] >> 3 & 15
            if record.body[12] != (6 if record.body[0] == 8 else 7) or kind not in {5, 6}:
                continue
            content = reader._decode("DL_DCCH_Message", lambda m: m, record.body[19:])
            _, parts = content["message"][1]
            parts = parts["criticalExtensions"][1][1]
            if kind == 6:
                algorithms = parts["securityConfigSMC"]["securityAlgorithmConfig"]
                expected = " ".join(one.upper()[:4] for one in algorithms.values())
                assert found[record.time_ns, "RRC security"] == expected
            else:
                has_target = "redirectedCarrierInfo" in parts
                value = found[record.time_ns, "release"]
                assert (value != "no redirection") == has_target
            n[kind] += 1
    assert n[5] > 20
    assert n[6] > 50


@needs_captures
def test_measurements_alone_are_those_of_the_whole_message(monkeypatch):
    parts = []
    decode = reader._decode

    def keep(form, take, body):
        parts.append((form, decode(form, take, body)))
        return parts[-1][1]

    monkeypatch.setattr(reader, "_decode", keep)
    for record in FrameReader(CODES).feed((CAPTURES / "attach_sample.mi2log").read_bytes()):
        before = len(parts)
        Messages().feed(record)
        if parts[before:] and parts[before][0] == "MeasConfig":
            whole = decode("DL_DCCH_Message", reader._configuration, record.body[19:])
            assert whole == parts[before][1]
    assert sum(form == "MeasConfig" for form, _ in parts) > 50


@needs_captures
def test_a_message_that_comes_again_is_decoded_once(monkeypatch):
    records, _, messages = read("attach_sample.mi2log")
    assert len(messages._decoded) > 500
    monkeypatch.setattr(reader, "_decode", lambda *_: pytest.fail("decoded again"))
    for record in records:
        messages.feed(record)


IMSI, IMEI, NUMBER = "262017654321098", "358917264935716", "4917698765432"
TMSI, KEY, ADDRESS, TEXT = 0xC0FFEE42, 0x9D3BA7C15EF20846, "10.47.201.83", "Treffpunkt Bahnhof"


def semi_octets(digits):
    """Semi-octets, as in NAS, a SIM and an SMS."""
    digits += "F" * (len(digits) % 2)
    return bytes.fromhex("".join(digits[i + 1] + digits[i] for i in range(0, len(digits), 2)))


def mobile_identity(digits, kind=1):
    """3GPP TS 24.008 10.5.1.4: the first digit shares its byte with the kind."""
    return bytes([int(digits[0]) << 4 | 8 | kind]) + semi_octets(digits[1:])


def forms(digits):
    """A number in all the ways in which a message may have it."""
    return (
        semi_octets(digits), mobile_identity(digits), digits.encode(),
        digits.encode().hex().encode(), digits.encode("utf-16-le"), digits.encode("utf-16-be"),
        bytes(map(int, digits)),
    )  # fmt: skip


SECRETS = (
    *(form for digits in (IMSI, IMEI, NUMBER) for form in forms(digits)),
    *(struct.pack(order + "I", TMSI) for order in "<>"),
    *(struct.pack(order + "Q", KEY) for order in "<>"),
    *(ADDRESS.encode(encoding) for encoding in ("ascii", "utf-16-le")),
    bytes(map(int, ADDRESS.split("."))),
    *(TEXT.encode(encoding) for encoding in ("ascii", "utf-16-le", "utf-16-be")),
)


def in_every_place(secret):
    """Records that have the secret wherever one of them can have it."""
    nas = secret + b"\0"
    transfers = {
        DL_DCCH: downlink("dlInformationTransfer", "dlInformationTransfer-r8",
                          {"dedicatedInfoType": ("dedicatedInfoNAS", nas)}),
    }  # fmt: skip
    config = {"measConfig": measurements({1: EARFCN}), "dedicatedInfoNASList": [nas]}
    uplink = {"criticalExtensions": ("c1", ("ulInformationTransfer-r8", {
        "dedicatedInfoType": ("dedicatedInfoNAS", nas)}))}  # fmt: skip
    yield RRC, rrc_body(DL_DCCH, transfers[DL_DCCH])
    yield RRC, rrc_body(DL_DCCH, configuration(**config))
    yield (
        RRC,
        rrc_body(UL_DCCH, encode("UL_DCCH_Message", ("c1", ("ulInformationTransfer", uplink)))),
    )
    for channel in range(1, 11):
        yield RRC, rrc_body(channel, secret)
    for kind in range(16):  # the kind of a message on DL-DCCH and UL-DCCH, then the secret
        yield RRC, rrc_body(DL_DCCH, bytes([kind << 3]) + secret)
        yield RRC, rrc_body(UL_DCCH, bytes([kind << 3]) + secret)
    for code in (0xB0E2, 0xB0E3, NAS_DOWN, NAS_UP, 0xB0E5, 0xB0EE, 0x713A, 0x7B3A):
        for kind in (0x41, 0x42, 0x44, 0x48, 0x4B, 0x50, 0x52, 0x55, 0x56, 0x5D, 0x62, 0x63):
            yield code, b"\1\x09\5\0\7" + bytes([kind]) + secret
        yield code, b"\1\x09\5\0" + secret
    for code in (0x11EB, 0x1098, 0x1272, 0x14CE, 0x156E, 0x4168, 0x4169, 0x412F, 0x1391):
        yield code, secret
    for first in (0x80, 0x81, 0x83, 0x84, 0, 1, 2, 3, 4):
        for kind in (0x1A, 0x1B, 0x21, 0x27, 0x35, 0x3F):
            layer3 = bytes([0x49, 6, kind]) + secret
            yield 0x512F, bytes([first, kind, len(layer3)]) + layer3
            yield 0x5B2F, bytes([0, first, kind, len(layer3)]) + layer3
    for code in sorted(ALLOWED_CODES):
        yield code, secret
        yield code, b"\1\1\0\0" + secret
    levels = diag.serving_cell(EARFCN, PCI, -80.0)
    yield 0xB17F, levels[:28] + secret.ljust(12, b"\0")  # memory that the modem did not clear
    yield 0xB0C2, diag.serving_identity(EARFCN, PCI, ("262", "01", 4711, 26_214_401)) + secret
    access = b"\1\0\1\0\1\7".ljust(15, b"\0") + struct.pack("<H", 5) + secret
    yield 0xB062, struct.pack("<BBHBBH", 1, 1, 0, 6, 3, len(access) + 4) + access


def in_text(secret):
    """How a program may print it."""
    printed = {secret.hex(), secret.hex(" "), repr(secret)[2:-1], str(list(secret))[1:-1]}
    printed |= {str(int.from_bytes(secret[:8], order)) for order in ("big", "little")}
    return {one.lower() for one in printed if len(one) > 7}


def test_nobodys_number_is_kept_printed_or_shared(tmp_path, capsysbinary):
    """Each secret in each place of each message: in the run, what is said of it, and copies."""
    stream, n = b"", 0
    for i in range(30):
        t_ns = T_NS + i * SECOND_NS
        body = diag.serving_identity(EARFCN, PCI, ("262", "01", 4711, 26_214_401))
        stream += diag.log_frame(0xB0C2, t_ns, body)
        stream += diag.log_frame(0xB17F, t_ns, diag.serving_cell(EARFCN, PCI, -80.0 - i))
    stream += diag.log_frame(RRC, T_NS, rrc_body(BCCH, sib1(["262-01"])))
    stream += diag.log_frame(NAS_DOWN, T_NS, bytes.fromhex("010905000755") + b"\1")
    for secret in SECRETS:
        for code, body in in_every_place(secret):
            n += 1
            stream += diag.log_frame(code, T_NS + 30 * SECOND_NS + n * 10**6, body)
    assert n > 50 * len(SECRETS)
    source, run_path = tmp_path / f"{IMEI}.qmdl", tmp_path / "run.h5"
    source.write_bytes(stream)
    gps = [diag.gps_line(T_NS + s * SECOND_NS, T_NS + s * SECOND_NS, 47.07 + s * 1e-4, 15.44)
           for s in range(0, 60, 5)]  # fmt: skip
    zipped = diag.rayhunter_zip(tmp_path / f"{IMEI}.zip", stream, gps)
    said = b""
    for arguments in (
        ["import", str(zipped), "-o", str(run_path), "--json"],
        ["import", str(source), "-o", str(tmp_path / "second.h5")],
        ["info", str(run_path)],
        ["info", str(run_path), "--json"],
        ["suspect", str(run_path)],
        ["suspect", str(run_path), "--signalling"],
        ["suspect", str(run_path), "--signalling", "--json"],
        ["export", str(run_path), "--output-dir", str(tmp_path / "exported")],
        ["share", str(run_path), "-o", str(tmp_path / "shared.h5"), "--blur-m", "50"],
    ):
        main(arguments)
        out, err = capsysbinary.readouterr()
        said += out + err
    runs = [read_run(tmp_path / name) for name in ("run.h5", "second.h5", "shared.h5")]
    assert any(one.kind == "identity request" for one in signals_of(runs))
    stored = b"".join(rows.tobytes() for run in runs for rows in run.tables.values())
    stored += b"".join(repr(run.meta).encode() for run in runs)
    stored += b"".join(
        p.read_bytes() for p in tmp_path.rglob("*") if p.is_file() and p not in {source, zipped}
    )
    text = (said + stored).decode("latin-1").lower()
    text = re.sub(re.escape(str(tmp_path).lower()) + r"/" + IMEI, "", text)
    for digits in (IMSI, IMEI, NUMBER, ADDRESS, TEXT.lower()):
        assert digits not in text
    for secret in SECRETS:
        assert secret not in stored
        assert not [one for one in in_text(secret) if one in text]


def check_any_messages(n, seed):
    rng = random.Random(seed)
    messages = Messages()
    right = [
        (RRC, rrc_body(BCCH, sib1(["262-02", "262-01"]))),
        (RRC, rrc_body(BCCH, information(sib3(4), sib6(2, 6)))),
        (RRC, rrc_body(DL_DCCH, configuration(measConfig=measurements({1: EARFCN, 2: 2850})))),
        (RRC, rrc_body(UL_DCCH, report(1, 40, [(18, 44), (19, 3)]))),
        (RRC, rrc_body(DL_DCCH, release(GERAN))),
        (NAS_DOWN, b"\1\x09\5\0\7\x55\1"),
    ]
    for i in range(n):
        code, body = rng.choice(right)
        damaged = bytearray(body)
        for _ in range(rng.randrange(1, 4)):
            # behind the length, or everywhere
            first = rng.choice([0, 19]) if code == RRC else 0
            damaged[rng.randrange(first, len(damaged))] = rng.randrange(256)
        for one in messages.feed(LogRecord(code, i % 2, T_NS + i * 10**7, bytes(damaged))):
            assert isinstance(one, Signal) or one.code is None or 0 <= one.code <= 503
    assert messages.refused


def test_no_message_is_too_strange():
    check_any_messages(3000, 1)


@pytest.mark.slow
def test_no_message_of_many_is_too_strange():
    check_any_messages(200_000, 2)
