"""The estimate on the device after a complete walk."""

from logger.core.errors import EstimationError
from logger.core.live import live_prior
from logger.core.live_cell import CellEstimate, LiveCell
from logger.core.live_settings import LiveSettings
from logger.core.readings import Readings
from logger.core.spikes import SpikeFilter


def last_estimate(obs: Readings, spikes: SpikeFilter[Readings] | None = None) -> CellEstimate:
    """The last estimate of a cell; raises `EstimationError` where there is none."""
    cell, last = LiveCell(live_prior(LiveSettings()), spikes), None
    for reading in obs:
        last = cell.take(reading) or last
        if cell.stale > 1.0:
            cell.search()
    if last is None:
        raise EstimationError("no live estimate")
    return last
