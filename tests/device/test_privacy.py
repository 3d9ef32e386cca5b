"""What people say and who they are, on every port of the real service: in nothing that it leaves
behind.
"""

import json
import random
import re

import numpy as np

from logger.cli import main as fieldlogger
from logger.core.runfile import read_run
from logger.device import gnss_source
from logger.probe import probe
from logger.sim.devices import frame_text
from logger.sim.ptys import PtyDevice, answering
from postproc.cli import main as postproc
from tests.kit import service
from tests.kit.planted_secrets import plant
from tests.kit.recorded_replies import NmeaPlayer, TranscriptModem
from tests.kit.secret_lines import FORMS as LINES
from tests.kit.secret_lines import IN_ROWS
from tests.kit.secrets import FORMS, leaked_secrets

SAID = [b"\r\n" + form.encode("latin-1") + b"\r\n" for form in FORMS]
PLANTED = [plant(form, random.Random(form)) for form in (*LINES, *IN_ROWS)]
ATI = frame_text(
    "Manufacturer: SIMCOM_Ltd", "Model: SIM800L", "Revision: 1418B05SIM800L24",
    "IMEI: 359072060228832", "FSN: LF728387390410", "SN 8X4K21973553", "35-907206-022883-2",
    'Own number "4155551234" Miller',
    "OK",
)  # fmt: skip
OF_ATI = (b"359072060228832", b"LF728387390410", b"4K21973553", b"907206", b"4155551234", b"Miller")


class Telephone(TranscriptModem):
    """A modem that is also called and written to, as one whose line is damaged now and then."""

    def __init__(self):
        super().__init__([service.CENG] * 100_000)
        self.to_say = [b"\xff\xfe", *SAID]

    def unsolicited(self):
        return self.to_say.pop(0) if self.to_say else b""


def _everything(path):
    """All bytes that a run holds, as they were before they were packed, table by table."""
    run = read_run(path)
    yield run.raw_bytes.tobytes()
    for rows in run.tables.values():
        for row in rows:
            yield b" ".join(value for value in row.tolist() if isinstance(value, bytes))


def test_no_number_and_no_message_is_in_anything_that_a_run_leaves(tmp_path, capfd):
    """Devices at each other's ports: the receiver's says what a telephone says, and the modem's
    does too.
    """
    epochs = service.nmea_epochs(len(SAID)).split(b"$GNRMC")[1:]
    nmea = b"".join(
        b"$GNRMC" + epoch + sentence for epoch, sentence in zip(epochs, SAID, strict=True)
    )
    modem, player = Telephone(), NmeaPlayer(nmea)
    with PtyDevice(player) as gnss, PtyDevice(answering(modem)) as port:
        with service.running_service(service.site_toml(tmp_path, port.path, gnss.path)) as logger:
            service.wait_for(lambda: player.finished.is_set() and not modem.to_say)
            served = modem.served
            service.wait_for(lambda: modem.served > served + 3)
            logger.terminate()
            result, errors = logger.communicate(timeout=service.LIMIT_S)
    (journal,) = (tmp_path / "runs").glob("*.journal")
    hdf5 = journal.with_suffix(".h5")
    for path in (journal, hdf5):
        left = [found for piece in _everything(path) for found in leaked_secrets(piece)]
        assert not left
    assert not leaked_secrets((result + errors).encode())
    for name in ("walk.kml", "walk.csv", "walk.geojson", "walk.gpx"):
        assert postproc(["export", str(hdf5), "-o", str(tmp_path / name)]) == 0
        assert not leaked_secrets((tmp_path / name).read_bytes())
    assert postproc(["info", str(hdf5), "-v"]) == 0
    assert not leaked_secrets(capfd.readouterr().out.encode())
    run = read_run(hdf5)
    assert b'+CLIP: "xxxxxxxxxxxx",xxx\r\n' in run.raw_bytes.tobytes()
    # nothing that both devices are there for has suffered
    assert np.count_nonzero(run.tables["fixes"]["valid"]) >= len(SAID) - 1
    assert set(run.tables["readings"]["cell"]) == {b"262-01-4711-12345", b"262-01-4711-12346"}


