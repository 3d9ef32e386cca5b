import json

import pytest

from postproc.cli import main
from postproc.reproductions import specification
from postproc.reproductions.checks import Check


@pytest.fixture(scope="module")
def quick():
    return [check for group in specification.GROUPS for check in group(specification.QUICK)]


def test_nothing_of_ours_fails(quick):
    assert [check.claim for check in quick if check.verdict == "fails"] == []


def test_every_claim_has_a_topic_and_is_made_once(quick):
    assert all(check.topic for check in quick)
    assert len({(check.topic, check.claim) for check in quick}) == len(quick)


def _few(verdict):
    return (lambda _: [Check("a | claim", "1 * 2 [3]", verdict, "topic")],)


def test_the_command_ends_with_1_where_our_own_code_fails(monkeypatch, capsys):
    monkeypatch.setattr(specification, "GROUPS", _few("fails"))
    assert main(["validate", "spec", "--quick"]) == 1
    assert "fails" in capsys.readouterr().out
    monkeypatch.setattr(specification, "GROUPS", _few("claim is wrong"))
    assert main(["validate", "spec"]) == 0


def test_table_and_json_say_the_same(monkeypatch, capsys):
    monkeypatch.setattr(specification, "GROUPS", _few("holds"))
    assert main(["validate", "spec", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["checks"] == [
        {"claim": "a | claim", "measured": "1 * 2 [3]", "verdict": "holds", "topic": "topic"}
    ]
    assert document["verdicts"] == {
        "holds": 1, "does not hold": 0, "claim is wrong": 0, "fails": 0,
    }  # fmt: skip
    assert main(["validate", "spec"]) == 0
    assert "1 * 2 [3]" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ((), "spec"),
        (("--quick", "--json"), "spec"),
        (("toa", "simulate", "--runs", "20", "--json"), "toa"),
        (("verify-theory", "--trials", "200", "--sigma", "50", "--json"), "theory"),
    ],
)
def test_names_of_earlier_versions_do_the_same_and_say_the_new_one(monkeypatch, capsys, old, new):
    monkeypatch.setattr(specification, "GROUPS", _few("holds"))
    earlier = ["validate", *old] if new == "spec" else list(old)
    assert main(earlier) == 0
    out, errors = capsys.readouterr()
    assert f"is now `postproc validate {new}`" in errors
    options = [
        word for word in earlier if word not in {"validate", "toa", "simulate", "verify-theory"}
    ]
    assert main(["validate", new, *options]) == 0
    now = capsys.readouterr()
    assert now.out == out
    assert "is now" not in now.err


def test_the_page_of_earlier_versions_is_gone(capsys):
    assert main(["validate", "--page"]) == 2
    assert "`postproc validate spec` prints the table" in capsys.readouterr().err


def test_theory(capsys):
    assert (
        main(["validate", "theory", "--trials", "500", "--sigma", "50", "--pfa", "0.02", "--json"])
        == 0
    )
    document = json.loads(capsys.readouterr().out)
    assert document["p_fa"] == 0.02
    assert len(document["rows"]) == 4
    by_claim = {check["claim"]: check["verdict"] for check in document["checks"]}
    assert by_claim["direct 0.97, indirect 0.98"] == "holds"
    few = ["--receivers", "1e3,0,0", "0,1e3,0", "-9e2,-5e2,300"]
    assert main(["validate", "theory", "--trials", "200", *few]) == 0
    text = capsys.readouterr().out
    assert "needs 4 receivers" in text
    assert "cannot be known" in text
    assert main(["validate", "theory", "--receivers", "1,2", "1,2,3"]) == 2
    assert "all alike" in capsys.readouterr().err
