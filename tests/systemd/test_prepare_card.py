"""What prepare-card.sh writes to a boot partition; that such a card then records is tested in
tests/boot.
"""

import shutil
import subprocess
from pathlib import Path

import pytest

CARD = Path(__file__).parents[2] / "systemd"
PREPARE = CARD / "prepare-card.sh"
ASKED = ["--hostname", "walker", "--country", "DE", "--hotspot", "walk"]
CMDLINE = "console=tty1 root=PARTUUID=1-02 rootwait cfg80211.ieee80211_regdom=GB quiet\n"


@pytest.fixture
def bootfs(tmp_path):
    """The boot partition of Raspberry Pi OS of Debian 12, as far as the script looks at it."""
    folder = tmp_path / "boot fs"
    folder.mkdir()
    (folder / "cmdline.txt").write_text(CMDLINE)
    return folder


@pytest.fixture
def debs(tmp_path):
    folder = tmp_path / "card-bookworm-arm64"
    folder.mkdir()
    for name in ("fieldlogger_1_arm64.deb", "Packages", "made-for"):
        (folder / name).write_text(f"{name}\n")
    return folder


def _prepare(*arguments, password=""):
    return subprocess.run(
        ["sh", PREPARE, *map(str, arguments)],
        input=password, capture_output=True, text=True, check=False,
    )  # fmt: skip


def _content(folder):
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_the_kernel_starts_the_first_boot_of_debian_12(bootfs, debs):
    done = _prepare(bootfs, "--debs", debs, *ASKED)
    assert done.returncode == 0, done.stderr
    (line,) = (bootfs / "cmdline.txt").read_text().splitlines()
    assert line.startswith("console=tty1 root=PARTUUID=1-02 rootwait quiet ")
    assert line.split().count("cfg80211.ieee80211_regdom=DE") == 1
    assert "=GB" not in line
    assert "systemd.run=/boot/firmware/firstrun.sh systemd.run_success_action=reboot" in line
    assert line.endswith("systemd.unit=kernel-command-line.target")
    assert "/boot/firmware/cellwalk/first-boot.sh" in (bootfs / "firstrun.sh").read_text()
    assert {path.name for path in (bootfs / "cellwalk/debs").iterdir()} == {
        path.name for path in debs.iterdir()
    }


def test_cloud_init_starts_that_of_debian_13(bootfs, debs):
    (bootfs / "user-data").write_text("#cloud-config\n# a comment\n")
    (bootfs / "meta-data").write_text("instance-id: rpios-image\n")
    assert _prepare(bootfs, "--debs", debs).returncode == 0
    assert (bootfs / "cmdline.txt").read_text() == CMDLINE
    assert not (bootfs / "firstrun.sh").exists()
    text = (bootfs / "user-data").read_text()
    assert text.startswith("#cloud-config\n")
    assert "- [sh, /boot/firmware/cellwalk/first-boot.sh]\n" in text
    assert (bootfs / "meta-data").read_text() == "instance-id: rpios-image\n"


def test_settings_are_read_back_by_a_shell_and_hold_no_password_of_the_user(bootfs, debs):
    if shutil.which("openssl") is None:
        pytest.skip("no openssl here")
    done = _prepare(bootfs, "--debs", debs, *ASKED, "--user", "ada", password="it's $secret\n")
    assert done.returncode == 0, done.stderr
    settings = bootfs / "cellwalk/settings"
    assert "secret" not in settings.read_text()
    names = '"$hostname" "$user" "$hotspot" "$hotspot_password" "$password_hash"'
    shown = subprocess.run(
        ["sh", "-c", f'. "$1"; printf "%s\\n" {names}', "sh", settings],
        capture_output=True, text=True, check=True,
    ).stdout.splitlines()  # fmt: skip
    assert shown[:3] == ["walker", "ada", "walk"]
    assert len(shown[3]) == 16
    assert shown[3] in done.stdout
    assert shown[4].startswith("$6$")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "--debs is needed"),
        (["--debs", "/nowhere"], "make card-debs"),
        (["DEBS", "--country", "Germany"], "two capital letters"),
        (["DEBS", "--hotspot", "walk"], "--hotspot needs --country"),
        (["DEBS", "--hostname", "my pi"], "no host name"),
        (["DEBS", "--user", "Ada'; rm"], "no user name"),
        (["DEBS", "--user", "ada"], "no password"),
        (["DEBS", "--ssh-key", "/dev/null"], "--ssh-key needs --user"),
        (["DEBS", "--site", "/nowhere"], "no such file"),
    ],
)
def test_a_mistake_is_named_and_the_card_stays_as_it_was(bootfs, debs, arguments, says):
    before = _content(bootfs)
    words = [word for a in arguments for word in (["--debs", debs] if a == "DEBS" else [a])]
    done = _prepare(bootfs, *words)
    assert done.returncode == 1
    assert says in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert _content(bootfs) == before


def test_settings_of_another_program_are_not_overwritten(bootfs, debs):
    (bootfs / "firstrun.sh").write_text("of the Imager\n")
    done = _prepare(bootfs, "--debs", debs)
    assert done.returncode == 1
    assert "Imager" in done.stderr
    (bootfs / "firstrun.sh").unlink()
    (bootfs / "user-data").write_text("#cloud-config\nhostname: mine\n")
    assert _prepare(bootfs, "--debs", debs).returncode == 1
    assert (bootfs / "user-data").read_text() == "#cloud-config\nhostname: mine\n"


def test_another_folder_is_no_card(tmp_path, debs):
    done = _prepare(tmp_path, "--debs", debs)
    assert done.returncode == 1
    assert "no boot partition" in done.stderr


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="no shellcheck here")
@pytest.mark.parametrize("script", [PREPARE, CARD / "card/first-boot.sh"])
def test_shellcheck_finds_nothing(script):
    done = subprocess.run(["shellcheck", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
