"""What commands print by default needs no knowledge of rules and statistics."""

import re
import shutil
from html import unescape

import pytest

from logger.core.suspicion.rule import WORDS
from logger.core.suspicion.rules import rules_note, rules_version
from logger.core.suspicion.words import in_plain_words
from postproc.cli import main
from postproc.suspicion.run_assessment import ALL_RULES
from tests.fixtures import make

IDS = "|".join(rule.id for rule in ALL_RULES)
FORBIDDEN = re.compile(
    rf"\bnats?\b|\[(?:{IDS})\]|\b(?:{IDS})\b,? \(no|: (?:{IDS}) |not asked|\d\.\d{{6}}"
)
COMMANDS = [
    "smooth rogue-sim800.h5 --cell 232-01-7777-4660",
    "smooth walk.h5 --cell 001-01-32001-6699",
    "suspect rogue-sim800.h5",
    "suspect walk.h5",
    "next walk.h5 --cell 001-01-32001-6699",
    "compare rogue-sim7600.h5 rogue-sim800.h5",
    "info rogue-sim800.h5",
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("words")
    for name in make.RUNS:
        shutil.copy(make.HERE / f"{name}.h5", folder)
    return folder


def _output_of(folder, command, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    capsys.readouterr()
    assert main(command.split()) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("command", COMMANDS)
def test_no_nats_and_no_codes_of_rules(folder, command, monkeypatch, capsys):
    text = _output_of(folder, command, monkeypatch, capsys)
    assert len(text.splitlines()) > 3
    assert FORBIDDEN.findall(text) == []


def test_nor_on_the_page(folder, monkeypatch, capsys):
    _output_of(folder, "report rogue-sim800.h5 --cell 232-01-7777-4660", monkeypatch, capsys)
    page = (folder / "rogue-sim800.html").read_text()
    text = unescape(re.sub(r"<svg.*?</svg>|<style.*?</style>|<[^>]*>", " ", page, flags=re.DOTALL))
    assert "232-01-7777-4660: suspicious" in text
    assert FORBIDDEN.findall(text) == []


def test_nor_in_the_sentences_of_guide():
    for answer in make.guide_answer((make.HERE / "guide.csv").read_text()):
        texts = [answer["text"], answer["next"]["text"] if answer["next"] else ""]
        assert FORBIDDEN.findall("\n".join(texts)) == []
        assert answer["verdict"] != "cannot tell" or ": " in answer["text"]


def test_each_cell_that_is_not_located_has_its_reason(folder, monkeypatch, capsys):
    text = _output_of(folder, "smooth rogue-sim800.h5", monkeypatch, capsys)
    assert FORBIDDEN.findall(text) == []
    answer = make.stored_summary(folder / "rogue-sim800.post.h5")
    (wide,) = re.findall(r"^(\d+) cells are not located because", text, re.MULTILINE)
    (folded,) = re.findall(r"^(\d+) more cells cannot be located", text, re.MULTILINE)
    said = [
        cell
        for cell in answer["cells"]
        if re.search(rf"^{cell['cell']}  {re.escape(cell['warnings'][0])}", text, re.MULTILINE)
    ]
    assert int(wide) + int(folded) + len(said) == len(answer["cells"]) == 19
    words = {cell.get("word") for cell in answer["cells"]}
    assert words == {"suspicious", "nothing unusual", None}  # one scan alone named a cell


def test_the_weight_of_an_event_is_left_out():
    for word in WORDS:
        event = f"232-01-7777-4660: {word}, 6.25 nats: L2 area 7777 has this cell alone"
        assert in_plain_words(event) == f"232-01-7777-4660: {word}: area 7777 has this cell alone"
    assert in_plain_words(rules_note().text) == f"version {rules_version()}"
    assert in_plain_words("the modem hangs, 3 nats: L2") == "the modem hangs, 3 nats: L2"
