from benchmarks import soak
from logger.core.types import CellReading
from logger.drivers.registry import FAMILIES
from logger.sim.world import Air, ReceivedCell


def test_its_modem_reports_every_cell_of_the_town():
    cells = soak.town().transmitters
    air = Air.of([ReceivedCell(cell, -80.0, is_decoded=True) for cell in cells])
    rows = FAMILIES["sim800"].rows_in("".join(soak.all_cells(air, {})).splitlines())
    named = [row.cid for row in rows if isinstance(row, CellReading)]
    assert sorted(named) == sorted(cell.cid for cell in cells)
