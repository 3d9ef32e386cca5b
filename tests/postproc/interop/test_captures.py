"""Captures of the diagnostic stream become runs: containers, clocks, positions, names."""

import gzip
import hashlib
import json
import random
import zipfile
from pathlib import Path

import numpy as np
import pytest

from logger.core.errors import FieldLoggerError
from logger.core.runfile import read_run
from postproc.cli import main
from postproc.interop import importing
from postproc.interop.contents import members, plain_file
from postproc.interop.importing import Reading, import_walk, walks_in
from postproc.interop.readers import diag as diag_reader
from postproc.interop.readers import gsmtap, rayhunter
from postproc.interop.track_file import read_track
from postproc.smoothing import smooth_runs
from tests.kit import diag_capture as diag
from tests.kit.capture_walks import SCENES, side_by_side
from tests.kit.diag_capture import (
    EARFCN,
    IDENTITY,
    LAT,
    LON,
    NAME,
    OTHER_PCI,
    PCI,
    T0_NS,
    place,
    stream,
)
from tests.kit.diag_capture import gps_lines as lines
from tests.kit.foreign_files import damage
from tests.kit.own_memory import run_alone


def import_file(source, tmp_path, **reading):
    result = import_walk(source, tmp_path / "run.h5", **reading)
    return result, read_run(tmp_path / "run.h5")


def fixes_of(run):
    fixes = run.tables["fixes"]
    return fixes[fixes["valid"] == 1]


def test_a_rayhunter_zip_is_one_run_with_its_positions(tmp_path, capsys):
    warning = {"packet_timestamp": "2026-09-21T00:00:30Z"}
    event = {"event_type": {"type": "QualitativeWarning", "severity": "High"}}
    event["message"] = "IMSI 262011234567890 was asked for"
    analysis = json.dumps({"analyzers": []}) + "\n" + json.dumps(warning | {"events": [event]})
    source = diag.rayhunter_zip(
        tmp_path / "IMEI-356938035643809.zip",
        stream(range(60)),
        lines(range(0, 61, 5)),
        ndjson=analysis,
        pcapng=b"not read",
    )
    assert main(["import", str(source), "-o", str(tmp_path / "run.h5")]) == 0
    run = read_run(tmp_path / "run.h5")
    assert "run.h5: 120 readings, 1 remarks, 0 bad rows" in capsys.readouterr().out
    sha256 = hashlib.sha256(source.read_bytes()).hexdigest()
    assert run.meta.origin == f"import of a capture, SHA-256 {sha256}"
    assert len(run.tables["scans"]) == 60
    levels = run.tables["readings"]
    serving = levels[levels["pci"] == PCI]
    assert serving["rsrp_dbm"][3] == -82.9375  # the median of three
    assert serving["n_levels"][3] == 3
    assert set(levels["cell"]) == {NAME.encode(), b""}
    assert set(run.named_readings["cell"]) == {NAME.encode(), f"LTE-{EARFCN}-{OTHER_PCI}".encode()}
    fixes = fixes_of(run)
    assert fixes["utc_ns"].tolist() == [T0_NS + s * 10**9 for s in range(0, 61, 5)]
    notes = run.tables["notes"]["text"].tolist()
    assert any(
        b"High: IMSI ... was asked for" in text or b"high: IMSI ..." in text for text in notes
    )
    content = (tmp_path / "run.h5").read_bytes()
    assert b"356938035643809" not in content
    assert b"262011234567890" not in content


def test_the_name_of_a_capture_is_kept_on_request(tmp_path):
    (tmp_path / "street.qmdl").write_bytes(stream(range(9)))
    command = ["import", str(tmp_path / "street.qmdl"), "-o", str(tmp_path / "run.h5")]
    assert main([*command, "--keep-name"]) == 0
    assert read_run(tmp_path / "run.h5").meta.origin.startswith("import of street.qmdl, SHA-256 ")


def test_without_positions_cells_have_names_dates_and_levels(tmp_path, capsys):
    source = tmp_path / "walk.qmdl"
    source.write_bytes(stream(range(40)))
    target = str(tmp_path / "run.h5")
    assert main(["import", str(source), "-o", target]) == 0
    assert "no positions: it has none; --track adds" in capsys.readouterr().err
    assert main(["info", target]) == 0
    text = capsys.readouterr().out
    assert "2026-09-21T" in text
    assert NAME in text
    assert main(["suspect", target]) == 0


