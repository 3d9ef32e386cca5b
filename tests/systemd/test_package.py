"""The Debian package: its fields, its scripts, its files, and its life in a real Debian.

The service of an upgraded package under a running systemd is tested in tests/boot.
"""

import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from tests.systemd.debian_chroot import base, chroot, let_run, unpack_debs
from tests.systemd.packages import with_version

REPOSITORY = Path(__file__).parents[2]
DEBIAN = REPOSITORY / "systemd/debian"
NAMES = {"pynmea2": "python3-nmea2", "pyserial": "python3-serial"}
EPOCHS = {"python3-numpy": "1:"}
MAINTAINER_SCRIPTS = ("preinst", "postinst", "prerm", "postrm", "rtupdate")
SCRIPTS = (*MAINTAINER_SCRIPTS, "build.sh", "msgspec.sh")


def _depends():
    found = re.search(r"^Depends: (.*)$", (DEBIAN / "control").read_text(), re.MULTILINE)
    return [part.strip() for part in found[1].split(",")]


def test_it_depends_on_what_the_program_depends_on():
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    wanted = set()
    for line in [*project["dependencies"], *project["optional-dependencies"]["page"]]:
        name, version = re.fullmatch(r"([\w-]+)>=([\d.]+)", line).groups()
        package = NAMES.get(name, f"python3-{name}")
        wanted.add(f"{package} (>= {EPOCHS.get(package, '')}{version})")
    own = {line for line in wanted if line.startswith("python3-msgspec")}
    assert len(own) == 1  # inside the package
    assert wanted - own == {line for line in _depends() if line.startswith("python3-")}


PYTHONS = {
    "amd64": ["3.11", "3.12", "3.13"],
    "arm64": ["3.11", "3.12", "3.13"],
    "armhf": ["3.11", "3.13"],
}
"""Those of Debian 12 and 13, and Ubuntu 24.04's, for which PyPI has no file of armhf."""


@pytest.mark.parametrize("arch", PYTHONS)
def test_it_allows_the_pythons_that_it_has_msgspec_for(arch):
    script = f". {DEBIAN}/suites.sh; pythons_for {arch}"
    asked = subprocess.run(["sh", "-euc", script], capture_output=True, text=True, check=True)
    allowed = "python3 (>= 3.11~), python3 (<< 3.14)"
    if "3.12" not in PYTHONS[arch]:
        allowed = allowed.replace(", ", ", python3 (<< 3.12) | python3 (>= 3.13~), ")
    assert asked.stdout.strip() == allowed
    assert "@PYTHONS@" in _depends()


def test_the_units_start_the_program_of_the_package():
    for unit in (REPOSITORY / "systemd").glob("*.service"):
        assert "\nExecStart=/usr/bin/fieldlogger " in unit.read_text(), unit
    assert '"/usr/lib/fieldlogger"' in (DEBIAN / "fieldlogger").read_text()


def test_no_script_deletes_runs():
    for name in MAINTAINER_SCRIPTS:
        for line in (DEBIAN / name).read_text().splitlines():
            if "echo" not in line and re.search(r"\brm\b", line):
                assert "$runs" not in line, line
                assert not re.search(r"/var/lib/cellwalk(?!-page)", line), line


