"""Say which settings of EXAMPLE an upgraded SITE.TOML does not name, each of them once.

Arguments: EXAMPLE, SITE.TOML, and a file of the settings that were printed before. postinst calls
it; a configuration that the new version refuses is reported, since the service fails with it.
"""

import re
import sys
import tomllib
from itertools import groupby
from pathlib import Path

sys.path.insert(0, "/usr/lib/fieldlogger")
NAME = re.compile(r"[\s#]*(?:\[\[?(\w+)\]|(\w+) *=)")
"""A table or a key; keys that are commented out show their defaults."""


def main(example: Path, site: Path, printed: Path) -> None:
    from logger.config import load_config  # noqa: PLC0415 (found by the line above)
    from logger.core.errors import ConfigError  # noqa: PLC0415

    try:
        text = load_config(site)[1]
    except ConfigError as error:
        print(f"fieldlogger: the service does not start: {error}")
        return
    old = printed.read_text("utf-8").splitlines() if printed.exists() else []
    known = {*old, *_named(text), *_set(text)}
    new = [setting for setting in _named(example.read_text("utf-8")) if setting not in known]
    if not new:
        return
    print(f"fieldlogger: {site} does not name these settings, which have their defaults:")
    for table, settings in groupby(new, lambda setting: setting.split()[0]):
        print(f"  {table}", ", ".join(setting.split()[1] for setting in settings))
    print(f"{example} explains them.")
    printed.parent.mkdir(parents=True, exist_ok=True)
    printed.write_text("\n".join([*old, *new]) + "\n", "utf-8")


def _named(text: str) -> list[str]:
    """Settings in the lines of a text, those in comments as well, as `[page] map`."""
    table, settings = "", []
    for line in text.splitlines():
        if match := NAME.match(line):
            table = match[1] or table
            # what a [[source]] may have is no default of a configuration without one
            is_default = match[2] and table != "source"
            settings += [f"[{table}] {match[2]}"] if is_default else []
    return settings


def _set(text: str) -> list[str]:
    """Settings of a configuration, however it is written."""
    return [f"[{table}] {key}" for table, keys in tomllib.loads(text).items() for key in keys]


main(*map(Path, sys.argv[1:]))
