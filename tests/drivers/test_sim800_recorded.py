import json
import re
from pathlib import Path

import pytest

from logger.drivers.protocols.at import AtFramer, Reply
from logger.drivers.reading.row_language import as_json
from logger.drivers.sim800 import Sim800
from tests.kit.corpus import check_entry

MODEM = Sim800()
DATA = Path(__file__).parent / "data"


def replies_of(path, command="AT+CENG?"):
    """Lines of a recorded reply, through the framer as from a port, the end of the recording ending
    the last one.
    """
    framer = AtFramer()
    framer.send(command)
    events = [*framer.feed(path.read_bytes()), *framer.flush()]
    closed = [event for event in events if isinstance(event, Reply)]
    return [line for reply in closed or [framer.expire()] for line in reply.lines]


@pytest.mark.parametrize(
    ("file", "cells"),
    [
        (
            "sitch_sim800l_mode2.txt",
            [
                "310-260-275-20082",
                "310-260-275-42303",
                "310-260-275-42301",
                "310-260-275-20081",
                "310-260-275-42302",
                "310-260-275-24152",
                "310-260-275-20271",
            ],
        ),
        ("sim800_mode3_empty_slots.txt", ["460-00-20481-38589", "460-00-20481-38621"]),
        ("paratnc_sim800c_mode4_cut.txt", ["260-01-21405-26612", None, None]),
    ],
)
def test_recorded_reply(file, cells):
    assert [reading.cell for reading in MODEM.read(replies_of(DATA / file))] == cells


def test_reply_as_a_recording_and_as_a_port_gives_it(corpus):
    folder = corpus / "modem"
    entries = [
        e
        for e in json.loads((folder / "expected.json").read_text())
        if re.match("simcom_sim[89]00", e["dialect"])
    ]
    assert len(entries) >= 11
    for entry in entries:
        raw = folder / entry["file"]
        for lines in (
            raw.read_text("latin-1").splitlines(),
            replies_of(raw, entry["command"].split(";")[-1].strip()),
        ):
            check_entry(entry, [as_json(row) for row in MODEM.read(lines)])


def test_other_dialects_raise_nothing(corpus):
    for path in sorted((corpus / "modem").glob("*.txt")):
        MODEM.read(replies_of(path))
        MODEM.read(path.read_text("latin-1").splitlines())
