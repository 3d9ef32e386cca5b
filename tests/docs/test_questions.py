"""What users ask is answered by a page: `questions.toml` names the section and the words in it."""

import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

from logger.drivers.registry import FAMILIES
from tests.docs.commands import PROGRAMS, run
from tests.docs.pages import ROOT, section_of

QUESTIONS = tomllib.loads(Path(__file__).with_name("questions.toml").read_text("utf-8"))["question"]
FEWEST = 60


@cache
def printed_by(command: str) -> str:
    """What a command of ours prints, or a module of the repository by `python -m`."""
    program, *arguments = command.split()
    if program in PROGRAMS:
        return run(program, *arguments)[1]
    completed = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return completed.stdout


def missing_words(question: dict, page: str) -> list[str]:
    """The words of an answer that are not where the question says; all without such a section."""
    section = section_of(page, question.get("heading", ""))
    if section is None:
        return question["answer"]
    command = question.get("command")
    if command:
        if command not in section:
            return [command]
        section = printed_by(command)
    text = " ".join(section.split())
    return [words for words in question["answer"] if " ".join(words.split()) not in text]


@pytest.mark.parametrize("question", QUESTIONS, ids=lambda question: question["asks"])
def test_a_page_answers(question):
    assert missing_words(question, (ROOT / question["page"]).read_text("utf-8")) == []


@pytest.mark.parametrize("question", QUESTIONS, ids=lambda question: question["asks"])
def test_a_deleted_answer_is_noticed(question):
    """Without the lines that hold an answer, and without the section, nothing is answered."""
    page = (ROOT / question["page"]).read_text("utf-8")
    wanted = [question["command"]] if "command" in question else question["answer"]
    section = section_of(page, question.get("heading", ""))
    assert missing_words(question, page.replace(section, "")) != []
    for words in wanted:
        pattern = r"\s+".join(map(re.escape, words.split()))
        without = section_of(re.sub(pattern, "", page), question.get("heading", ""))
        assert without is None or missing_words(question, re.sub(pattern, "", page)) != []


def test_there_are_enough_questions_and_each_is_asked_once():
    asked = [question["asks"] for question in QUESTIONS]
    assert len(asked) >= FEWEST
    assert sorted(set(asked)) == sorted(asked)
    assert [
        asks for asks, question in zip(asked, QUESTIONS, strict=True) if not question["answer"]
    ] == []


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_every_modem_family_is_asked_for(family):
    """A question names the section of the driver in its notes, or the driver in its answer."""
    assert [
        question["asks"]
        for question in QUESTIONS
        if question.get("heading", "").startswith(f"{family}: ")
        or f"`{family}`" in question["answer"]
    ]


def test_the_table_of_modems_has_every_driver():
    table = section_of((ROOT / "systemd/README.md").read_text("utf-8"), "Modems")
    assert set(re.findall(r"^\| `(\w+)` ", table, re.MULTILINE)) == set(FAMILIES)