def test_a_capture_has_times(tmp_path, capsys):
    (tmp_path / "walk.qmdl").write_bytes(stream(range(9)))
    command = ["import", str(tmp_path / "walk.qmdl"), "-o", str(tmp_path / "run.h5")]
    assert main([*command, "--times", "none"]) == 2
    assert "leave out --times none" in capsys.readouterr().err


def test_a_track_gives_the_positions(tmp_path):
    (tmp_path / "walk.qmdl").write_bytes(stream(range(60)))
    (tmp_path / "gps.ndjson").write_text("".join(lines(range(0, 61, 5))))
    reading = Reading(track=read_track(tmp_path / "gps.ndjson"))
    result, run = import_file(tmp_path / "walk.qmdl", tmp_path, reading=reading)
    assert result.no_track is None
    assert len(fixes_of(run)) == 13
    late = Reading(track=read_track(tmp_path / "gps.ndjson"))
    (tmp_path / "walk.qmdl").write_bytes(stream(range(60), T0_NS + 10**13))
    result, run = import_file(tmp_path / "walk.qmdl", tmp_path, reading=late)
    assert "no points within 60 s" in result.no_track
    assert not len(fixes_of(run))


def jump(second):
    """The modem's clock is of 1980 for 20 s; it then ticks 5 s behind what it was."""
    return diag.UNIX_OF_1980_NS + 31 * 10**9 - T0_NS if second < 20 else 0


def test_a_clock_that_begins_in_1980_is_one_clock(tmp_path):
    packets = lines(range(0, 61, 5), lambda s: T0_NS + s * 10**9 + jump(s))
    source = diag.rayhunter_zip(tmp_path / "a.zip", stream(range(60), shift=jump), packets)
    result, run = import_file(source, tmp_path)
    assert result.n_rows == 120
    scans = run.tables["scans"]["t_ns"]
    assert np.all(np.abs(np.diff(scans) - 10**9) < 10)
    assert fixes_of(run)["utc_ns"].tolist() == [T0_NS + s * 10**9 for s in range(0, 61, 5)]


def test_rows_that_nothing_dates_are_left_out_and_counted(tmp_path):
    source = tmp_path / "walk.qmdl"
    source.write_bytes(stream(range(60), shift=jump))
    result, run = import_file(source, tmp_path)
    assert result.n_rows == 80
    assert ("readings of before the modem's clock was set", 40) in result.left.other
    assert len(run.tables["scans"]) == 40


def test_a_clock_that_was_never_set_still_orders_the_readings(tmp_path):
    source = tmp_path / "walk.qmdl"
    source.write_bytes(stream(range(30), diag.UNIX_OF_1980_NS))
    (tmp_path / "gps.ndjson").write_text("".join(lines(range(0, 61, 5))))
    result, run = import_file(source, tmp_path)
    assert (result.n_rows, len(run.tables["scans"])) == (60, 30)
    assert not len(run.tables["fixes"])
    track = read_track(tmp_path / "gps.ndjson")
    assert "never set" in import_file(source, tmp_path, reading=Reading(track=track))[0].no_track


