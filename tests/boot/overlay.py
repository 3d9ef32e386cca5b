"""Kernel and initrd with which a root can be overlaid, as those of Raspberry Pi OS can."""

from tests.boot.machines import BOARD, BOOT_S, image_folder, machine, rig


def kernel_with_overlay(root, folder):
    """Folder of the kernel and of an initrd that can overlay a root; the card `root` makes it.

    The initrd of the rig has no busybox.
    """
    initrd = "/var/tmp/initrd"
    with machine(root, folder / "making") as m:
        m.boot(BOOT_S)
        m.run("sed -i s/BUSYBOX=n/BUSYBOX=y/ /etc/initramfs-tools/conf.d/*")
        m.run("echo CONFIG_RD_GZIP=y > /boot/config-$(uname -r)")  # the rig has emptied /boot
        m.run(f"mkinitramfs -o {initrd} $(uname -r) && sync", timeout=300)
        m.poweroff(BOOT_S)
    arch = rig.BOARDS[BOARD]["arch"]
    root.pull(initrd, folder).rename(folder / f"initrd-{arch}")
    (folder / f"vmlinuz-{arch}").symlink_to(image_folder() / f"vmlinuz-{arch}")
    return folder
