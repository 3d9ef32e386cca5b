import json
import os
import pty
import signal
import socket
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import read_run, unfinished_journals
from logger.core.types import LiveEstimate
from logger.device.service import _learn
from logger.sim.ptys import PtyDevice, answering
from postproc.replay import replay
from tests.kit import service
from tests.kit.recorded_replies import NmeaPlayer, TranscriptModem
from tests.kit.simulated_devices import simulated_devices


def _only_run(folder):
    (run,) = (folder / "runs").glob("run-*.h5")
    return read_run(run)


def _notes(run):
    return [row["code"].decode() for row in run.tables["notes"]]


def test_real_drive_and_real_replies_are_recorded_whole(tmp_path, corpus):
    """The F9K drive and every SIM800/SIM900 CENG reply of the corpus through real ptys: none lost,
    none invented.
    """
    expected = [e for e in json.loads((corpus / "modem/expected.json").read_text()) if _is_ceng(e)]
    replies = [(corpus / "modem" / e["file"]).read_bytes() for e in expected]
    nmea = (corpus / "nmea/01_google_ublox-F9K_drive_2020.nmea").read_bytes()
    player, modem = NmeaPlayer(nmea), TranscriptModem(replies)
    with PtyDevice(player) as gnss, PtyDevice(answering(modem)) as port:
        with service.running_service(service.site_toml(tmp_path, port.path, gnss.path)) as logger:
            service.wait_for(lambda: player.finished.is_set() and modem.served == len(replies), 120)
            service.wait_for(lambda: _journal_has(tmp_path, "fixes", 1142))
            service.stop_service(logger)
    run = _only_run(tmp_path)
    assert run.end.reason == "signal SIGTERM"
    fixes = run.tables["fixes"]
    assert (len(fixes), int(fixes["valid"].sum())) == (1142, 1142)
    raw = run.tables["raw"]
    incoming = raw[(raw["source"] == b"gnss") & (raw["sent"] == 0)]
    assert run.bytes_of(incoming) == nmea
    assert _identities(run.tables["readings"]) == Counter(
        _key(row) for e in expected for row in e["expected"]
    )
    assert replay(run).equal


def _has_marked_scan(folder) -> bool:
    """Whether the journal has a scan beside a fix."""
    try:
        runs = [read_run(path) for path in (folder / "runs").glob("*.journal")]
    except RunFileError:
        return False
    return any((run.tables["scans"]["fix_seq"] >= 0).any() for run in runs)


def _is_ceng(entry) -> bool:
    return entry["dialect"].startswith(("simcom_sim800_ceng", "simcom_sim900_ceng"))


def _journal_has(folder, table, n) -> bool:
    try:
        return any(len(read_run(p).tables[table]) >= n for p in (folder / "runs").glob("*.journal"))
    except RunFileError:
        return False  # made, and not yet written for the first time


def _key(row):
    return row["role"], row["mcc"], row["lac"], row.get("cid"), row["rxlev_raw"]


def _identities(readings) -> Counter:
    def is_known(value):
        return None if value == -1 else int(value)

    return Counter(
        (
            r["role"].decode(),
            r["mcc"].decode() or None,
            is_known(r["lac"]),
            is_known(r["cid"]),
            is_known(r["rxlev_raw"]),
        )
        for r in readings
    )


