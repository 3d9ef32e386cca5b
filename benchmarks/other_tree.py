"""`locate` and a live reading in this tree against another one, in one run: time and results.

python benchmarks/other_tree.py TREE        (such as `git worktree add TREE fc7563c`)
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parents[1]
ROUNDS = 3
WORKER = """
import os, sys, json, time
os.environ["OPENBLAS_NUM_THREADS"] = "1"
sys.path.insert(0, sys.argv[1])
import numpy as np
from logger.core.live import live_prior
from logger.core.live_cell import LiveCell
try:
    from logger.core.places import Places
    from logger.core.readings import Readings
except ImportError:  # before readings had places
    from logger.core.places import Utm
    from logger.core.live_cell import LevelReading
    from logger.core.readings import Readings
    Places = None
from logger.core.live_settings import LiveSettings
try:
    from logger.core.locator.pipeline import locate
except ImportError:
    from logger.core.locator.posterior import locate
results = {}
for seed in range(3):
    for shadow_db in (0.0, 6.0):
        rng = np.random.default_rng(seed)
        s = np.arange(600) * 1.4
        x = np.interp(s, [0, 200, 400, 600, 840], [0, 200, 200, 400, 400])
        y = np.interp(s, [0, 200, 400, 600, 840], [0, 0, 200, 200, 440])
        k = np.exp(-np.abs(s[:, None] - s) / 15.0) + 1e-9 * np.eye(600)
        level = -25.0 - 32.0 * np.log10(np.hypot(x - 160.0, y - 240.0))
        level += shadow_db * np.linalg.cholesky(k) @ rng.normal(size=600)
        level += 2.0 * rng.normal(size=600)
        level, sigma = np.round(level), np.full(600, 3.0)
        t_ns = (s * 1e9).astype(np.int64)
        if Places:
            places = Places.of(x, y, sigma_m=sigma, t_ns=t_ns)
            obs = Readings("cell", None, places, level, np.arange(600))
            each = [Readings.one("cell", None, places[i], level[i]) for i in range(600)]
        else:
            obs = Readings("cell", None, Utm(32), t_ns, x, y, sigma, level, np.arange(600))
            columns = x.tolist(), y.tolist(), sigma.tolist(), level.tolist()
            each = [LevelReading(*row, 0) for row in zip(*columns)]
        begun = time.process_time()
        p = locate(obs)
        spent = time.process_time() - begun
        values = [p.x_m, p.y_m, p.r95_m, p.p0_dbm, p.eta, p.sigma_db, p.log_evidence]
        results[f"locate, seed {seed}, shadowing {shadow_db} dB"] = spent, values
        cell, estimate = LiveCell(live_prior(LiveSettings())), None
        begun = time.process_time()
        for reading in each:
            estimate = cell.take(reading) or estimate
            if cell.stale > 1.0:
                cell.search()
        spent = (time.process_time() - begun) / 600
        name = f"live reading, seed {seed}, shadowing {shadow_db} dB"
        results[name] = spent, list(estimate.state)
print(json.dumps(results))
"""


def results_of(tree: Path) -> dict[str, tuple[float, list[float]]]:
    """CPU seconds and values of each case, computed by the code of a tree."""
    command = [sys.executable, "-c", WORKER, str(tree)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    """Print one line for each case, and the ratio of the sums."""
    other = Path(sys.argv[1]).resolve()
    rounds = [(results_of(other), results_of(HERE)) for _ in range(ROUNDS)]
    total = np.zeros(2)
    for name in rounds[0][0]:
        theirs, ours = (min(one[i][name][0] for one in rounds) for i in (0, 1))
        before, now = (np.array(rounds[0][i][name][1]) for i in (0, 1))
        apart = np.max(np.abs(now - before) / np.maximum(np.abs(before), 1e-6))
        print(f"{name:40} {1e3 * theirs:9.3f} ms -> {1e3 * ours:9.3f} ms, apart by {apart:.0e}")
        total += [theirs, ours] if name.startswith("locate") else [600 * theirs, 600 * ours]
    print(f"ratio of all: {total[1] / total[0]:.2f}")


if __name__ == "__main__":
    main()
