import json

import pytest

from postproc.cli import main
from postproc.reproductions.validate import suite
from postproc.reproductions.validate.check import Check


@pytest.fixture(scope="module")
def quick():
    return [check for group in suite.GROUPS for check in group(suite.QUICK)]


def test_nothing_of_ours_fails(quick):
    assert [check.claim for check in quick if check.verdict == "fails"] == []


def _few(verdict):
    return (lambda _: [Check("topic", "a | claim", "1 * 2 [3]", verdict)],)


def test_the_command_ends_with_1_where_our_own_code_fails(monkeypatch, capsys):
    monkeypatch.setattr(suite, "GROUPS", _few("fails"))
    assert main(["validate", "--quick"]) == 1
    assert "fails" in capsys.readouterr().out
    monkeypatch.setattr(suite, "GROUPS", _few("claim is wrong"))
    assert main(["validate"]) == 0


def test_table_json_and_page_say_the_same(monkeypatch, capsys):
    monkeypatch.setattr(suite, "GROUPS", _few("holds"))
    assert main(["validate", "--json"]) == 0
    (check,) = json.loads(capsys.readouterr().out)["checks"]
    assert (check["claim"], check["measured"], check["verdict"]) == (
        "a | claim",
        "1 * 2 [3]",
        "holds",
    )
    assert main(["validate"]) == 0
    assert "1 * 2 [3]" in capsys.readouterr().out
    assert main(["validate", "--page"]) == 0
    assert "| a \\| claim | 1 \\* 2 [3] | holds |" in capsys.readouterr().out


def test_json_and_page_exclude_each_other(capsys):
    assert main(["validate", "--json", "--page"]) == 2
    assert "not allowed" in capsys.readouterr().err