@pytest.mark.parametrize("missing", ["modem", "gnss"])
def test_starts_with_a_device_missing_and_picks_it_up(tmp_path, missing):
    names = {name: str(tmp_path / name) for name in ("modem", "gnss")}
    player, modem = (
        NmeaPlayer(service.nmea_epochs(10_000), bytes_per_s=3000),
        TranscriptModem([service.CENG] * 100_000),
    )
    with PtyDevice(player) as gnss, PtyDevice(answering(modem)) as port:
        ptys = {"modem": port.path, "gnss": gnss.path}
        present = "gnss" if missing == "modem" else "modem"
        os.symlink(ptys[present], names[present])
        first, later = ("fixes", "scans") if missing == "modem" else ("scans", "fixes")
        # a fix holds for longer than a busy machine keeps the receiver waiting
        site = service.site_toml(
            tmp_path, names["modem"], names["gnss"], "[live]\nmax_fix_age_s = 600.0\n"
        )
        with service.running_service(site) as logger:
            service.wait_for(lambda: _journal_has(tmp_path, first, 5))
            assert not _journal_has(tmp_path, later, 1)
            os.symlink(ptys[missing], names[missing])
            service.wait_for(lambda: _has_marked_scan(tmp_path))
            service.stop_service(logger, signal.SIGINT)
    run = _only_run(tmp_path)
    assert run.end.reason == "signal SIGINT"
    assert _notes(run).count("port-lost") == 1
    assert _notes(run).count("port-opened") == 2
    fix_seq = run.tables["scans"]["fix_seq"]
    assert (fix_seq[0] == -1) == (missing == "gnss")
    marked = fix_seq != -1
    assert marked.any()
    assert marked.tolist() == sorted(marked.tolist())


_IN_A_TERMINAL = """
import os, sys
os.login_tty(int(sys.argv[1]))
os.execv(sys.executable, [sys.executable, *sys.argv[2:]])
"""


def test_it_goes_on_when_its_terminal_goes(tmp_path):
    player = NmeaPlayer(service.nmea_epochs(10_000), bytes_per_s=1600)
    terminal, far_end = pty.openpty()
    with PtyDevice(player) as gnss:
        site = service.site_toml(tmp_path, str(tmp_path / "none"), gnss.path)
        run = (*service.FIELDLOGGER[1:], "run", "--config", str(site))
        command = (sys.executable, "-c", _IN_A_TERMINAL, str(far_end), *run)
        with subprocess.Popen(command, pass_fds=(far_end,)) as logger:
            os.close(far_end)
            service.wait_for(lambda: _journal_has(tmp_path, "fixes", 5))
            os.close(terminal)
            n_before = service.n_recorded(tmp_path / "runs", "fixes")
            service.wait_for(lambda: _journal_has(tmp_path, "fixes", n_before + 20))
            logger.terminate()
    assert _only_run(tmp_path).end.reason == "signal SIGTERM"


def test_duration_ends_it_cleanly(tmp_path):
    player, modem = (
        NmeaPlayer(service.nmea_epochs(10_000), bytes_per_s=160),
        TranscriptModem([service.CENG] * 100_000),
    )
    with PtyDevice(player) as gnss, PtyDevice(answering(modem)) as port:
        with service.running_service(
            service.site_toml(tmp_path, port.path, gnss.path), "--duration", "6"
        ) as logger:
            out, _ = logger.communicate(timeout=service.LIMIT_S)
    assert logger.returncode == 0
    run = _only_run(tmp_path)
    assert out.strip() == str(run.path)
    assert run.end.reason == "duration of 6.0 s over"
    live = [r.value for _, r in run.records("live") if isinstance(r.value, LiveEstimate)]
    assert live
    assert {estimate.cell for estimate in live} == {"262-01-4711-12345"}
    assert "target-locked" in _notes(run)
    assert replay(run).equal


def test_rows_that_come_unasked_are_recorded_once(tmp_path):
    """A modem left in mode 2 by somebody else: it never answers, but its rows are cells."""
    burst = service.CENG.replace(b"OK\r\n", b"").replace(b"\r\n+CENG: 1,1\r\n", b"")
    player = NmeaPlayer(
        burst * 20
    )  # at once: each serving cell begins a scan, however long its bytes take
    with PtyDevice(NmeaPlayer(service.nmea_epochs(1000), 400)) as gnss, PtyDevice(player) as port:
        with service.running_service(service.site_toml(tmp_path, port.path, gnss.path)) as logger:
            service.wait_for(player.finished.is_set)
            service.wait_for(lambda: _journal_has(tmp_path, "readings", 40))
            service.stop_service(logger)
    run = _only_run(tmp_path)
    assert len(run.tables["readings"]) == 40
    assert len(run.tables["scans"]) == 20


