import os
import shutil
import subprocess

import pytest

from logger.sim.scenario import scenario


@pytest.fixture(scope="session")
def workplace():
    """A folder with a short path, since sockets are in it; it is emptied at the next run.

    A run takes several GB.
    """
    from tests.boot.machines import BOARD, CACHE

    folder = CACHE / f"work-{BOARD}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


@pytest.fixture(scope="session")
def installed_card(workplace):
    """A card with an installation as systemd/README.md describes it, without a network."""
    from tests.boot import machines, players

    board = machines.rig.BOARDS[machines.BOARD]
    if shutil.which(board["qemu"][0]) is None:
        pytest.skip(f"no {board['qemu'][0]} here")
    if not board["share"]:
        pytest.skip(
            f"the rig shows no folder of the host to a {machines.BOARD}, so that nothing can be "
            f"installed"
        )
    image = machines.CACHE / f"base-{board['arch']}.raw"
    if not image.exists() and os.getuid() != 0:
        pytest.skip("only root can build the image of the boot rig")
    # apt, as every Debian has it, and what Raspberry Pi OS makes a root read-only with
    packages = os.environ | {"EXTRA_PACKAGES": "apt,overlayroot,busybox"}
    subprocess.run(
        [machines.RIG / "build_image.sh", machines.CACHE, board["arch"]], check=True, env=packages
    )
    subprocess.run(
        ["make", "-C", machines.REPOSITORY, "card-debs", f"ARCH={board['arch']}", "SUITE=bookworm"],
        check=True,
    )

    card = machines.rig.Card(workplace / "installed.raw", image)
    with (
        machines.machine(card, workplace / "install", share=machines.REPOSITORY) as m,
        players.carry(m, scenario()),
    ):
        m.boot(machines.BOOT_S)
        print(
            m.run(
                f"/mnt/host/systemd/install.sh /mnt/host/dist/card-bookworm-{board['arch']}",
                timeout=900,
            )
        )
        print(
            m.run(
                "fieldlogger probe --write /tmp/site.toml && cp /tmp/site.toml /etc/cellwalk/",
                timeout=300,
            )
        )
        m.poweroff(machines.BOOT_S)
    return card
