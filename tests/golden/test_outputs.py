"""Help and JSON of every command are those that were meant: `python -m tests.golden.outputs`."""

import json
import re
from functools import partial

import click

from tests.golden import outputs
from tests.kit.documents import differences

ROUNDING = re.compile(r"\d\.\de-1\d")
"""What a processor leaves where the exact value is zero."""


def test_differences_are_noticed():
    document = {"a": [1.0, {"b": "x"}], "c": None}
    assert not list(differences(document, {"a": [1.0 + 1e-12, {"b": "x", "d": 1}], "c": None}))
    for other in (
        {"a": [1.0, {"b": "y"}], "c": None},
        {"a": [1.0 + 1e-5, {"b": "x"}], "c": None},
        {"a": [1.0], "c": None},
        {"a": [1.0, {"b": "x"}]},
        {"a": [1.0, {"b": "x"}], "c": 0},
    ):
        assert list(differences(document, other))


def test_json_is_the_expected(tmp_path):
    found = {}
    for name, document in outputs.documents(tmp_path):
        expected = json.loads((outputs.DOCUMENTS / f"{name}.json").read_text(encoding="utf-8"))
        found[name] = list(differences(expected, document, text=partial(ROUNDING.sub, "0")))
    assert found == {name: [] for name in outputs.COMMANDS}


def test_help_is_the_expected():
    assert outputs.helps() == outputs.HELP.read_text(encoding="utf-8")


def test_every_command_has_a_golden_output():
    covered = {line.split(" DIR")[0].split(" --")[0] for line in outputs.COMMANDS.values()}
    for name, command in outputs.commands():
        if isinstance(command, click.Group) or name in outputs.NO_GOLDEN:
            continue
        assert any(line.startswith(name) for line in covered), f"{name} has no golden output"