@pytest.mark.parametrize("name", SCRIPTS)
def test_shellcheck_finds_nothing(name):
    if shutil.which("shellcheck") is None:
        pytest.skip("no shellcheck here")
    done = subprocess.run(
        ["shellcheck", "-x", "-P", DEBIAN, "-s", "sh", DEBIAN / name],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


def _call_build(folder, *archs):
    places = {"CACHE": str(folder / "cache"), "DIST": str(folder / "dist")}
    return subprocess.run(
        [DEBIAN / "build.sh", *archs],
        capture_output=True, text=True, check=False, env=os.environ | places,
    )  # fmt: skip


def test_an_architecture_that_cannot_be_built_does_not_stop_the_next(tmp_path):
    if shutil.which("dpkg-deb") is None:
        pytest.skip("no Debian here")
    done = _call_build(tmp_path, "sparc", "riscv64")
    assert done.returncode == 1
    said = done.stderr.partition("make deb: not built:\n")[2].splitlines()
    reason = "{0}: no packages are built for {0}: amd64, arm64 or armhf"
    assert said == [reason.format("sparc"), reason.format("riscv64")]


@pytest.mark.slow
def test_what_can_be_built_is_built_and_nothing_older_stands_beside_it(packages, tmp_path):
    packages("amd64")  # or it is skipped here
    (tmp_path / "dist").mkdir()
    (tmp_path / "dist/fieldlogger_0.1_sparc.deb").touch()
    done = _call_build(tmp_path, "sparc", "amd64")
    assert done.returncode == 1
    assert re.search(r"not built:\nsparc: .*\n$", done.stderr)
    (built,) = (tmp_path / "dist").iterdir()
    assert built.name.endswith("_amd64.deb")
    assert done.stdout.strip() == str(built)


def _build(arch):
    """Build the package of this checkout, or skip without a network or a compiler."""
    if shutil.which("dpkg-deb") is None:
        pytest.skip("no Debian here")
    done = subprocess.run([DEBIAN / "build.sh", arch], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip(f"no package could be built here: {done.stderr[-300:]}")
    return Path(done.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def packages():
    """Builds each architecture once."""
    built = {}

    def package(arch):
        if arch not in built:
            built[arch] = _build(arch)
        return built[arch]

    return package


@pytest.mark.slow
@pytest.mark.parametrize("arch", ["amd64", "arm64", "armhf"])
def test_what_is_inside(packages, arch, tmp_path):
    package = packages(arch)
    subprocess.run(["dpkg-deb", "-x", package, tmp_path], check=True)
    inside = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    for needed in (
        "usr/bin/fieldlogger",
        "usr/lib/systemd/system/fieldlogger.service",
        "usr/lib/udev/rules.d/70-cellwalk.rules",
        "usr/share/bash-completion/completions/fieldlogger",
        "usr/share/doc/fieldlogger/copyright",
        "usr/share/man/man1/fieldlogger-probe.1.gz",
    ):
        assert needed in inside
    assert not [name for name in inside if "postproc" in name or "__pycache__" in name]
    modules = sorted(name for name in inside if name.endswith(".so"))
    pythons = [re.search(r"cpython-3(\d+)-", name)[1] for name in modules]
    assert [f"3.{minor}" for minor in pythons] == PYTHONS[arch]
    for module in modules:
        header = subprocess.run(
            ["readelf", "-hA", tmp_path / module], capture_output=True, text=True, check=True
        ).stdout
        machine = {"amd64": "X86-64", "arm64": "AArch64", "armhf": "ARM"}[arch]
        assert re.search(rf"Machine: .*{machine}", header)
        # the Pi Zero and 1
        assert arch != "armhf" or "Tag_CPU_arch: v6\n" in header


@pytest.mark.slow
@pytest.mark.parametrize("arch", ["amd64", "arm64", "armhf"])
def test_lintian_finds_no_error(packages, arch):
    if shutil.which("lintian") is None:
        pytest.skip("no lintian here")
    done = subprocess.run(
        ["lintian", "--fail-on", "error,warning", packages(arch)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_install_sh_fetches_the_lists_that_a_fresh_card_lacks(packages, tmp_path):
    package = packages("amd64")
    pristine = base("bookworm", "amd64", "systemd,udev", "minbase")
    with chroot(pristine, tmp_path / "root") as debian:
        shutil.copytree(REPOSITORY / "systemd", debian.root / "tmp/systemd")
        shutil.copy(package, debian.root / "tmp/new.deb")
        lists, names = debian.root / "var/lib/apt/lists", debian.root / "etc/resolv.conf"
        shutil.rmtree(lists)
        shutil.copy("/etc/resolv.conf", names)
        debian.run("/tmp/systemd/install.sh /tmp/new.deb")
        assert "fieldlogger " in debian.run("fieldlogger --version")
        # without a network what is there already is enough
        shutil.rmtree(lists)
        names.unlink()
        assert "is there a network?" in debian.run("/tmp/systemd/install.sh /tmp/new.deb")


def _as_install_sh_left_it(root):
    """What install.sh of cellwalk 0.2 made, which would hide the files of the package."""
    program, link = root / "opt/cellwalk/bin/fieldlogger", root / "usr/local/bin/fieldlogger"
    unit = root / "etc/systemd/system/fieldlogger.service"
    rules = root / "etc/udev/rules.d/70-cellwalk.rules"
    for path in (root / "opt/cellwalk/pyvenv.cfg", program, unit, rules):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("of an earlier installation\n")
    link.symlink_to("/opt/cellwalk/bin/fieldlogger")
    return program, link, unit, rules


@pytest.mark.slow
@pytest.mark.parametrize("suite", ["bookworm", "trixie"])
@pytest.mark.parametrize("arch", ["arm64", "armhf"])
def test_it_runs_on_a_pis_processor(suite, arch, tmp_path, capsys):
    """By QEMU, with Debian's libraries of that release, as `make card-debs` collects them."""
    if os.getuid() != 0:
        pytest.skip("only root can change the root")
    let_run(arch)
    debs = tmp_path / "debs"
    collect = [DEBIAN / "card_debs.sh", debs, arch, suite]
    done = subprocess.run(collect, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip(f"no packages (no network?): {done.stderr[-300:]}")
    assert (debs / "made-for").read_text() == f"{suite} {arch}\n"
    with chroot(unpack_debs(debs, tmp_path / "unpacked"), tmp_path / "root") as debian:
        # which of the libraries of linear algebra is used is decided when they are configured
        algebra = [
            f"/{path.relative_to(debian.root)}"
            for name in ("blas", "lapack")
            for path in debian.root.glob(f"usr/lib/*/{name}")
        ]
        path = {"LD_LIBRARY_PATH": ":".join(algebra)}
        checked = debian.call("fieldlogger", "check", **path)
        assert "fail" not in checked
        walk = ("--out", "/tmp", "--speed", "1", "--duration", "20")
        debian.call("fieldlogger", "simulate", *walk, **path)
        assert (debian.root / "tmp/run-000001.h5").exists()
        python = debian.call("python3", "-c", "import os, sys; print(os.uname(), sys.version)")
        with capsys.disabled():
            print(f"\n{suite} {arch}: {python}{checked}")


@pytest.mark.slow
@pytest.mark.parametrize("suite", ["bookworm", "trixie"])
def test_its_life(packages, suite, tmp_path, capsys):
    """Install, record, upgrade, remove, install again, purge: the runs and the settings stay."""
    package = packages("amd64")
    needed = "systemd,udev,python3," + ",".join(
        line.split()[0] for line in _depends() if line.startswith("python3-")
    )
    with chroot(base(suite, "amd64", needed), tmp_path / "root") as debian:
        shutil.copy(with_version(package, "0.1.0", tmp_path), debian.root / "tmp/earlier.deb")
        shutil.copy(package, debian.root / "tmp/new.deb")
        before = debian.files()
        old = _as_install_sh_left_it(debian.root)
        debian.run("dpkg -i /tmp/earlier.deb")
        assert not [path for path in old if path.exists() or path.is_symlink()]
        assert "simulate" in debian.run("fieldlogger --help")
        assert "fail" not in debian.run(
            "cd / && fieldlogger check --config /etc/cellwalk/site.toml"
        )
        assert "_core.cpython" in debian.run(
            'python3 -c \'import sys; sys.path.insert(0, "/usr/lib/fieldlogger"); '
            "import msgspec._core; print(msgspec._core.__file__)'"
        )
        completion = "_FIELDLOGGER_COMPLETE=bash_complete COMP_WORDS='fieldlogger si' COMP_CWORD=1"
        assert debian.run(f"{completion} fieldlogger") == "plain,simulate\n"
        debian.run("mkdir -p /var/lib/cellwalk && cd /var/lib/cellwalk && "
                   "fieldlogger simulate --out . --speed 5 --duration 60")  # fmt: skip
        runs = sorted(path.name for path in (debian.root / "var/lib/cellwalk").iterdir())
        assert "run-000001.h5" in runs
        debian.run("fieldlogger recover /var/lib/cellwalk")
        with capsys.disabled():
            print(f"\n{suite}: {debian.run('python3 -VV').strip()}, {runs}")

        settings = debian.root / "etc/cellwalk/site.toml"
        settings.write_text("# mine\n")
        debian.run("systemctl disable fieldlogger-page.service")
        said = debian.run("dpkg -i /tmp/new.deb && dpkg -i /tmp/new.deb")
        assert 'the service does not start: /etc/cellwalk/site.toml: missing table "run"' in said
        wanted = debian.root / "etc/systemd/system/multi-user.target.wants"
        assert (wanted / "fieldlogger.service").is_symlink()
        assert not (wanted / "fieldlogger-page.service").is_symlink()  # as it was left
        assert settings.read_text() == "# mine\n"
        assert (debian.root / "usr/lib/fieldlogger/logger/__pycache__").is_dir()

        debian.run("dpkg -r fieldlogger")
        assert settings.read_text() == "# mine\n"
        assert not (debian.root / "usr/lib/fieldlogger").exists()
        debian.run("dpkg -i /tmp/new.deb && fieldlogger --help")
        assert "rm -r /var/lib/cellwalk" in debian.run("dpkg -P fieldlogger")
        assert runs == sorted(path.name for path in (debian.root / "var/lib/cellwalk").iterdir())
        left = {name for name, text in debian.files().items() if before.get(name) != text}
        users = {"etc/passwd", "etc/group", "etc/shadow", "etc/gshadow"}
        allowed = re.compile(r"var/lib/cellwalk/|var/log/|etc/(passwd|group|shadow|gshadow)-?$")
        assert {name for name in left if not allowed.match(name)} == set()
        assert users >= {name for name in left if name in users}
