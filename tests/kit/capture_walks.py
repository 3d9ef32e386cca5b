"""Simulated walks past an LTE cell, heard by a modem as Rayhunter records it, and by AT."""

from typing import NamedTuple

import numpy as np

from logger.core.places import Places
from logger.core.runfile import RunWriter, read_run
from logger.core.types import CellReading, Fix, Record, Scan
from logger.sim.world import Radio, Transmitter, World
from postproc.interop.importing import import_walk
from postproc.smoothing import smooth_runs
from tests.kit import diag_capture as diag
from tests.kit.diag_capture import AHEAD_NS, EARFCN, IDENTITY, LAT, LON, NAME, OTHER_PCI, PCI, T0_NS
from tests.kit.runs import meta
from tests.kit.walks import region_contains

SCENES = {
    "passed": (
        (235.0, 240.0),
        [0, 210, 420, 630, 730, 930, 1130, 1330],
        [0, 210, 210, 420, 420, 220, 220, 20],
        [0, 0, 210, 210, 310, 310, 110, 110],
    ),
    "inside": (
        (150.0, 90.0),
        [0, 315, 630, 945, 1260],
        [0, 315, 315, 0, 0],
        [0, 0, 315, 315, 0],
    ),
}
"""Where an LTE cell stands: at a corner that is passed, or inside the block that is walked around.

Its place, and of each corner of the way the distance walked and the place, in m.
"""


class Ending(NamedTuple):
    """Error of a location, whether its 95 % region has the cell, that region's radius, verdict."""

    error_m: float
    covered: bool
    r95_m: float
    verdict: str


class Pair(NamedTuple):
    """A walk located by its capture, by AT, and by AT with a scan a second as the capture has."""

    seed: int
    capture: Ending
    at: Ending
    at_often: Ending | None = None

    def __str__(self):
        by = [
            f"{name} {one.error_m:.0f} m of {one.r95_m:.0f} m{'' if one.covered else ', missed'}"
            for name, one in (("capture", self.capture), ("AT", self.at), ("often", self.at_often))
            if one
        ]
        return f"walk {self.seed}: {'; '.join(by)}"


class Walk:
    """A walker who hears an LTE cell each second, beside another one."""

    SECONDS = 900

    def __init__(self, seed, scene="passed"):
        own_m, corners_m, east_m, north_m = SCENES[scene]
        rng = np.random.default_rng(seed)
        radio = Radio(floor_dbm=-140.0, step_db=0.0)
        cells = (
            Transmitter(*own_m, -25.0, 3.2, "262", "01", 4711, 26_214_401, EARFCN, 0, 20.0),
            Transmitter(-260.0, 40.0, -25.0, 3.2, "262", "01", 4711, 26_214_402, EARFCN, 0, 20.0),
        )
        self.world = World.build(cells, LAT, LON, radio, rng)
        s = np.arange(self.SECONDS) * 1.4
        self.east_m = np.interp(s, corners_m, east_m)
        self.north_m = np.interp(s, corners_m, north_m)
        self.level_dbm = self.world.received_dbm(self.east_m, self.north_m, rng)
        error_m = rng.normal(0.0, 3.0, (2, self.SECONDS))
        at = np.stack([self.east_m, self.north_m]) + error_m
        self.place = [self.world.to_latlon(x, y) for x, y in at.T.tolist()]
        self.jitter_db = rng.normal(0.0, 0.3, (2, self.SECONDS, 4))

    def as_zip(self, path):
        """Four records of each cell a second, a place every 5 s."""
        data = b""
        for second in range(self.SECONDS):
            t_ns = T0_NS + second * 10**9
            if second % 30 == 0:
                data += diag.log_frame(0xB0C2, t_ns, diag.serving_identity(EARFCN, PCI, IDENTITY))
            levels = self.level_dbm[:, second, None] + self.jitter_db[:, second]
            for part, (own_dbm, other_dbm) in enumerate(levels.T.tolist()):
                at_ns = t_ns + part * 200_000_000
                data += diag.log_frame(0xB17F, at_ns, diag.serving_cell(EARFCN, PCI, own_dbm))
                body = diag.neighbour_cells(EARFCN, [(OTHER_PCI, other_dbm)])
                data += diag.log_frame(0xB180, at_ns, body)
        gps = [
            diag.gps_line(T0_NS + s * 10**9, T0_NS + s * 10**9 + AHEAD_NS, *self.place[s])
            for s in range(0, self.SECONDS, 5)
        ]
        return diag.rayhunter_zip(path, data, gps)

    def as_at(self, path, every_s=3):
        """A scan now and then in steps of 1 dB, a fix each second."""
        writer = RunWriter(path, meta())
        fix_seq = None
        for second, (lat_deg, lon_deg) in enumerate(self.place):
            t_ns = second * 10**9
            fix_seq = writer.append(Record(t_ns, "gnss", Fix(True, T0_NS + t_ns, lat_deg, lon_deg)))
            if second % every_s == 0:
                mcc, mnc, tac, cid = IDENTITY
                own_dbm = float(np.round(self.level_dbm[0, second]))
                reading = CellReading(
                    "serving",
                    "LTE",
                    mcc,
                    mnc,
                    tac=tac,
                    cid=cid,
                    arfcn=EARFCN,
                    pci=PCI,
                    rsrp_dbm=own_dbm,
                )
                writer.append(Record(t_ns, "modem", Scan(t_ns, (reading,), fix_seq, fix_seq)))
        writer.close(self.SECONDS * 10**9, "test")
        return read_run(path)

    def ending(self, run):
        """Where the run places the cell, against where it stands."""
        own = self.world.transmitters[0]
        (cell,) = smooth_runs([run], [NAME]).cells
        east_m, north_m = self.world.to_local(cell.latitude_deg, cell.longitude_deg)
        true = Places.of_degrees(*self.world.to_latlon(own.east_m, own.north_m))
        return Ending(
            float(np.hypot(east_m - own.east_m, north_m - own.north_m)),
            region_contains(cell.posterior, (true.x_m[0], true.y_m[0])),
            cell.posterior.r95_m,
            cell.verdict,
        )


def side_by_side(seed, folder, scene="passed", *, often=False):
    """One walk both ways, or in all three."""
    walk = Walk(seed, scene)
    run = folder / f"{seed}.h5"
    import_walk(walk.as_zip(folder / f"{seed}.zip"), run)
    at = walk.as_at(folder / f"{seed}.journal")
    endings = [walk.ending(read_run(run)), walk.ending(at)]
    if often:
        endings.append(walk.ending(walk.as_at(folder / f"{seed}-often.journal", every_s=1)))
    return Pair(seed, *endings)
