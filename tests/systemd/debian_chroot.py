"""A small Debian in a folder, to install packages in; for another architecture through QEMU."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

CACHE = Path(os.environ.get("CELLWALK_CHROOTS", "~/.cache/cellwalk-chroots")).expanduser()
MIRROR = os.environ.get("DEBIAN_MIRROR", "http://deb.debian.org/debian")
QEMU = {"arm64": "aarch64", "armhf": "arm"}
_BINFMT = Path("/proc/sys/fs/binfmt_misc")


def base(suite: str, arch: str, packages: str, variant: str = "essential") -> Path:
    """The pristine system with these packages, built once: minutes for another architecture.

    The variants are those of mmdebstrap; the essential one has no apt.
    """
    if os.getuid() != 0:
        pytest.skip("only root can build a chroot")
    if shutil.which("mmdebstrap") is None:
        pytest.skip("no mmdebstrap here")
    let_run(arch)
    folder = CACHE / f"{suite}-{arch}{variant.removeprefix('essential')}"
    if not folder.exists():
        part = folder.with_suffix(".part")
        shutil.rmtree(part, ignore_errors=True)
        CACHE.mkdir(parents=True, exist_ok=True)
        done = subprocess.run(
            ["mmdebstrap", "--quiet", "--mode=root", f"--variant={variant}", f"--arch={arch}",
             f"--include={packages}", suite, part, f"deb {MIRROR} {suite} main"],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode != 0:
            pytest.skip(f"no {suite} for {arch} (no network?): {done.stderr[-300:]}")
        part.rename(folder)
    return folder


def let_run(arch: str) -> None:
    """Register QEMU for the programs of another architecture, as Debian's package would at boot."""
    if arch not in QEMU or (_BINFMT / f"qemu-{QEMU[arch]}").exists():
        return
    rule = Path(f"/usr/lib/binfmt.d/qemu-{QEMU[arch]}.conf")
    if not rule.exists():
        pytest.skip("no qemu-user-static here")
    if not (_BINFMT / "register").exists():
        mounted = subprocess.run(["mount", "-t", "binfmt_misc", "none", _BINFMT], check=False)
        if mounted.returncode != 0:
            pytest.skip("this machine cannot run programs of another architecture")
    (_BINFMT / "register").write_text(rule.read_text())


def unpack_debs(debs: Path, folder: Path) -> Path:
    """All packages of a folder unpacked, not configured: enough to run programs in a chroot."""
    for name in ("bin", "sbin", "lib"):
        (folder / "usr" / name).mkdir(parents=True)
        (folder / name).symlink_to(f"usr/{name}")
    for deb in sorted(debs.glob("*.deb")):
        tar = subprocess.run(["dpkg-deb", "--fsys-tarfile", deb], check=True, capture_output=True)
        unpack = ["tar", "-x", "-C", folder, "--keep-directory-symlink"]
        subprocess.run(unpack, input=tar.stdout, check=True)
    for name in ("proc", "dev/pts", "tmp"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for name in ("null", "ptmx", "urandom"):
        subprocess.run(["cp", "-a", f"/dev/{name}", folder / "dev"], check=True)
    return folder


class Chroot:
    """A copy of a pristine system that is thrown away."""

    def __init__(self, root: Path):
        self.root = root

    def run(self, command: str) -> str:
        """Run a shell command in it; its output."""
        return self.call("sh", "-c", command)

    def call(self, *command: str, **environment: str) -> str:
        """Run a command without a shell, which an unpacked system may lack; its output."""
        usual = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "LC_ALL": "C.UTF-8", "HOME": "/root"}
        done = subprocess.run(
            ["chroot", self.root, *command],
            env=usual | {"DEBIAN_FRONTEND": "noninteractive"} | environment,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{command}: {done.stdout}"
        return done.stdout

    def files(self) -> dict[str, bytes]:
        """Content of every file, and where every link points, but those of dpkg itself."""
        return {
            str(path.relative_to(self.root)): (
                os.readlink(path).encode() if path.is_symlink() else path.read_bytes()
            )
            for top in ("etc", "usr", "var", "opt")
            for path in (self.root / top).rglob("*")
            if (path.is_symlink() or path.is_file()) and "var/lib/dpkg" not in str(path)
        }


@contextmanager
def chroot(pristine: Path, folder: Path) -> Iterator[Chroot]:
    """A copy of a system with /proc and terminals."""
    subprocess.run(["cp", "-a", "--reflink=auto", pristine, folder], check=True)
    mounts = (("proc", folder / "proc"), ("devpts", folder / "dev/pts"))
    try:
        for kind, point in mounts:
            subprocess.run(["mount", "-t", kind, kind, point], check=True)
        yield Chroot(folder)
    finally:
        for _, point in mounts:
            subprocess.run(["umount", "--lazy", point], check=False)
        shutil.rmtree(folder)
