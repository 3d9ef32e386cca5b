import json
import re
from pathlib import Path

import pytest

from postproc.cli import main
from postproc.reproductions.validate import report, suite
from postproc.reproductions.validate.check import Check

PAGE = Path(__file__).resolve().parents[4] / "VALIDATION.md"
NUMBER = re.compile(r"-?\d+\.?\d*")


@pytest.fixture(scope="module")
def quick():
    return [check for group in suite.GROUPS for check in group(suite.QUICK)]


def _claim(line):
    return line.split(" | ")[0]


def test_the_page_is_what_the_command_prints_as_far_as_nothing_is_simulated_or_timed(quick):
    text = PAGE.read_text()
    lines = text.splitlines()
    for check in quick:
        row = report.row(check)
        if check.is_sampled or check.is_timed:
            assert _claim(row) in {_claim(line) for line in lines}
        else:
            assert row in lines
    retained = [
        line
        for line in report.page(quick).splitlines()
        if not line.startswith(("| ", f"{len(quick)} checks"))
    ]
    assert retained == [
        line for line in lines if not line.startswith(("| ", f"{len(quick)} checks"))
    ]
    assert len(quick) == sum(line.startswith("| ") for line in lines) - len(
        {check.topic for check in quick}
    )


def test_nothing_of_ours_fails(quick):
    assert [check.claim for check in quick if check.verdict == "fails"] == []


@pytest.mark.slow
def test_the_whole_page_is_what_the_command_prints(capsys):
    """Words and verdicts to the letter; figures to 2 %, since another BLAS adds up in another
    order.
    """
    assert main(["validate", "--page"]) == 0
    timed = "differs by machine"
    printed, retained = (
        "\n".join(
            line for line in text.splitlines() if timed not in line and " checks: " not in line
        )
        for text in (capsys.readouterr().out, PAGE.read_text())
    )
    assert NUMBER.sub("#", printed) == NUMBER.sub("#", retained)
    result, expected = ([float(n) for n in NUMBER.findall(text)] for text in (printed, retained))
    assert result == pytest.approx(expected, rel=0.02, abs=0.02)


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
