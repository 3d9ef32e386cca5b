"""Small synthetic cities as surveys."""

from benchmarks.synthetic_city.walks import draw_walk, draw_walkers
from benchmarks.synthetic_city.world import draw_city
from postproc.survey.dataset import Survey
from postproc.survey.parquet_batch import Batch


def write_city(
    folder, *, n_stations=2, n_runs=8, n_scans=120, walkers=None, order=None, split=0,
    spacing_m=350.0,
):  # fmt: skip
    """A survey of walks in a city; `order` and `split` say how they come into batches."""
    city = draw_city(n_stations, 4, spacing_m=spacing_m)
    walkers = walkers or draw_walkers(2, 4)
    survey = Survey.open_or_make(folder)
    numbers = list(order or range(n_runs))
    parts = [numbers[:split], numbers[split:]] if split else [numbers]
    for k, part in enumerate(parts, 1):
        batch = Batch()
        for number in part:
            batch.take(draw_walk(city, walkers[number % len(walkers)], number, n_scans, 4))
        batch.write(folder, f"{k:06d}")
    return city, Survey.open(survey.folder)
