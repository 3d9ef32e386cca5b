"""What a modem was set to outlasts a cut at any moment."""

import errno
import subprocess
import sys

import msgspec
import pytest

from logger.device.mode_switch import FILE, SavedMode, SavedModes
from tests.kit.card_trace import read_trace
from tests.kit.faulty_card import Card, build_preload_library

OLD = SavedMode("sim7600", "SIMCOM_SIM7600E-H", "AT+CNMP?", "2")
NEW = SavedMode("sim7600", "SIMCOM_SIM7600E-H", "AT+CNMP?", "38")
OTHER = SavedMode("quectel", "EC25", 'AT+QCFG="nwscanmode"', "0")
KEEP = (
    "import sys; from pathlib import Path;"
    "from logger.device.mode_switch import SavedMode, SavedModes;"
    "SavedModes(Path(sys.argv[1])).save(SavedMode(*sys.argv[2:]))"
)


@pytest.fixture(scope="module")
def preload(tmp_path_factory):
    return build_preload_library(tmp_path_factory.mktemp("preload"))


@pytest.fixture
def card(tmp_path, preload):
    return Card(tmp_path, preload)


def _keep(card, **environment):
    command = [
        sys.executable,
        "-c",
        KEEP,
        str(card.folder),
        NEW.driver,
        NEW.model,
        NEW.asks,
        NEW.value,
    ]
    return subprocess.run(
        command, check=False, capture_output=True, env=card.environment(**environment)
    )


def test_two_modems_of_one_model_have_an_entry_each(tmp_path):
    """The one that is set back first does not take the other's."""
    modes = SavedModes(tmp_path)
    first, second = (msgspec.structs.replace(OLD, source=name) for name in ("modem", "modem2"))
    for entry in (first, second):
        modes.save(entry)
    assert (modes.of_source("modem"), modes.of_source("modem2")) == ((first,), (second,))
    modes.drop(first)
    assert modes.all() == (second,)


def test_an_entry_of_an_earlier_version_is_of_any_modem(tmp_path):
    modes = SavedModes(tmp_path)
    modes.path.write_text(
        '[{"driver":"sim7600","model":"SIMCOM_SIM7600E-H","asks":"AT+CNMP?","value":"2"}]'
    )
    assert modes.of_source("modem2") == (OLD,)


def test_an_entry_for_each_model(tmp_path):
    modes = SavedModes(tmp_path)
    assert modes.all() == ()
    for entry in (OLD, OTHER, NEW):
        modes.save(entry)
    assert set(modes.all()) == {OTHER, NEW}
    modes.drop(NEW)
    assert modes.all() == (OTHER,)
    modes.drop(OTHER)
    assert not list(tmp_path.iterdir())


def test_it_is_on_the_card_before_it_has_its_name_and_its_name_too(card):
    assert _keep(card, trace=True).returncode == 0
    done = [(operation.name, operation.path.name) for operation in read_trace(card.trace)]
    part, folder = f"{FILE}.part", card.folder.name
    order = [("fsync", part), ("rename", FILE), ("fsync", folder)]
    assert [one for one in done if one[0] != "create"] == order


def test_a_cut_at_any_system_call_leaves_the_old_or_the_new(card):
    saved = SavedModes(card.folder)
    saved.save(OLD)
    assert _keep(card, trace=True).returncode == 0
    found = []
    for kill_at in range(1, len(read_trace(card.trace)) + 1):
        saved.save(OLD)
        assert _keep(card, kill_at=kill_at).returncode == -9
        found.append(saved.all())
    assert found[0] == (OLD,)
    assert found[-1] == (NEW,)
    assert set(found) == {(OLD,), (NEW,)}


@pytest.mark.parametrize(
    "failing", [{"fsync": errno.EIO}, {"create": errno.ENOSPC}, {"rename": errno.EROFS}]
)
def test_a_card_that_does_not_take_it_says_so_and_has_the_old(card, failing):
    saved = SavedModes(card.folder)
    saved.save(OLD)
    card.fails(**failing)
    assert b"OSError" in _keep(card).stderr
    assert saved.all() == (OLD,)


@pytest.mark.parametrize("data", [b"", b"[{", b"[1]", b'[{"driver": "sim7600"}]', b"\xff"])
def test_a_damaged_file_is_an_error(tmp_path, data):
    (tmp_path / FILE).write_bytes(data)
    with pytest.raises(OSError, match="is damaged"):
        SavedModes(tmp_path).all()
