"""The estimate on the device after a complete walk."""

from logger.core.errors import EstimationError
from logger.core.live import live_prior
from logger.core.live_cell import CellEstimate, LiveCell
from logger.core.live_settings import LiveSettings
from logger.core.locator.online_values import LevelReading
from logger.core.observations import CellObservations
from logger.core.spikes import SpikeFilter


def last_estimate(
    obs: CellObservations, spikes: SpikeFilter[LevelReading] | None = None
) -> CellEstimate:
    """The last estimate of a cell; raises `EstimationError` where there is none."""
    cell, last = LiveCell(live_prior(LiveSettings()), spikes), None
    columns = (obs.x_m, obs.y_m, obs.position_sigma_m, obs.level_dbm, obs.limit)
    for row in zip(*(column.tolist() for column in columns), strict=True):
        last = cell.take(LevelReading(*row)) or last
        if cell.stale > 1.0:
            cell.search()
    if last is None:
        raise EstimationError("no live estimate")
    return last
