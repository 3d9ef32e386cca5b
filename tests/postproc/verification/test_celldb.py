import gzip

import numpy as np
import pytest
from pyproj import Geod

from logger.core.cell_names import identity_of
from logger.core.errors import ConfigError, GeoError, RunFileError
from postproc.verification.celldb import COLUMNS, CellDb, import_exports

HEADER = ",".join(COLUMNS) + "\n"
ROW = "GSM,262,1,4711,100,0,13.4,52.5,1000,7,1,1282569574,1300155341,0\n"


def load(target, *files):
    ticks = []

    def progress(steps, _what, total, _names):
        ticks.extend(steps)
        assert len(ticks) == total == 100 * len(files)
        return ticks

    return import_exports(files, target, progress)


@pytest.fixture
def make(tmp_path):
    def write(text, name="a.csv"):
        (tmp_path / name).write_bytes(text.encode() if isinstance(text, str) else text)
        return tmp_path / name

    return write


def test_real_samples_of_all_three_layouts(corpus, tmp_path):
    names = (
        "opencellid_cell_towers_sample",
        "opencellid_cells_country_noheader_sample",
        "mls_cell_export_sample",
    )
    files = [corpus / "formats" / f"{name}.csv" for name in names]
    rows = sum(len(file.read_text().split()) - ("radio" in file.read_text()) for file in files)
    done = load(tmp_path / "c.db", *files)
    assert (done.n_rows, done.n_bad, done.n_cells) == (rows, 0, rows)
    db = CellDb(tmp_path / "c.db")
    (cell,) = db.by_identity("262-02-801-86355")
    assert (cell.radio, cell.lat, cell.lon, cell.range_m) == ("UMTS", 52.522202, 13.285512, 1000)
    (cell,) = db.by_identity("208-20-80-17939")
    assert (cell.lat, cell.lon) == (49.292793, -1.229193)
    cell = next(cell for cell in db.by_identity("202-01-2120-12842") if cell.radio == "UMTS")
    assert (cell.range_m, cell.samples) == (0, 6)
    db.close()


def test_columns_count_by_name_gzip_crlf_and_bom(make, tmp_path):
    text = (
        "\ufefflat,lon,cell,radio,area,net,mcc,more\r\n52.5,13.4,7,LTE,9,1,262,x\r\n\r\n"
        "52.6,13.5,8,LTE,9,1,262,y\r\n"
    )
    done = load(tmp_path / "c.db", make(gzip.compress(text.encode()), "a.anything"))
    assert (done.n_rows, done.n_bad, done.n_cells) == (2, 0, 2)
    db = CellDb(tmp_path / "c.db")
    (cell,) = db.by_identity("262-1-9-8")
    assert (cell.lat, cell.lon, cell.range_m, cell.updated_s) == (52.6, 13.5, None, None)
    db.close()


def test_newest_row_of_an_identity_stays_and_again_changes_nothing(make, tmp_path):
    new = ROW.replace("52.5", "52.6").replace("1300155341", "1700000000")
    old = ROW.replace("52.5", "52.4").replace("1300155341", "")
    done = load(tmp_path / "c.db", make(HEADER + ROW + new + old + ROW.replace("GSM", "LTE")))
    assert (done.n_rows, done.n_replaced, done.n_cells) == (4, 2, 2)
    again = load(tmp_path / "c.db", tmp_path / "a.csv")
    assert (again.n_replaced, again.n_cells) == (4, 2)
    db = CellDb(tmp_path / "c.db")
    assert {cell.radio: cell.lat for cell in db.by_identity("262-1-4711-100")} == {
        "GSM": 52.6,
        "LTE": 52.5,
    }
    db.close()


def test_bad_rows_are_counted_and_named(make, tmp_path):
    bad = [
        "GSM,262,1,x,100",
        "XXX,262,1,5,100",
        "GSM,262,1,5,100,0,nan,52",
        "GSM,262,1,5,100,0,13,95",
        "GSM,0,1,5,1",
    ]
    whole = [
        ",".join((row.split(",") + ROW.strip().split(",")[len(row.split(",")) :])[:14])
        for row in bad
    ]
    done = load(tmp_path / "c.db", make(HEADER + ROW + "\n".join(whole) + "\nGSM,262\n"))
    assert (done.n_rows, done.n_bad, done.n_cells) == (7, 6, 1)
    assert [row.row for row in done.bad_rows] == [2, 3, 4, 5, 6]


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "is empty"),
        (b"a,b,c\n1,2,3\n", "no cell export"),
        (b"cell;lat;lon\nx;1,5;2,5\n", "by commas; claims of your own have cell,lat,lon"),
        (b"radio,mcc,net\nGSM,1,2\n", "no column area"),
        ((HEADER + "GSM,262,1,x,1,0,1,1,1,1,1,1,1,1\n").encode(), "no usable row"),
        (gzip.compress((HEADER + ROW * 500).encode(), mtime=0)[:-30], "damaged or cut"),
        (gzip.compress(HEADER.encode(), mtime=0)[:12] + b"\xff" * 40, "damaged or cut"),
    ],
)
def test_files_that_are_no_export_leave_the_database_as_it_was(make, tmp_path, data, says):
    load(tmp_path / "c.db", make(HEADER + ROW, "good.csv"))
    before = (tmp_path / "c.db").read_bytes()
    with pytest.raises(RunFileError, match=says):
        load(tmp_path / "c.db", make(data))
    assert (tmp_path / "c.db").read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.csv", "c.db", "good.csv"]


