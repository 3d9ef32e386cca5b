"""Scans of a walk for the tests of the rules."""

from dataclasses import replace

from logger.core.suspicion.tracker import SuspicionTracker
from logger.core.types import CellReading, Fix, Record, Scan
from tests.kit import runs

LAT_DEG, LON_DEG = 47.0707, 15.4395  # Graz
_METRES_PER_DEG = 111_320.0


def gsm(cid, dbm=-80.0, *, lac=1201, mcc="232", mnc="01", arfcn=None, role="neighbour", **more):
    """One GSM cell."""
    channel = 1 + cid % 100 if arfcn is None else arfcn
    return CellReading(
        role, "GSM", mcc, mnc, lac, cid, channel, bsic=8, rssi_dbm=float(dbm), **more
    )


def write_walk(path, cells):
    """A journal of 20 scans of the same cells, 6 m to the north of each other."""
    write_scans(path, [cells] * 20)


def write_scans(path, scans):
    """A journal of scans, 6 m to the north of each other."""
    records = []
    for k, cells in enumerate(scans):
        t_ns = (k + 1) * 5 * 10**9
        lat_deg = LAT_DEG + k * 6.0 / _METRES_PER_DEG
        records.append(Record(t_ns, "gnss", Fix(True, lat_deg=lat_deg, lon_deg=LON_DEG)))
        records.append(Record(t_ns, "modem", Scan(t_ns, tuple(cells))))
    runs.write_journal(path, records)


class Walk:
    """A walk to the north: each scan comes with a fix, `seconds` and `metres` after the last."""

    def __init__(self, **tracker):
        self.tracker = SuspicionTracker(**tracker)
        self.t_s = self.north_m = 0.0
        self.found = []

    def scan(self, *readings, seconds=5.0, metres=6.0, times=1, modem="modem"):
        """The first reading is that of the serving cell."""
        for _ in range(times):
            self.t_s += seconds
            self.north_m += metres
            t_ns = round(self.t_s * 1e9)
            lat_deg = LAT_DEG + self.north_m / _METRES_PER_DEG
            fix = Fix(True, lat_deg=lat_deg, lon_deg=LON_DEG)
            cells = tuple(
                replace(r, role="serving" if i == 0 else r.role) for i, r in enumerate(readings)
            )
            self.tracker.feed(Record(t_ns, "gnss", fix))
            self.found += self.tracker.feed(Record(t_ns, modem, Scan(t_ns, cells)))
        return self

    @property
    def rules(self):
        """Rule and cell identity of each finding."""
        return {(finding.rule.id, int(finding.cell.split("-")[-1])) for finding in self.found}

    def word(self, cell):
        return self.tracker.assessment(cell).word
