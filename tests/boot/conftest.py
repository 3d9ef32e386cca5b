import shutil

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

    if not machines.rig.BOARDS[machines.BOARD]["share"]:
        pytest.skip(f"the rig shows no folder of the host to a {machines.BOARD} to install from")
    image, debs = machines.build_image(), machines.build_packages()
    card = machines.rig.Card(workplace / "installed.raw", image)
    with (
        machines.machine(card, workplace / "install", share=machines.REPOSITORY) as m,
        players.carry(m, scenario()),
    ):
        m.boot(machines.BOOT_S)
        from_folder = debs.relative_to(machines.REPOSITORY)
        print(m.run(f"/mnt/host/systemd/install.sh /mnt/host/{from_folder}", timeout=900))
        print(
            m.run(
                "fieldlogger probe --write /tmp/site.toml && cp /tmp/site.toml /etc/cellwalk/",
                timeout=300,
            )
        )
        m.poweroff(machines.BOOT_S)
    return card