def test_what_is_no_database_is_neither_read_nor_replaced(make, tmp_path):
    precious = make("my thesis", "c.db")
    for broken in (lambda: load(precious, make(HEADER + ROW)), lambda: CellDb(precious)):
        with pytest.raises(RunFileError, match="no cell database"):
            broken()
    with pytest.raises(RunFileError, match="`postproc celldb import` makes one"):
        CellDb(precious)
    with pytest.raises(RunFileError, match="no such file"):
        CellDb(tmp_path / "none.db")
    assert precious.read_text() == "my thesis"


def test_a_damaged_database_is_one_clear_error(make, tmp_path):
    """Bytes changed anywhere: no text that is none, no position that is none, no other kind."""
    rows = "".join(f"GSM,262,1,4711,{i},0,13.{i},52.5,9,7,1,1,1,0\n" for i in range(100, 400))
    load(tmp_path / "c.db", make(HEADER + rows))
    whole, random, n_errors = (tmp_path / "c.db").read_bytes(), np.random.default_rng(5), 0
    for _ in range(150):
        content = bytearray(whole)
        for place in random.integers(100, len(content), 60):
            content[place] = random.integers(256)
        (tmp_path / "damaged.db").write_bytes(content)
        try:
            db = CellDb(tmp_path / "damaged.db")
            assert len(db) >= 0
            db.by_identity("262-1-4711-150")
            db.near(52.5, 13.2, 5000.0)
            db.close()
        except RunFileError as error:
            assert "\n" not in str(error)  # noqa: PT017
            n_errors += 1
    assert n_errors > 30


def test_near_is_what_a_search_through_all_finds(make, tmp_path):
    rng = np.random.default_rng(1)
    lat = np.concatenate(
        [rng.uniform(52.4, 52.6, 300), rng.uniform(-17.1, -16.9, 300), rng.uniform(89.0, 90.0, 100)]
    )
    lon = np.concatenate(
        [rng.uniform(13.2, 13.6, 300), rng.uniform(179.9, 180.1, 300), rng.uniform(-180, 180, 100)]
    )
    lon = (lon + 180.0) % 360.0 - 180.0
    rows = [
        f"LTE,262,1,{i},{i},0,{x:.6f},{y:.6f},,,,,,"
        for i, (x, y) in enumerate(zip(lon, lat, strict=True))
    ]
    load(tmp_path / "c.db", make("\n".join(rows) + "\n"))
    db, geod = CellDb(tmp_path / "c.db"), Geod(ellps="WGS84")
    for at_lat, at_lon, radius in (
        (52.5, 13.4, 4000.0),
        (-17.0, 179.999, 6000.0),
        (-17.0, -179.999, 6000.0),
    ):
        away = geod.inv(
            np.full(len(lat), at_lon), np.full(len(lat), at_lat), lon.round(6), lat.round(6)
        )[2]
        found = db.near(at_lat, at_lon, radius, 1000)
        assert {cell.cell for cell in found} == set(np.flatnonzero(away <= radius).tolist())
        assert [cell.distance_m for cell in found] == sorted(cell.distance_m for cell in found)
        assert len(found) > 20
    assert len(db.near(52.5, 13.4, 4000.0, 3)) == 3
    for wrong in ((52.5, 13.4, 0.0), (52.5, 13.4, 1e7)):
        with pytest.raises(ConfigError):
            db.near(*wrong)
    with pytest.raises(GeoError):
        db.near(99.0, 0.0, 10.0)
    db.close()


def test_short_identity_of_a_3g_modem(make, tmp_path):
    load(
        tmp_path / "c.db",
        make(HEADER + ROW.replace("GSM,262,1,4711,100", f"UMTS,262,1,4711,{(5 << 16) + 77}")),
    )
    db = CellDb(tmp_path / "c.db")
    (cell,) = db.by_identity("262-01-4711-77")
    assert cell.short_cid
    assert cell.cell == (5 << 16) + 77
    assert db.by_identity("262-01-4711-78") == []
    with pytest.raises(ConfigError):
        db.by_identity("target")
    assert identity_of("262-01-a-4") is identity_of("1-2-3") is None
    db.close()


def test_lookups_do_not_search_the_whole_file(make, tmp_path):
    rng = np.random.default_rng(2)
    lat, lon = rng.uniform(36, 60, 60_000), rng.uniform(-5, 25, 60_000)
    make(
        "".join(
            f"LTE,262,1,{i % 999},{i},0,{x:.5f},{y:.5f},,,,,,\n"
            for i, (x, y) in enumerate(zip(lon, lat, strict=True))
        )
    )
    load(tmp_path / "c.db", tmp_path / "a.csv")
    db = CellDb(tmp_path / "c.db")
    plans = []
    db._db.set_trace_callback(plans.append)
    for i in range(0, 600, 6):
        assert db.near(lat[i], lon[i], 1000.0)
        assert db.by_identity(f"262-1-{i % 999}-{i}")
    db._db.set_trace_callback(None)
    for statement in set(plans):
        plan = str(db._db.execute(f"EXPLAIN QUERY PLAN {statement}").fetchall())
        assert "INDEX" in plan, statement
        assert "SCAN cell" not in plan, statement
    db.close()
