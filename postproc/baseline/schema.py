"""Tables of a baseline.

`heard`, `visit` and `heard_channel` have what each walk contributes, so that a walk can be removed
again; `square_cell`, `square_rat`, `cell` and `cell_channel` have the sums over all walks, from
which lookups answer. `SUMS` computes the sums of what one walk touches anew.
"""

from logger.baseline_file import APPLICATION_ID, VERSION

TABLES = (
    """CREATE TABLE walk (
        id INTEGER PRIMARY KEY, digest TEXT NOT NULL UNIQUE, run_id TEXT NOT NULL,
        name TEXT NOT NULL, began_utc_ns INTEGER, n_readings INTEGER NOT NULL,
        n_squares INTEGER NOT NULL, n_cells INTEGER NOT NULL,
        seal TEXT) STRICT""",
    """CREATE TABLE cell (
        id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, rat TEXT NOT NULL,
        mcc TEXT NOT NULL, mnc TEXT NOT NULL, area TEXT NOT NULL, cid TEXT NOT NULL,
        n_walks INTEGER NOT NULL DEFAULT 0, n_scans INTEGER NOT NULL DEFAULT 0) STRICT""",
    "CREATE INDEX cell_identity ON cell (mcc, mnc, cid)",
    "CREATE INDEX cell_operator ON cell (mcc, mnc, rat)",
    """CREATE TABLE heard (
        walk INTEGER NOT NULL, cell INTEGER NOT NULL, square INTEGER NOT NULL,
        n_scans INTEGER NOT NULL, best_dbm REAL NOT NULL, sum_level INTEGER NOT NULL,
        sum_squares INTEGER NOT NULL, PRIMARY KEY (walk, cell, square)) STRICT, WITHOUT ROWID""",
    "CREATE INDEX heard_where ON heard (cell, square)",
    """CREATE TABLE visit (
        walk INTEGER NOT NULL, square INTEGER NOT NULL, rat TEXT NOT NULL,
        PRIMARY KEY (walk, square, rat)) STRICT, WITHOUT ROWID""",
    "CREATE INDEX visit_where ON visit (square, rat)",
    """CREATE TABLE heard_channel (
        walk INTEGER NOT NULL, cell INTEGER NOT NULL, channel INTEGER NOT NULL,
        code INTEGER NOT NULL,
        PRIMARY KEY (walk, cell, channel, code)) STRICT, WITHOUT ROWID""",
    "CREATE INDEX heard_channel_where ON heard_channel (cell, channel, code)",
    """CREATE TABLE square_cell (
        square INTEGER NOT NULL, cell INTEGER NOT NULL, n_walks INTEGER NOT NULL,
        n_scans INTEGER NOT NULL, best_dbm REAL NOT NULL, least_best_dbm REAL NOT NULL,
        sum_level INTEGER NOT NULL, sum_squares INTEGER NOT NULL,
        PRIMARY KEY (square, cell)) STRICT, WITHOUT ROWID""",
    "CREATE INDEX square_of_cell ON square_cell (cell, best_dbm)",
    """CREATE TABLE square_rat (
        square INTEGER NOT NULL, rat TEXT NOT NULL, n_walks INTEGER NOT NULL,
        PRIMARY KEY (square, rat)) STRICT, WITHOUT ROWID""",
    """CREATE TABLE cell_channel (
        cell INTEGER NOT NULL, channel INTEGER NOT NULL, code INTEGER NOT NULL,
        PRIMARY KEY (cell, channel, code)) STRICT, WITHOUT ROWID""",
    "CREATE TABLE trust (cell TEXT PRIMARY KEY, note TEXT NOT NULL) STRICT, WITHOUT ROWID",
    f"PRAGMA application_id = {APPLICATION_ID}",
    f"PRAGMA user_version = {VERSION}",
)

ADD = (
    """INSERT INTO square_cell
        SELECT square, cell, 1, n_scans, best_dbm, best_dbm, sum_level, sum_squares
        FROM heard WHERE walk = :walk
        ON CONFLICT DO UPDATE SET
            n_walks = n_walks + 1,
            n_scans = n_scans + excluded.n_scans,
            best_dbm = max(best_dbm, excluded.best_dbm),
            least_best_dbm = min(least_best_dbm, excluded.best_dbm),
            sum_level = sum_level + excluded.sum_level,
            sum_squares = sum_squares + excluded.sum_squares""",
    """INSERT INTO square_rat SELECT square, rat, 1 FROM visit WHERE walk = :walk
        ON CONFLICT DO UPDATE SET n_walks = n_walks + 1""",
    """INSERT OR IGNORE INTO cell_channel
        SELECT cell, channel, code FROM heard_channel WHERE walk = :walk""",
    """UPDATE cell SET n_walks = n_walks + 1, n_scans = n_scans + new.n
        FROM (SELECT cell, sum(n_scans) AS n FROM heard WHERE walk = :walk GROUP BY cell) AS new
        WHERE id = new.cell""",
)
"""Add the rows of a new walk to the sums."""

SEAL = "ALTER TABLE walk ADD COLUMN seal TEXT"
"""The digest that a run was sealed with, empty of one that was cut.

NULL of walks that an earlier version has added, whose `digest` is always that of the content.
"""

REMOVE = (
    """CREATE TEMP TABLE gone_heard AS
        SELECT DISTINCT cell, square FROM heard WHERE walk = :walk""",
    """CREATE TEMP TABLE gone_visit AS
        SELECT DISTINCT square, rat FROM visit WHERE walk = :walk""",
    """CREATE TEMP TABLE gone_channel AS
        SELECT DISTINCT cell, channel, code FROM heard_channel WHERE walk = :walk""",
    "DELETE FROM heard WHERE walk = :walk",
    "DELETE FROM visit WHERE walk = :walk",
    "DELETE FROM heard_channel WHERE walk = :walk",
    "DELETE FROM walk WHERE id = :walk",
    """DELETE FROM square_cell
        WHERE (square, cell) IN (SELECT square, cell FROM gone_heard)""",
    """INSERT INTO square_cell
        SELECT h.square, h.cell, count(*), sum(n_scans), max(best_dbm), min(best_dbm),
            sum(sum_level), sum(sum_squares)
        FROM gone_heard g JOIN heard h ON (h.cell, h.square) = (g.cell, g.square)
        GROUP BY h.square, h.cell""",
    """DELETE FROM square_rat WHERE (square, rat) IN (SELECT square, rat FROM gone_visit)""",
    """INSERT INTO square_rat
        SELECT v.square, v.rat, count(*)
        FROM gone_visit g JOIN visit v ON (v.square, v.rat) = (g.square, g.rat)
        GROUP BY v.square, v.rat""",
    """DELETE FROM cell_channel AS c WHERE
        (cell, channel, code) IN (SELECT cell, channel, code FROM gone_channel)
        AND NOT EXISTS (SELECT 1 FROM heard_channel AS h
            WHERE (h.cell, h.channel, h.code) = (c.cell, c.channel, c.code))""",
    """UPDATE cell SET
        n_walks = (SELECT count(DISTINCT walk) FROM heard WHERE cell = id),
        n_scans = (SELECT coalesce(sum(n_scans), 0) FROM square_cell WHERE cell = id)
        WHERE id IN (SELECT cell FROM gone_heard)""",
    "DELETE FROM cell WHERE n_walks = 0",
    "DROP TABLE gone_heard",
    "DROP TABLE gone_visit",
    "DROP TABLE gone_channel",
)
"""Take the rows of a walk away and compute the sums of what it touched anew."""
