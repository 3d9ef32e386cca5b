"""The words of cells for a status line."""

from typing import TYPE_CHECKING

from logger.device.status import SuspicionStatus

if TYPE_CHECKING:
    from logger.core.suspicion.words import Assessment

_MOST = 10
"""Cells in `status.json`: more is a list that nobody reads on a walk."""


def suspicion_status(assessments: "tuple[Assessment, ...]") -> tuple[SuspicionStatus, ...]:
    """Cells that are unusual or suspicious, the most suspicious first."""
    if not assessments:
        return ()
    from logger.core.suspicion.words import by_word  # noqa: PLC0415 (not before the first finding)

    named = [one for one in by_word(assessments) if one.word != "nothing unusual"]
    return tuple(
        SuspicionStatus(
            one.cell,
            one.word,
            round(one.score_nats, 2),
            tuple(finding.text for finding in one.findings),
        )
        for one in named[:_MOST]
    )
