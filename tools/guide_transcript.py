"""Follow docs/guide.md from an installed Pi to a located cell; write dist/transcript.md.

    python tools/guide_transcript.py dist/cellwalk-*.whl

The commands are those of the guide, in its order, and what they print is what the programs print.
What cannot be had is emulated: see `EMULATED`. Needs pipx, and a package index for the libraries.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from logger.device.clock import Clock
from logger.sim.ptys import PtyDevice, answering, talking
from logger.sim.scenario import scenario
from logger.sim.walk import WalkTime

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "dist/transcript.md"
BIN = Path(sys.executable).parent
_MOST_LINES = 12
_DEVICE_S = 60.0
_CUT_AT = re.compile(r"INFO 18\d\d s:")
"""The plug is pulled after half an hour of the walk."""

EMULATED = """\
# The whole way, with its output

`tools/guide_transcript.py` followed docs/guide.md from an installed Pi to a located
cell: {count} commands. The commands are those of the guide, the output is that of the programs; at
most {most} lines of each are shown.

What could not be had was emulated:

- modem and receiver: simulated ones behind real serial ports of Linux (pseudo-terminals), whose
  names `probe` was given;
- systemd: `fieldlogger run` was started as the service would start it, and killed for the plug;
- the Pi: this is a server, so `doctor` finds no sensors of a Pi;
- walking: `fieldlogger simulate` is the same service on a simulated walk, 40 times faster. The
  second walk was killed in its 31st minute, as by pulling the plug, and `fieldlogger recover` made
  its file, as the next start of a Pi does;
- scp: a copy on the same machine.

"""


@dataclass
class Transcript:
    """Commands as the guide has them, with what they printed."""

    folder: Path
    parts: list[str] = field(default_factory=list)
    count: int = 0

    def say(self, text: str) -> None:
        """A paragraph of the page."""
        self.parts.append(text)

    def run(self, shown: str, *command: str, seconds: float = 900.0) -> None:
        """Run a command that stands for `shown`, and record what it prints."""
        own = {
            "COLUMNS": "96",
            "PATH": f"{self.folder / 'bin'}:{os.environ['PATH']}",
            "PIPX_HOME": str(self.folder / "pipx"),
            "PIPX_BIN_DIR": str(self.folder / "bin"),
        }
        done = subprocess.run(
            command, cwd=self.folder, capture_output=True, text=True, timeout=seconds, check=False,
            env={**os.environ, **own},
        )  # fmt: skip
        if done.returncode:
            raise SystemExit(f"{shown}: {done.stdout}{done.stderr}")
        self.count += 1
        progress = [line for line in done.stderr.splitlines() if line.startswith("probing")]
        self.parts.append(_block(shown, [*progress, *done.stdout.splitlines()]))


def _block(shown: str, lines: list[str]) -> str:
    more = len(lines) - _MOST_LINES
    kept = lines[:_MOST_LINES] + ([f"[{more} more lines]"] if more > 0 else [])
    body = "\n".join(part for line in kept for part in _folded(line.rstrip()))
    return f"```text\n$ {shown}\n{body}\n```".replace("\n\n```", "\n```")


def _folded(line: str) -> list[str]:
    """A line in pieces of at most 96 characters, as a terminal shows it."""
    return [line[i : i + 96] for i in range(0, len(line), 96)] or [""]


def main(wheel: Path) -> None:
    """Follow the guide and write the page."""
    with tempfile.TemporaryDirectory(prefix="guide-") as name:
        page = Transcript(Path(name))
        site, runs = page.folder / "site.toml", page.folder / "runs"
        page.say("## On the Pi")
        _first_boot(page, site, runs)
        page.say("## At home, after a walk past a mast and a walk around the suspected place")
        _walks(runs)
        newest = sorted(runs.glob("run-*.h5"))
        page.run("pipx install '.[post]'", str(BIN / "pipx"), "install", f"{wheel.resolve()}[post]")
        _copy(page, newest[-2])
        page.run(f"postproc smooth {newest[-2].name}", "postproc", "smooth", newest[-2].name)
        _copy(page, newest[-1])
        for command in ("suspect", "smooth", "report"):
            page.run(f"postproc {command} {newest[-1].name}", "postproc", command, newest[-1].name)
        head = EMULATED.format(count=page.count, most=_MOST_LINES)
        text = "\n\n".join([head.rstrip(), *page.parts]) + "\n"
        PAGE.parent.mkdir(exist_ok=True)
        PAGE.write_text(text.replace(name, "/home/pi"), "utf-8")
        print(f"{PAGE}: {page.count} commands")


def _first_boot(page: Transcript, site: Path, runs: Path) -> None:
    walk, now = scenario("block", 1), WalkTime(Clock())
    with ExitStack() as stack:
        sessions = (answering(walk.modem(now.now_s)), talking(walk.receiver(), now))
        ports = [stack.enter_context(PtyDevice(session)).path for session in sessions]
        probe = (str(BIN / "fieldlogger"), "probe", *ports, "--write", "site.toml")
        page.run("sudo fieldlogger probe --write site.toml", *probe)
        text = re.sub(r"directory = .*", f'directory = "{runs}"', site.read_text("utf-8"))
        runs.mkdir()
        page.run("sudo cp site.toml /etc/cellwalk/site.toml", "cp", "site.toml", "installed.toml")
        (page.folder / "installed.toml").write_text(text, "utf-8")
        page.run("sudo systemctl start fieldlogger", "true")
        service = subprocess.Popen(
            [BIN / "fieldlogger", "run", "--config", "installed.toml"],
            cwd=page.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            time.sleep(_DEVICE_S)
            doctor = (str(BIN / "fieldlogger"), "doctor", "--config", "installed.toml")
            page.run("sudo fieldlogger doctor", *doctor)
        finally:
            service.kill()
            service.wait()


def _walks(runs: Path) -> None:
    """A walk past legitimate cells, and one around a rogue station that ends by a power cut."""
    simulate = [str(BIN / "fieldlogger"), "simulate", "--out", str(runs), "--speed", "40"]
    mast = [*simulate, "--scenario", "city-clean", "--seed", "2", "--duration", "1900"]
    subprocess.run(mast, check=True, capture_output=True)
    with subprocess.Popen(
        [*simulate, "--seed", "3"], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True
    ) as walk:
        assert walk.stderr is not None
        for line in walk.stderr:
            if _CUT_AT.match(line):
                walk.kill()
                break
    recover = [str(BIN / "fieldlogger"), "recover", str(runs)]
    subprocess.run(recover, check=True, capture_output=True)


def _copy(page: Transcript, run: Path) -> None:
    shutil.copy(run, page.folder)
    page.run(f"scp pi@cellwalk.local:/var/lib/cellwalk/{run.name} .", "true")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
