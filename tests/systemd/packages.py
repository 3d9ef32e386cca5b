"""Packages made of the one under test."""

import re
import subprocess
from pathlib import Path


def with_version(package: Path, version: str, folder: Path) -> Path:
    """The same package under another version, in a folder."""
    tree, copy = folder / f"tree-{version}", folder / f"fieldlogger-{version}.deb"
    subprocess.run(["dpkg-deb", "-R", package, tree], check=True)
    control = tree / "DEBIAN/control"
    control.write_text(re.sub(r"(?m)^Version: .*", f"Version: {version}", control.read_text()))
    subprocess.run(["dpkg-deb", "-b", "-Zgzip", tree, copy], check=True, stdout=subprocess.DEVNULL)
    return copy
