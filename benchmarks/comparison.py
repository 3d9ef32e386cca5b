"""False words of `postproc compare`, over repeated walks, and how often it finds a change.

    .venv/bin/python benchmarks/comparison.py [--cells ../shared/cells] [--simulated 100]

Repeated walks: logs of phones over routes that were walked or driven many times; between two of
them nothing is supposed to have changed, though operators do change cells. They name the serving
cell only, so `new` and `gone` are not decided there. Simulated walks, of a modem that names the
seven strongest cells, have one change each in a city of 40 cells.
"""

import argparse
import csv
import gzip
from collections import Counter
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from logger.core.places import Places, Utm
from logger.core.readings import Readings
from postproc.comparison.changes import FEWEST_BLOCKS, Comparison, compare

SETS = {
    "ottawa, one route walked 14 times in 14 weeks": "ottawa_lacolyoc_*",
    "ottawa, university": "ottawa_uottawa_*",
    "cork, commutes by car": "cork_driving_*",
}
LISTS = "india_gsm.csv.gz"
"""Two hours of a GSM phone that lists six neighbours by channel and BSIC, on ground that it drives
again: its four half hours are compared with each other, also for `new` and `gone`."""
PARTS = 4
WORDS = ("new", "gone", "moved", "stronger", "weaker")
SIGMA_M = 5.0
MOST_HEARD = 5
"""The cell that changes is one of those that most scans name."""


def read_log(path: Path, utm: Utm | None) -> tuple[Utm, list[Readings]]:
    """Cells of a log, in the zone of the first one."""
    with gzip.open(path, "rt") as file:
        rows = [
            row
            for row in csv.DictReader(file)
            if _name(row) and row["lat"] and row["lon"] and row["level_dbm"]
        ]
    lat_deg, lon_deg, t_s, level_dbm = (
        np.array([float(row[name]) for row in rows]) for name in ("lat", "lon", "t_s", "level_dbm")
    )
    utm = utm or Utm.at(float(lat_deg[0]), float(lon_deg[0]))
    x_m, y_m = utm.to_xy_arrays(lat_deg, lon_deg)
    scan = np.unique(t_s, return_inverse=True)[1]
    name = np.array([_name(row) for row in rows])
    cells = []
    for cell in np.unique(name):
        at = name == cell
        t_ns = np.round(t_s[at] * 1e9).astype(np.int64)
        sigma_m = np.full(len(t_ns), SIGMA_M)
        cells.append(
            Readings(
                cell,
                cell.split()[0],
                Places.of(x_m[at], y_m[at], utm=utm, sigma_m=sigma_m, t_ns=t_ns),
                level_dbm[at],
                scan[at],
            )
        )
    return utm, cells


def _name(row: dict[str, str]) -> str:
    """Identity, or channel and BSIC of a neighbour; empty without either."""
    if row["cid"]:
        return f"{row['rat']} {row['lac_tac']}-{row['cid']}"
    return f"{row['rat']} {row['arfcn']}/{row['pci_bsic']}" if row["pci_bsic"] else ""


def walks_of(folder: Path, pattern: str) -> list[list[Readings]]:
    """The logs of a set."""
    utm, walks = None, []
    for path in sorted(folder.glob(pattern)):
        utm, cells = read_log(path, utm)
        walks.append(cells)
    return walks


def parts_of(cells: list[Readings], count: int) -> list[list[Readings]]:
    """A log in parts of equal time."""
    t_ns = np.concatenate([obs.t_ns for obs in cells])
    ends = np.linspace(np.min(t_ns), np.max(t_ns) + 1, count + 1)
    parts = []
    for begin, end in pairwise(ends):
        some = [obs.part((obs.t_ns >= begin) & (obs.t_ns < end)) for obs in cells]
        parts.append([obs for obs in some if len(obs)])
    return parts


def measure_repeated(name: str, walks: list[list[Readings]]) -> None:
    """Words between all pairs of walks that share ground."""
    words: Counter[str] = Counter()
    n_pairs = n_tested = n_with_word = 0
    for a, b in combinations(walks, 2):
        compared = compare(a, b, same_modem=True)
        tested = [cell for cell in compared.cells if cell.p is not None]
        if not tested:
            continue
        n_pairs, n_tested = n_pairs + 1, n_tested + len(tested)
        words.update(cell.word for cell in tested)
        n_with_word += any(cell.is_change for cell in compared.cells)
    low, high = _poisson(n_with_word)
    print(
        f"{name}: {n_pairs} pairs with common ground, {n_tested} cells tested "
        f"(at least {FEWEST_BLOCKS} blocks)"
    )
    print("   " + ", ".join(f"{words[word]} {word}" for word in WORDS))
    print(
        f"   pairs with a word: {n_with_word}, {n_with_word / max(n_pairs, 1):.3f} a pair "
        f"(95 % {low / max(n_pairs, 1):.3f} to {high / max(n_pairs, 1):.3f})"
    )


def _poisson(n: int) -> tuple[float, float]:
    low = 0.5 * float(chi2.ppf(0.025, 2 * n)) if n else 0.0
    return low, 0.5 * float(chi2.ppf(0.975, 2 * n + 2))