def test_a_packed_recording_may_lack_its_end(tmp_path):
    packed = gzip.compress(stream(range(60)))
    source = tmp_path / "walk.qmdl.gz"
    source.write_bytes(packed)
    assert import_file(source, tmp_path)[0].n_rows == 120
    source.write_bytes(packed[: len(packed) * 2 // 3])
    result, _ = import_file(source, tmp_path)
    assert 60 < result.n_rows < 120
    assert ("damaged frames, cut", 1) in result.left.other


def test_damage_and_unknown_versions_are_counted(tmp_path, capsys):
    data = bytearray(stream(range(30)))
    data[200] ^= 1
    body = bytes([1, 1, 0, 0, 25, 47, 8, 0, 1, 2, 3, 4])
    data += diag.log_frame(0xB193, T0_NS, body) * 312 + diag.log_frame(0x11EB, T0_NS, b"packet")
    (tmp_path / "walk.qmdl").write_bytes(data)
    target = tmp_path / "run.h5"
    assert main(["import", str(tmp_path / "walk.qmdl"), "-o", str(target)]) == 0
    text = capsys.readouterr().err
    assert "0xB193 version 47: 312 not read" in text
    assert "damaged frames, CRC: 1 not read" in text
    assert "frames without levels: 1 not read" in text


def comment(second):
    lat_deg, lon_deg = place(second)
    time_s = T0_NS // 10**9 + second // 5 * 5
    return json.dumps({"unix_ts": time_s, "lat": lat_deg, "lon": lon_deg})


@pytest.mark.parametrize("order", [">", "<"])
def test_places_in_rayhunters_packets(tmp_path, order):
    packets = [
        (T0_NS + s * 10**9, 228, diag.udp_packet(b"\2\4\x0d" + bytes(13)), comment(s))
        for s in range(60)
    ]
    source = tmp_path / "walk.pcapng"
    source.write_bytes(diag.pcapng(packets, order))
    fixes = read_track(source).fixes
    assert [fix.utc_ns for fix in fixes] == [T0_NS + s * 10**9 for s in range(0, 60, 5)]
    assert [fix.lat_deg for fix in fixes] == pytest.approx([place(s)[0] for s in range(0, 60, 5)])
    beside = diag.rayhunter_zip(
        tmp_path / "a.zip", stream(range(60)), [], pcapng=source.read_bytes()
    )
    assert len(fixes_of(import_file(beside, tmp_path)[1])) == 12


def test_version_2_of_gsmtap_is_no_walk(tmp_path, capsys):
    packet = (T0_NS, 228, diag.udp_packet(b"\2\4\x0d" + bytes(13)), "")
    (tmp_path / "a.pcapng").write_bytes(diag.pcapng([packet]))
    assert main(["import", str(tmp_path / "a.pcapng"), "-o", str(tmp_path / "run.h5")]) == 2
    assert "GSMTAP version 2, which has no levels" in capsys.readouterr().err


def test_levels_of_gsmtap_version_3(tmp_path):
    key = (0x0200, b"secretsecretkey!")
    packets = []
    for s in range(20):
        level = np.array([-90.0 - s], ">f4").tobytes()
        tags = [(2, EARFCN.to_bytes(4)), (5, PCI.to_bytes(2)), key, (0x0106, level)]
        packets.append((T0_NS + s * 10**9, 228, diag.udp_packet(diag.gsmtap3(0x0403, tags)), ""))
    packets.append((T0_NS, 228, diag.udp_packet(diag.gsmtap3(0x0403, [key])), ""))
    (tmp_path / "a.pcapng").write_bytes(diag.pcapng(packets))
    result, run = import_file(tmp_path / "a.pcapng", tmp_path)
    assert run.tables["readings"]["rsrp_dbm"].tolist() == [-90.0 - s for s in range(20)]
    assert result.left.other == (("packets without a level", 1),)
    assert b"secretsecret" not in (tmp_path / "run.h5").read_bytes()


def test_a_download_that_was_cut_says_so(tmp_path, capsys):
    source = diag.rayhunter_zip(tmp_path / "a.zip", stream(range(20)), [])
    source.write_bytes(source.read_bytes()[:-10])
    assert main(["import", str(source), "-o", str(tmp_path / "run.h5")]) == 2
    assert "its end is missing: download or copy it again" in capsys.readouterr().err


def test_signals_of_a_year_do_not_end_an_import(tmp_path, monkeypatch):
    monkeypatch.setattr(importing, "MOST_REMARKS", 20)
    cipher = bytes.fromhex("803503063511")
    data = b"".join(diag.log_frame(0x512F, T0_NS + s * 10**9, cipher) for s in range(30))
    (tmp_path / "walk.qmdl").write_bytes(stream(range(30)) + data)
    result, _ = import_file(tmp_path / "walk.qmdl", tmp_path)
    assert (len(result.left.remarks), result.left.other) == (
        20,
        (("signals after the first 20", 10),),
    )


def test_signals_on_a_track_need_no_level(tmp_path, capsys):
    # a Rayhunter of before July 2026 has positions and no levels
    cipher = bytes.fromhex("803503063511")
    times_ns = [diag.UNIX_OF_1980_NS, T0_NS, T0_NS + 40 * 10**9]
    data = b"".join(diag.log_frame(0x512F, t_ns, cipher) for t_ns in times_ns)
    source = diag.rayhunter_zip(tmp_path / "a.zip", data, lines(range(0, 31, 5)))
    result, run = import_file(source, tmp_path)
    assert (result.n_rows, len(result.left.remarks), result.no_track) == (0, 2, None)
    assert result.left.other == (("remarks and signals of before the modem's clock was set", 1),)
    assert len(fixes_of(run)) == 7
    assert run.end.t_ns == run.tables["notes"]["t_ns"].max() == 40 * 10**9
    assert main(["suspect", "--signalling", str(tmp_path / "run.h5")]) == 0
    assert "GSM cipher" in capsys.readouterr().out
    late = lines(range(0, 31, 5), lambda second: T0_NS + 10**13 + second * 10**9)
    diag.rayhunter_zip(source, data, late)
    assert "no points within 60 s" in import_file(source, tmp_path)[0].no_track


def test_a_zip_whose_member_is_cut_says_so(tmp_path, capsys):
    source = diag.rayhunter_zip(tmp_path / "a.zip", b"", [])
    data = bytearray(source.read_bytes())
    at = data.index(b"PK\1\2")
    for field in (20, 24):  # sizes in the table of contents
        data[at + field : at + field + 4] = (9000).to_bytes(4, "little")
    data[at + 10 : at + 12] = data[8:10] = bytes(2)  # stored
    source.write_bytes(data)
    assert main(["import", str(source), "-o", str(tmp_path / "run.h5")]) == 2
    assert "its end is missing: download or copy it again" in capsys.readouterr().err


def test_positions_survive_a_power_cut_and_any_order(tmp_path):
    # a file system leaves zeros of a line that was not yet written
    written = lines(range(0, 61, 5))
    written[3], written[7] = "\0\0\0\n", '{"lat": 47.0, "lon": 15.4\n'
    random.Random(1).shuffle(written)
    source = diag.rayhunter_zip(tmp_path / "a.zip", stream(range(60)), written)
    result, run = import_file(source, tmp_path)
    assert fixes_of(run)["utc_ns"].tolist() == [
        T0_NS + s * 10**9 for s in range(0, 61, 5) if s not in {15, 35}
    ]
    assert result.left.other == (("lines of positions that have none", 2),)


def test_positions_as_rayhunter_wrote_them_first(tmp_path):
    # with the time of the phone alone
    written = [
        json.dumps({"unix_ts": T0_NS // 10**9 + s, "lat": place(s)[0], "lon": place(s)[1]}) + "\n"
        for s in range(0, 61, 5)
    ]
    source = diag.rayhunter_zip(tmp_path / "a.zip", stream(range(60)), written)
    assert fixes_of(import_file(source, tmp_path)[1])["utc_ns"].tolist() == [
        T0_NS + s * 10**9 for s in range(0, 61, 5)
    ]
    (tmp_path / "track.txt").write_text("".join(written))
    assert len(read_track(tmp_path / "track.txt").fixes) == 13


def test_timing_advances_of_a_capture_bound_the_distance(tmp_path):
    # levels that hardly change say little; an access each 20 s says no farther than 6 x 78 m
    regions_km2 = []
    for ta_16ts in (None, 5, 199):
        data = b""
        for second in range(120):
            t_ns = T0_NS + second * 10**9
            if second % 20 == 0:
                data += diag.log_frame(0xB0C2, t_ns, diag.serving_identity(EARFCN, PCI, IDENTITY))
            level_dbm = -90.0 + second % 5
            data += diag.log_frame(0xB17F, t_ns + 10**8, diag.serving_cell(EARFCN, PCI, level_dbm))
            if ta_16ts is not None and second % 20 == 10:
                access = diag.random_access(ta_16ts)
                data += diag.log_frame(0xB062, t_ns + 2 * 10**8, access)
        zipped = diag.rayhunter_zip(tmp_path / "a.zip", data, lines(range(0, 121, 5)))
        run = import_file(zipped, tmp_path)[1]
        (cell,) = smooth_runs([run], [NAME]).cells
        assert (cell.timing is None) == (ta_16ts is None)
        if cell.timing:
            assert (cell.timing.places, cell.timing.disagree) == (3, 0)
        regions_km2.append(cell.posterior.region_area_m2 / 1e6)
    without, near, by_fibre = regions_km2
    assert near < 0.6 * without
    assert by_fibre > 0.8 * without


def test_a_typed_position_is_no_walk(tmp_path):
    fixed = [diag.gps_line(T0_NS + s * 10**9, T0_NS + s * 10**9, LAT, LON) for s in range(9)]
    source = diag.rayhunter_zip(tmp_path / "a.zip", stream(range(9)), fixed)
    result, run = import_file(source, tmp_path)
    assert "one fixed position, which is no walk" in result.no_track
    assert not len(fixes_of(run))


def test_recordings_of_one_zip_become_runs_of_their_own(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for number in "12":
            archive.writestr(f"{number}.qmdl", stream(range(9)))
            archive.writestr(f"{number}-gps.ndjson", "".join(lines(range(0, 11, 5))))
    assert main(["import", str(tmp_path / "a.zip"), "-o", str(tmp_path / "walk.h5")]) == 0
    for number in "12":
        assert len(fixes_of(read_run(tmp_path / f"walk-{number}.h5"))) == 3
    assert len(list(tmp_path.glob("*.h5"))) == 2


def errors_m(seeds, folder, scene="passed"):
    """Errors of a capture and of AT on the same walks; printed."""
    pairs = [side_by_side(seed, folder, scene) for seed in seeds]
    print(*pairs, sep="\n")
    return [(one.capture.error_m, one.at.error_m) for one in pairs]


def test_a_capture_locates_as_well_as_at(tmp_path):
    ((capture_m, at_m),) = errors_m([1], tmp_path)
    assert capture_m <= at_m + 15.0


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_captures_locate_as_well_as_at(scene, tmp_path):
    capture_m, at_m = np.array(errors_m(range(16), tmp_path, scene)).T
    print(f"{scene}: median {np.median(capture_m):.0f} m, by AT {np.median(at_m):.0f} m")
    assert np.median(capture_m) <= 1.2 * np.median(at_m)


def fuzz(sources, n, seed, tmp_path):
    """Damaged files are read or refused by an error of ours."""
    rng = random.Random(seed)
    n_read = 0
    for i in range(n):
        name, data = sources[i % len(sources)]
        path = tmp_path / name
        path.write_bytes(damage(data, rng))
        try:
            if name.endswith(".pcapng"):
                n_read += bool(list(gsmtap.read(path))) or bool(gsmtap.positions(path))
            elif name.endswith(".ndjson"):
                n_read += bool(rayhunter.positions(path)[0])
            elif name.endswith(".zip"):
                sizes = walks_in(members(path))
                with plain_file(path, next(iter(sizes), "none")) as plain:
                    n_read += bool(list(diag_reader.read(plain)))
            else:
                n_read += bool(list(diag_reader.read(path)))
        except FieldLoggerError:
            continue
    return n_read


@pytest.fixture
def sources(tmp_path):
    """A small file of each kind."""
    level = np.array([-90.0], ">f4").tobytes()
    tags = [(2, EARFCN.to_bytes(4)), (5, PCI.to_bytes(2)), (0x0106, level)]
    packets = [
        (T0_NS, 228, diag.udp_packet(diag.gsmtap3(0x0403, tags)), comment(s)) for s in range(3)
    ]
    path = diag.rayhunter_zip(tmp_path / "small.zip", stream(range(2)), lines(range(0, 11, 5)))
    return [
        ("a.pcapng", diag.pcapng(packets)),
        ("b.zip", path.read_bytes()),
        ("c.qmdl", stream(range(2))),
        ("d-gps.ndjson", "".join(lines(range(0, 11, 5))).encode()),
    ]


def test_damaged_files(sources, tmp_path):
    assert fuzz(sources, 1_000, 1, tmp_path) > 100


@pytest.mark.slow
@pytest.mark.parametrize("kind", range(4), ids=["pcapng", "zip", "qmdl", "positions"])
def test_a_million_damaged_files(kind, sources, tmp_path):
    fuzz([sources[kind]], 1_000_000, 2 + kind, tmp_path)


def import_one(arguments):
    """Import a file as another."""
    import_walk(*map(Path, arguments))


def more_mb(small, large, tmp_path):
    """Memory that a large file takes beyond a small one, in MB."""
    of_small, of_large = (
        run_alone(f"{__name__}:import_one", path, tmp_path / "run.h5").more_mb
        for path in (small, large)
    )
    return of_large - of_small


@pytest.mark.parametrize(
    "n_mb", [20, pytest.param(1000, marks=pytest.mark.slow)], ids=["20 MB", "1 GB"]
)
def test_a_large_capture_is_read_as_a_stream(tmp_path, n_mb):
    small, large = tmp_path / "small.qmdl", tmp_path / "large.qmdl"
    part = stream(range(60)) + diag.log_frame(0x11EB, T0_NS, bytes(1500)) * 600
    small.write_bytes(part)
    with large.open("wb") as file:
        for _ in range(n_mb * 1_000_000 // len(part)):
            file.write(part)
    assert more_mb(small, large, tmp_path) < 64