class PlantedModem(TranscriptModem):
    """A modem that identifies itself with its serial numbers; planted lines come in its replies,
    between them, and as its first words.
    """

    def __init__(self):
        before, row, after = service.CENG.partition(b'+CENG: 1,"')
        rows = [before + line.data + b"\r\n" + row + after for line in PLANTED]
        super().__init__([*rows, *[service.CENG] * 100_000])
        self.to_say = [b"\r\n" + line.data + b"\r\n" for line in PLANTED]

    def unsolicited(self):
        return self.to_say.pop(0) if self.to_say else b""

    def _answer(self, command):
        return ATI if command == "ATI" else super()._answer(command)


_BETWEEN = re.compile(rb"[^0-9A-Za-z]")


def _secrets_in(blob):
    """Planted secrets that stand in the bytes, whatever stands between their letters."""
    secrets = {*OF_ATI, *(secret for line in PLANTED for secret in line.secrets())}
    plain = _BETWEEN.sub(b"", blob)
    return [one for one in secrets if one in blob or _BETWEEN.sub(b"", one) in plain]


def test_no_planted_secret_is_in_a_run_a_log_or_the_status(tmp_path):
    """On the modem's port and the receiver's, with a modem that is asked for its identity."""
    assert len(_secrets_in(b"\n".join([*(line.data for line in PLANTED), ATI]))) > 150
    epochs = service.nmea_epochs(len(PLANTED)).split(b"$GNRMC")[1:]
    nmea = b"".join(
        b"$GNRMC" + epoch + line.data + b"\r\n" for epoch, line in zip(epochs, PLANTED, strict=True)
    )
    modem, player = PlantedModem(), NmeaPlayer(nmea)
    with PtyDevice(player) as gnss, PtyDevice(answering(modem)) as port:
        site = service.site_toml(tmp_path, port.path, gnss.path)
        site.write_text(site.read_text().replace('driver = "sim800"', 'driver = "auto"'))
        with service.running_service(site) as logger:
            service.wait_for(lambda: player.finished.is_set() and not modem.to_say)
            service.wait_for(lambda: modem.served > len(PLANTED) + 3)
            logger.terminate()
            result, errors = logger.communicate(timeout=service.LIMIT_S)
    (hdf5,) = (tmp_path / "runs").glob("*.h5")
    for path in (hdf5, hdf5.with_suffix(".journal")):
        assert not [found for piece in _everything(path) for found in _secrets_in(piece)]
    assert not _secrets_in((result + errors).encode())
    for path in (tmp_path / "runs").glob("*.json"):
        assert not _secrets_in(path.read_bytes())
    run = read_run(hdf5)
    assert b"Model: SIM800L" in run.raw_bytes.tobytes()
    assert any(b"driver sim800" in text for text in run.tables["notes"]["text"])
    assert np.count_nonzero(run.tables["fixes"]["valid"]) >= len(PLANTED) - 1
    assert {b"262-01-4711-12345", b"262-01-4711-12346"} <= set(run.tables["readings"]["cell"])


def test_probe_and_doctor_print_no_planted_secret(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(gnss_source, "PROBE_S", 2.5)
    modem = PlantedModem()
    with PtyDevice(answering(modem)) as port:
        (found,) = probe({port.path: ""}, bauds=(115_200,))
        assert (found.kind, found.driver) == ("modem", "sim800")
        assert not _secrets_in(json.dumps(found.text).encode())
        modem.to_say = [b"\r\n" + line.data + b"\r\n" for line in PLANTED]
        with PtyDevice(NmeaPlayer(b"")) as gnss:
            site = service.site_toml(tmp_path, port.path, gnss.path)
            fieldlogger(["doctor", "--config", str(site), "--seconds", "3"])
    out = capfd.readouterr()
    assert "SIM" in out.out
    assert not _secrets_in((out.out + out.err).encode())
