"""The units and the rules, as systemd itself reads them."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from logger.cli import main
from logger.device.memory import MEMORY_MB
from logger.device.page_requests import requests_folder
from logger.device.status import FOLDER
from logger.page.token import STATE

FOLDER_OF_UNITS = Path(__file__).parents[2] / "systemd"
UNITS = ("fieldlogger.service", "fieldlogger-recover.service", "fieldlogger-page.service")

needs_systemd = pytest.mark.skipif(
    shutil.which("systemd-analyze") is None, reason="no systemd-analyze here"
)


def _settings(unit):
    lines = (FOLDER_OF_UNITS / unit).read_text().splitlines()
    return [line for line in lines if line and not line.startswith(("#", "["))]


@needs_systemd
@pytest.mark.parametrize("unit", UNITS)
def test_exposure_is_among_the_least_of_all_services(unit):
    process = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", "--no-pager", FOLDER_OF_UNITS / unit],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    found = re.search(r"Overall exposure level .*: (\d+\.\d+)", process.stdout)
    if found is None:
        pytest.skip(f"systemd-analyze cannot do this here: {process.stderr}")
    assert float(found[1]) <= 1.5


@needs_systemd
def test_systemd_has_nothing_to_say_against_the_units(tmp_path):
    program = tmp_path / "fieldlogger"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    for unit in UNITS:
        text = (FOLDER_OF_UNITS / unit).read_text().replace("/usr/bin/fieldlogger", str(program))
        (tmp_path / unit).write_text(text)
    process = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", *(tmp_path / unit for unit in UNITS)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if "Failed to" in process.stderr and "initialize" in process.stderr:
        pytest.skip(f"systemd-analyze cannot do this here: {process.stderr}")
    assert not [line for line in process.stderr.splitlines() if "fieldlogger" in line], (
        process.stderr
    )


def test_it_starts_at_boot_and_is_never_given_up():
    settings = _settings(UNITS[0])
    for needed in ("Type=notify", "WatchdogSec=30", "Restart=always", "StartLimitIntervalSec=0"):
        assert needed in settings
    assert "WantedBy=multi-user.target" in settings
    assert not [line for line in settings if line.startswith("BindsTo")], (
        "an unplugged device must not stop it"
    )
    # a run is named, and its time told from others, by the boot: it must stay readable
    assert "ProcSubset=pid" not in settings


def test_finished_runs_are_learnt_after_a_start_and_after_a_stop(capsys):
    """By commands that the program has, once nothing else wants to compute or to write."""
    recorder, later = _settings(UNITS[0]), _settings(UNITS[1])
    assert {f"Wants={UNITS[1]}", f"OnSuccess={UNITS[1]}"} <= set(recorder)
    assert {"Nice=19", "CPUSchedulingPolicy=idle", "IOSchedulingClass=idle"} <= set(later)
    (run,) = [line for line in recorder if line.startswith("ExecStart=")]
    commands = [line.split()[1:] for line in later if line.startswith("ExecStart=")]
    assert commands == [["recover", "/var/lib/cellwalk"], ["learn", *run.split()[2:]]]
    for name, *given in commands:
        assert main([name, "--help"]) == 0
        described = capsys.readouterr().out
        assert all(one in described for one in given if one.startswith("-"))
    assert 'baseline = "own"' in (FOLDER_OF_UNITS / "site.toml").read_text()


def test_the_folders_are_those_that_the_program_uses():
    settings = _settings(UNITS[0])
    assert f"RuntimeDirectory={FOLDER.name}" in settings
    assert str(FOLDER.parent) == "/run"
    assert 'directory = "/var/lib/cellwalk"' in (FOLDER_OF_UNITS / "site.toml").read_text()
    assert "StateDirectory=cellwalk" in settings


def test_the_page_has_a_user_of_its_own_that_writes_only_its_own_folders():
    settings = _settings(UNITS[2])
    assert "User=cellwalk-page" in settings
    assert "ProtectSystem=strict" in settings
    assert not [line for line in settings if line.startswith(("ReadWritePaths", "Supplementary"))]
    assert f"RuntimeDirectory={requests_folder(FOLDER).name}" in settings
    assert f"StateDirectory={STATE.name}" in settings
    assert "IPAddressDeny=any" in settings
    recorder = _settings(UNITS[0])
    assert "IPAddressDeny=any" in recorder
    assert "IPAddressAllow=localhost" in recorder


def test_the_rules_name_the_ports_of_the_sample_configuration_and_keep_others_away():
    rules = (FOLDER_OF_UNITS / "70-cellwalk.rules").read_text()
    ports = re.findall(
        r'^port = "/dev/([^"]+)"', (FOLDER_OF_UNITS / "site.toml").read_text(), re.MULTILINE
    )
    assert len(ports) == 2
    for port in ports:
        assert f'SYMLINK+="{port}"' in rules
    assert 'ENV{ID_MM_DEVICE_IGNORE}="1"' in rules
    assert "gpsdctl@" in rules
    for line in rules.splitlines():
        assert (
            not line
            or line.startswith("#")
            or re.fullmatch(r'([A-Z]+(\{[\w.]+\})?[!=+]?="[^"]*"(, )?)+', line)
        ), line


def test_the_recorder_knows_the_memory_that_its_unit_allows():
    assert f"MemoryMax={MEMORY_MB}M" in _settings("fieldlogger.service")