class City:
    """40 transmitters with shadowing that both walks share."""

    EXTENT_M, N_CELLS, LISTED = 2000.0, 40, 7

    def __init__(self, random: np.random.Generator) -> None:
        self.random = random
        self.site_m = random.uniform(-0.5, 1.5, (self.N_CELLS, 2)) * self.EXTENT_M
        self.power_dbm = random.uniform(-35.0, -15.0, self.N_CELLS)
        # shadowing as a sum of plane waves: 6 dB, decorrelating over some 50 m
        self.wave = random.normal(0.0, 1.0 / 50.0, (self.N_CELLS, 60, 2))
        self.phase = random.uniform(0.0, 2.0 * np.pi, (self.N_CELLS, 60))
        self.present = np.ones(self.N_CELLS, np.bool_)

    def levels_dbm(self, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        """Level of each cell at each position, shape (cells, n)."""
        at_m = np.stack([x_m, y_m], axis=1)
        away_m = np.linalg.norm(at_m[None] - self.site_m[:, None], axis=2)
        angle = np.einsum("cwk,nk->cwn", self.wave, at_m) + self.phase[:, :, None]
        shadow_db = 6.0 * np.sqrt(2.0 / 60.0) * np.sum(np.cos(angle), axis=1)
        level_dbm = self.power_dbm[:, None] - 32.0 * np.log10(np.maximum(away_m, 20.0)) + shadow_db
        return np.where(self.present[:, None], level_dbm, -np.inf)

    def walk(self) -> list[Readings]:
        """A walk of 3 km with a scan each 3 m, another modem, and the other side of the road."""
        way_m = np.arange(0.0, 3000.0, 3.0)
        x_m = np.minimum(way_m, 1500.0) + self.random.normal(0.0, 5.0)
        y_m = np.maximum(way_m - 1500.0, 0.0) + self.random.normal(0.0, 5.0)
        level_dbm = self.levels_dbm(x_m, y_m) + self.random.normal(0.0, 3.0)
        level_dbm = np.round(level_dbm + self.random.normal(0.0, 4.0, level_dbm.shape))
        strongest = np.argsort(-level_dbm, axis=0)[: self.LISTED]
        is_listed = np.zeros(level_dbm.shape, np.bool_)
        np.put_along_axis(is_listed, strongest, values=True, axis=0)
        is_listed &= level_dbm > -108.0
        cells = []
        for number, at in enumerate(is_listed):
            scan = np.flatnonzero(at)
            if len(scan):
                sigma_m = np.full(len(scan), SIGMA_M)
                cells.append(
                    Readings(
                        str(number),
                        "GSM",
                        Places.of(
                            x_m[at], y_m[at], utm=Utm(33), sigma_m=sigma_m, t_ns=scan * 2 * 10**9
                        ),
                        level_dbm[number, at],
                        scan,
                    )
                )
        return cells


def measure_simulated(count: int) -> None:
    """Share of walks in which a change gets its word, and words about unchanged cells."""
    if not count:
        return
    changes = {
        "nothing": None,
        "gone": "gone",
        "new": "new",
        "10 dB weaker": "weaker",
        "15 dB stronger": "stronger",
        "moved by 300 m": "moved",
        "moved by 1000 m": "moved",
    }
    for change, word in changes.items():
        n_found = n_false = n_cells = 0
        others: Counter[str] = Counter()
        for seed in range(count):
            compared, changed = _changed_walks(np.random.default_rng(seed), change)
            for cell in compared.cells:
                n_cells += cell.cell != changed
                n_false += cell.is_change and cell.cell != changed
                if cell.cell == changed:
                    n_found += cell.word == word
                    others[cell.word] += cell.word != word
        print(f"simulated, {change}: ", end="")
        if word:
            more = ", ".join(f"{n} {other}" for other, n in others.most_common() if n)
            print(f"{n_found / count:.2f} are named so ({more or 'no other word'}); ", end="")
        print(f"{n_false} words about {n_cells} unchanged cells in {count} pairs")


def _changed_walks(random: np.random.Generator, change: str) -> tuple[Comparison, str]:
    """Two walks with a change of one of the cells that are well received."""
    city = City(random)
    heard = sorted(city.walk(), key=len, reverse=True)[:MOST_HEARD]
    changed = int(heard[random.integers(len(heard))].cell)
    city.present[changed] = change != "new"
    a = city.walk()
    city.present[changed] = change != "gone"
    if change.startswith("moved"):
        angle = random.uniform(0.0, 2.0 * np.pi)
        away_m = float(change.split()[2])
        city.site_m[changed] += away_m * np.array([np.cos(angle), np.sin(angle)])
    city.power_dbm[changed] += {"10 dB weaker": -10.0, "15 dB stronger": 15.0}.get(change, 0.0)
    return compare(a, city.walk(), same_modem=False), "" if change == "nothing" else str(changed)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=Path, default=Path("../shared/cells"))
    parser.add_argument("--simulated", type=int, default=100)
    arguments = parser.parse_args()
    if arguments.cells.is_dir():
        for name, pattern in SETS.items():
            measure_repeated(name, walks_of(arguments.cells, pattern))
        parts = parts_of(read_log(arguments.cells / LISTS, None)[1], PARTS)
        measure_repeated("india, a GSM phone with its neighbours, ground driven again", parts)
    else:
        print(f"no repeated walks: {arguments.cells} is not there")
    measure_simulated(arguments.simulated)


if __name__ == "__main__":
    main()
