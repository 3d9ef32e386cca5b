"""The page over the emulated network: off, on, loaded while devices go and the power is cut."""

import json
import threading
import time
from contextlib import contextmanager
from http.client import HTTPException

import numpy as np
import pytest

from logger.core.runfile import read_run
from logger.sim.scenario import scenario
from tests.boot import network
from tests.boot.machines import BOOT_S, RUNS, machine, wait_recording
from tests.boot.players import carry
from tests.kit.page import free_port

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")]


class Phone:
    """A client that loads the page all the time, whatever becomes of the connection."""

    def __init__(self, port, token):
        self._port, self._token = port, token
        self.n_loaded = self.n_failed = 0
        self.stop = threading.Event()

    def load(self, what, body=None):
        return network.ask(self._port, f"/{self._token}/{what}", body)

    def run(self):
        while not self.stop.is_set():
            try:
                status, _ = self.load("track")
                self.n_loaded += status == 200
            except (OSError, HTTPException):
                self.n_failed += 1
            self.stop.wait(0.1)

    def wait_page(self, seconds=120.0):
        """Wait until the page is there."""
        end_s = time.monotonic() + seconds
        while True:
            try:
                return self.load("")
            except (OSError, HTTPException):
                assert time.monotonic() < end_s
                time.sleep(1.0)


@contextmanager
def loading(phone):
    thread = threading.Thread(target=phone.run)
    thread.start()
    try:
        yield
    finally:
        phone.stop.set()
        thread.join()


def test_the_page_is_loaded_while_devices_go_and_the_power_is_cut(installed_card, workplace):
    folder, port = workplace / "page", free_port()
    folder.mkdir()
    network.fetch_drivers(folder)
    card = installed_card.copy(workplace / "page.raw")
    with machine(card, workplace / "page-machine", share=folder) as m, carry(m, scenario()):
        network.add_card(m, port)
        m.boot(BOOT_S)
        network.bring_up(m)
        wait_recording(m)
        with pytest.raises((OSError, HTTPException)):  # it is off
            network.ask(port, "/")
        m.run(f"printf '\\n[page]\\nlisten = \"{network.PI}:8080\"\\n' >>/etc/cellwalk/site.toml")
        m.run("systemctl restart fieldlogger", timeout=120)
        m.run("systemctl enable --now fieldlogger-page", timeout=120)
        m.run("until test -s /var/lib/cellwalk-page/token; do sleep 1; done", timeout=120)
        phone = Phone(port, m.run("cat /var/lib/cellwalk-page/token"))
        assert phone.wait_page()[0] == 200
        assert network.ask(port, "/wrong/")[0] in {403, 404}
        assert network.ask(port, "/", host="elsewhere")[0] == 421
        with loading(phone):
            for mark, name in (("a door", None), ("modem away", "modem"), ("gps away", "gps")):
                if name:
                    m.unplug(name)
                    time.sleep(2.0)
                assert phone.load("mark", json.dumps(mark).encode())[0] == 202
                if name:
                    m.replug(name)
            wait_recording(m, more_fixes=20)
            m.cut_power()
            m.boot(BOOT_S)
            network.bring_up(m)
            assert phone.wait_page()[0] == 200
            wait_recording(m, more_fixes=5)
        print(f"the phone loaded the track {phone.n_loaded} times, {phone.n_failed} times in vain")
        m.run("until ! systemctl -q is-active fieldlogger-recover; do sleep 1; done", timeout=120)
        m.poweroff(BOOT_S)
    assert phone.n_loaded > 20
    assert phone.n_failed > 0  # while there was no power
    _check_runs([read_run(p) for p in sorted(card.pull(RUNS, workplace / "pages").glob("*.h5"))])


def _check_runs(runs):
    (marked,) = (run for run in runs if np.any(run.tables["notes"]["code"] == b"mark"))
    assert {b"a door", b"modem away", b"gps away"} <= set(marked.tables["notes"]["text"].tolist())
    assert marked.end is None  # the power was cut
    assert not marked.damage.missing_frames