def test_noise_is_counted_not_obeyed(tmp_path):
    noise = np.random.default_rng(5).integers(128, 256, 5000, dtype=np.uint8).tobytes()
    player = NmeaPlayer(noise + b"\r\n" + service.nmea_epochs(20))
    with PtyDevice(player) as gnss, PtyDevice(NmeaPlayer(noise)) as port:
        with service.running_service(service.site_toml(tmp_path, port.path, gnss.path)) as logger:
            service.wait_for(lambda: _journal_has(tmp_path, "fixes", 20))
            service.stop_service(logger)
    run = _only_run(tmp_path)
    assert len(run.tables["fixes"]) == 20
    assert not len(run.tables["readings"])
    assert "garbage" in _notes(run)
    raw = run.tables["raw"]
    assert int(raw["length"][raw["source"] == b"gnss"].sum()) == len(noise) + 2 + len(
        service.nmea_epochs(20)
    )


def test_a_receiver_behind_a_socket(tmp_path):
    """Ports are anything that pyserial opens; the modem is missing all the while."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"socket://127.0.0.1:{server.getsockname()[1]}"
        with service.running_service(
            service.site_toml(tmp_path, str(tmp_path / "none"), url)
        ) as logger:
            peer, _ = server.accept()
            with peer:
                # opening a port throws away what has come before
                service.wait_for(lambda: _journal_has(tmp_path, "notes", 2))
                peer.sendall(service.nmea_epochs(50))
                service.wait_for(lambda: _journal_has(tmp_path, "fixes", 50))
                service.stop_service(logger)
    assert len(_only_run(tmp_path).tables["fixes"]) == 50


def test_a_run_is_closed_after_its_longest_time(tmp_path):
    with simulated_devices() as (modem, gnss, _):
        config = service.site_toml(tmp_path, modem.path, gnss.path)
        text = config.read_text().replace("[modem]", "longest_h = 0.001\n[modem]", 1)
        config.write_text(text)
        with service.running_service(config) as logger:
            assert logger.wait(60) == 0
    assert _only_run(tmp_path).end.reason == "duration of 3.6 s over"


def test_the_next_run_does_not_wait_for_the_hdf5_file_of_the_last(tmp_path, monkeypatch):
    with service.systemd(monkeypatch, tmp_path), simulated_devices() as (modem, gnss, _):
        config = service.site_toml(tmp_path, modem.path, gnss.path)
        text = config.read_text().replace("[modem]", "longest_h = 0.001\n[modem]", 1)
        config.write_text(text)
        with service.running_service(config) as logger:
            assert logger.wait(60) == 0
    (journal,) = (tmp_path / "runs").glob("*.journal")
    assert not list((tmp_path / "runs").glob("*.h5"))
    assert unfinished_journals(tmp_path / "runs") == [journal]  # for fieldlogger-recover.service
    assert read_run(journal).end.reason == "duration of 3.6 s over"


def test_what_a_logger_does_after_its_run_is_said(tmp_path):
    # on a busy machine it takes a minute
    with simulated_devices() as (modem, gnss, _):
        more = '[live]\nbaseline = "own"\n'
        config = service.site_toml(tmp_path, modem.path, gnss.path, more)
        with service.running_service(config, "--duration", "3") as logger:
            _, errors = logger.communicate(timeout=service.LIMIT_S)
    assert errors.index("is sealed with") < errors.index("the baseline learns the run; Ctrl-C")


def test_a_baseline_that_was_not_learnt_has_a_reason(caplog):
    _learn([sys.executable, "-c", "raise SystemExit('no room')"])
    _learn([sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGTERM)"])
    reasons = ("no room", "learning was interrupted")
    said = [record.message for record in caplog.records]
    assert said == [f"the baseline is as it was: {why}" for why in reasons]
