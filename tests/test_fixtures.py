"""Files and answers of an earlier version: today's program opens them and says the same.

`tests/fixtures/make.py` has made them and names the commands. New fields may be added to an answer;
none may go, and no number may change by more than builds of numpy do.
"""

import json
import re
import shutil
from functools import partial
from pathlib import Path

import pytest

from logger.core.runfile import read_run
from logger.device.status import read_status, write_status
from postproc import results
from postproc.cli import main
from postproc.result import Options
from tests.fixtures import make
from tests.kit import documents, service
from tests.kit import page as page_kit
from tests.kit.simulated_devices import simulated_devices

OTHER_MACHINE_M = 1e-3
"""On another processor the last bits of exp and log differ; `largest_m` was 4e-9 so far."""
FREE = {"program", "replayed_by", "machine", "silent_s"}
"""Values that tell the version or the machine, and not what was asked."""
RULES = re.compile(r"version \w+: ")
"""The note that names the rules begins with their version."""

differences = partial(documents.differences, free=FREE, text=partial(RULES.sub, ""), floats=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A copy of the fixtures: some commands write beside what they read."""
    folder = tmp_path_factory.mktemp("fixtures")
    make.copy_fixtures(folder)
    return folder


@pytest.fixture
def here(folder, monkeypatch):
    monkeypatch.chdir(folder)
    return folder


def golden(name):
    return json.loads((make.ANSWERS / f"{name}.json").read_text())


def check(name, now):
    found = list(differences(golden(name), now, name))
    assert not found, "\n".join(found[:10])


@pytest.mark.parametrize("name", make.COMMANDS)
def test_a_command_answers_as_then(here, name):
    now = make.answer(make.COMMANDS[name])
    if name == "info-imported":  # each import has a number of its own
        now |= {key: golden(name)[key] for key in ("run_id", "digest")}
    check(name, now)


@pytest.mark.parametrize("file", make.FILES)
def test_an_exported_file_is_as_then(here, file):
    make.answer(next(one for one in make.COMMANDS.values() if one.find(f"-o {file}") > 0))
    then = (make.ANSWERS / f"exported-{file}").read_text()
    found = list(differences(_parts(then), _parts(Path(file).read_text()), file))
    assert not found, "\n".join(found[:10])


def _parts(text):
    """Words and numbers of a text, so that numbers are compared as such."""
    numbers = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")
    return [numbers.split(text), [float(number) for number in numbers.findall(text)]]


@pytest.mark.parametrize("file", make.REPLAYED)
def test_a_run_of_an_earlier_estimator_replays_with_the_same_difference(here, file, capsys):
    code = main(["replay", file, "--json"])
    now = json.loads(capsys.readouterr().out)
    then = golden(f"replay-{file}")
    assert (code, now["equal"]) == (1, False)
    assert now["n_replayed"] == now["n_recorded"] == then["n_recorded"]
    if _is_same_machine():
        assert not list(differences(then, now))
    else:
        assert now["largest_m"] == pytest.approx(then["largest_m"], abs=OTHER_MACHINE_M)


def _is_same_machine():
    return make.machine_kind() == json.loads((make.HERE / "made_on.json").read_text())


def test_the_guide_advises_as_then():
    check("guide", make.guide_answer((make.HERE / "guide.csv").read_text()))


def test_a_survey_is_read_and_extended(here):
    with make.scheduler() as scheduler:
        for name, command in make.SURVEY_COMMANDS.items():
            check(name, make.answer(command.format(scheduler=scheduler)))


def test_replies_of_every_driver_family_are_read_as_then():
    check("parse", make.parsed_replies())


def test_a_configuration_means_the_same():
    check("config", make.config_answer((make.HERE / "site.toml").read_text()))


def test_the_page_sends_the_same(tmp_path):
    check("page", make.page_answers(tmp_path))


def test_a_status_keeps_its_fields(tmp_path):
    shutil.copy(make.HERE / "status.json", tmp_path)
    status = read_status(tmp_path)
    assert status is not None
    write_status(tmp_path, status)
    then, now = ((f / "status.json").read_text() for f in (make.HERE, tmp_path))
    found = list(differences(json.loads(then), json.loads(now), "status"))
    assert not found, "\n".join(found[:10])


def test_a_recording_writes_the_same_fields(tmp_path, monkeypatch):
    """Of the fix, the target, its position, the way to go, the ports and the cells as well."""
    folder = page_kit.folders(tmp_path)
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(folder))
    then = json.loads((make.HERE / "status.json").read_text())
    missing = ["no status"]

    def is_complete():
        if (folder / "status.json").exists():
            missing[:] = missing_fields(then, json.loads((folder / "status.json").read_text()))
        return not missing

    with simulated_devices(rate=20.0) as (modem, gnss, _):
        more = "[live]\nmax_fix_age_s = 100.0\n"
        config = service.site_toml(tmp_path, modem.path, gnss.path, more)
        with service.running_service(config) as process:
            try:
                service.wait_for(lambda: is_complete() or process.poll() is not None)
            finally:
                assert not missing, f"never written: {missing}"


def missing_fields(then, now, at="status"):
    """Fields of objects that `now` does not have, or not yet."""
    if isinstance(then, list) and isinstance(now, list):
        return missing_fields(then[0], now[0], f"{at}[0]") if then and now else []
    if not isinstance(then, dict):
        return []
    if not isinstance(now, dict):
        return [at]
    found = [f"{at}.{key}" for key in then if key not in now]
    known = (key for key in then if key in now)
    return found + [
        one for key in known for one in missing_fields(then[key], now[key], f"{at}.{key}")
    ]


def test_stored_results_open(here):
    """Those of another version of the program are not used, and the reason says so."""
    path = here / "old.post.h5"
    shutil.copy(make.HERE / "walk.post.h5", path)
    reason = ""
    try:
        results.read(path, [read_run(Path("walk.h5"))], [make.CELL], Options())
    except results.NotStored as error:
        reason = str(error)
    assert reason in {"", "it is of another version of the program"}
    check("stored-result", make.stored_summary(path))
