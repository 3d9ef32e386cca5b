"""What people say and who they are, on every port of the real service: in nothing that it leaves
behind.
"""

import numpy as np

from logger.core.runfile import read_run
from logger.sim.player import NmeaPlayer, TranscriptModem
from logger.sim.ptys import PtyDevice, answering
from postproc.cli import main as postproc
from tests.kit import service
from tests.kit.secrets import FORMS, leaked_secrets

SAID = [b"\r\n" + form.encode("latin-1") + b"\r\n" for form in FORMS]


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
