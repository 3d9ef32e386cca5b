"""What a driver declares for the rules of suspicion is what it reads from replies."""

import json
from collections import Counter, defaultdict
from pathlib import Path

import pytest

from logger.core.suspicion.heard import Walker
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.tracker import Capabilities
from logger.core.types import CellReading, Scan
from logger.drivers.registry import FAMILIES
from tests.kit.drivers import own_replies

CORPUS = Path(__file__).parents[3] / "shared" / "corpus" / "modem"


def _needs_served(driver, texts):
    """Needs that the cells of some replies serve, by technology."""
    served = defaultdict(set)
    for text in texts:
        cells = [row for row in driver.read(text.splitlines()) if isinstance(row, CellReading)]
        for rat, n in Counter(cell.rat for cell in cells).items():
            served[rat] |= {"neighbours"} if n > 1 else set()
        for cell in cells:
            seen = Capabilities()
            seen.add(Walker(3.0).at(0, Scan(0, (cell,))))
            served[cell.rat] |= seen._served[cell.rat]
    return served


def _recorded_texts():
    """Texts of the corpus, each once for the driver that reads most of it."""
    texts = defaultdict(list)
    for entry in json.loads((CORPUS / "expected.json").read_text()):
        text = (CORPUS / entry["file"]).read_text("latin-1")
        best = max(FAMILIES.values(), key=lambda driver: len(driver.read(text.splitlines())))
        texts[best.name].append(text)
    return texts


@pytest.mark.parametrize("name", FAMILIES)
def test_nothing_is_read_that_is_not_declared(name):
    for rat, needs in _needs_served(FAMILIES[name], own_replies(name)).items():
        assert needs <= FAMILIES[name].gives.get(rat, set()), rat


@pytest.mark.skipif(not CORPUS.is_dir(), reason="no recorded replies here")
def test_nothing_is_declared_that_no_reply_has():
    recorded = _recorded_texts()
    for name, driver in FAMILIES.items():
        if name == "generic":  # its cell is made of several replies
            continue
        read = _needs_served(driver, [*own_replies(name), *recorded[name]])
        for rat, needs in driver.gives.items():
            assert needs <= read[rat], (name, rat, needs - read[rat])


def test_each_rule_can_be_asked_of_some_family():
    sources = [Capabilities(driver.gives) for driver in FAMILIES.values()]
    for source in sources:
        for need in ("position", "other cells", "earlier walks"):
            source.serve(need)
    unfed = {rule.id for rule in RULES.values() if not any(s.technologies(rule) for s in sources)}
    assert unfed == set()
