"""The same walk filtered from its start and from its end: two answers that must agree.

They come from the same readings, so a consistent pair differs by far less than its covariances
allow. A pair that differs by more than 4 combined standard deviations on any axis is never
averaged: at least one of the two is wrong (the gate at which RTKLIB's `valcomb` refuses to combine
a forward with a backward solution).
"""

from typing import NamedTuple

import numpy as np

from postproc.estimators.filters import FilterPath

GATE = 4.0
AXES = ("east", "north", "P0", "eta")
_FORMATS = ("{:.0f} m", "{:.0f} m", "{:.1f} dB", "{:.2f}")


class Comparison(NamedTuple):
    """Differences backward - forward of the last [x, y, P0, eta].

    `sigmas` are the differences divided by their combined standard deviations.
    """

    difference: tuple[float, float, float, float]
    sigmas: tuple[float, float, float, float]

    @property
    def largest(self) -> float:
        """Largest difference on any axis in combined standard deviations."""
        return max(abs(sigmas) for sigmas in self.sigmas)

    @property
    def agrees(self) -> bool:
        """Whether no axis differs by more than 4 combined standard deviations."""
        return self.largest <= GATE

    @property
    def warning(self) -> str | None:
        """Warning for a pair that does not agree."""
        if self.agrees:
            return None
        columns = zip(AXES, _FORMATS, self.difference, self.sigmas, strict=True)
        beyond = [
            f"{name} by {form.format(abs(difference))} ({abs(sigmas):.1f} sigma)"
            for name, form, difference, sigmas in columns
            if abs(sigmas) > GATE
        ]
        return (
            "the EKF forward and the EKF backward contradict each other, so trust neither: "
            f"{', '.join(beyond)}"
        )


def compare(forward: FilterPath, backward: FilterPath) -> Comparison:
    """Last state of a filter over the walk against that of one over the reversed walk."""
    difference = backward.x[-1, :4] - forward.x[-1, :4]
    variance = np.diagonal(forward.p[-1])[:4] + np.diagonal(backward.p[-1])[:4]
    sigmas = difference / np.sqrt(variance)
    return Comparison(tuple(difference.tolist()), tuple(sigmas.tolist()))
