import pytest

from logger.core.errors import ConfigError, GeoError, RunFileError
from postproc.verification.celldb import import_exports
from postproc.verification.claims import (
    RANGE_SIGMA,
    UNKNOWN_SIGMA_M,
    p_text,
    parse_claim,
    read_claims,
)

HEARD = ["262-01-801-86355", "262-01-801-9", "target"]
EXPORT = (
    "GSM,262,1,801,86355,0,13.4,52.5,1000,7,1,1282569574,1300155341,0\n"
    "GSM,262,1,801,9,,13.5,52.6,0,7,1,1282569574,1300155341,\n"
    "GSM,262,1,801,8,0,13.5,52.6,100,7,1,1282569574,1300155341,0\n"
    "GSM,262,1,801,x,0,13.5,52.6,100,7,1,1282569574,1300155341,0\n"
)


def test_claims_on_the_command_line():
    claim = parse_claim("52.5, -13.25,80", "a")
    assert (claim.cell, claim.lat_deg, claim.lon_deg, claim.sigma_m) == ("a", 52.5, -13.25, 80.0)
    assert parse_claim("52.5,13", None).sigma_m == 0.0
    for wrong in ("52.5", "a,b", "1,2,3,4", "nan,3", "1,2,-5", ""):
        with pytest.raises(ConfigError):
            parse_claim(wrong, None)
    with pytest.raises(GeoError):
        parse_claim("95,13", None)


def test_our_own_csv(tmp_path):
    file = tmp_path / "claims.csv"
    file.write_text(
        "Cell,lat,lon,sigma_m,note\ntarget,52.5,13.4,25,x\n"
        "nobody,1,2,3,\n262-01-801-9,52.6,13.5,,\n"
    )
    found, others = read_claims(file, HEARD)
    assert [(c.cell, c.sigma_m) for c in found] == [("target", 25.0), ("262-01-801-9", 0.0)]
    assert others == ["nobody"]
    file.write_bytes(
        b"\xef\xbb\xbfcell; lat;lon;sigma_m\r\n target ;52,5;13,4;25\r\n"
    )  # of a spreadsheet
    ((claim,), others) = read_claims(file, HEARD)
    assert (claim.cell, claim.lat_deg, claim.lon_deg, claim.sigma_m) == ("target", 52.5, 13.4, 25.0)
    assert others == []
    for row, says in (
        ("target,x,13", "line 2"),
        ("target,99,13", "line 2"),
        ("target,52,13,-1", "line 2"),
    ):
        file.write_text(f"cell,lat,lon,sigma_m\n{row}\n")
        with pytest.raises(RunFileError, match=says):
            read_claims(file, HEARD)


def test_an_export_and_a_database_of_it_claim_the_same(tmp_path):
    file = tmp_path / "262.csv"
    file.write_text(EXPORT)
    import_exports([file], tmp_path / "c.db")
    of_export, of_database = read_claims(file, HEARD), read_claims(tmp_path / "c.db", HEARD)
    for found, others in (of_export, of_database):
        assert others == []
        places = [(c.cell, c.lat_deg, c.lon_deg, c.sigma_m) for c in found]
        assert places == [
            ("262-01-801-86355", 52.5, 13.4, 1000 * RANGE_SIGMA),
            ("262-01-801-9", 52.6, 13.5, UNKNOWN_SIGMA_M),
        ]


def test_an_export_with_an_absurd_range_is_a_vague_claim(tmp_path):
    file = tmp_path / "262.csv"
    file.write_text(EXPORT.replace(",1000,", ",50000000,", 1))
    import_exports([file], tmp_path / "c.db")
    for path in (file, tmp_path / "c.db"):
        found, _ = read_claims(path, HEARD)
        assert [one.sigma_m for one in found] == [1e6, UNKNOWN_SIGMA_M]


def test_files_that_hold_no_claim(tmp_path):
    file = tmp_path / "x"
    with pytest.raises(RunFileError, match="No such file"):
        read_claims(file, HEARD)
    file.write_text("some,thing,else\n")
    with pytest.raises(RunFileError, match="no cell export"):
        read_claims(file, HEARD)


@pytest.mark.parametrize(
    ("p", "text"), [(0.04, "0.04"), (1e-40, "below 0.0005"), (0.0, "below 0.0005"), (1.0, "1")]
)
def test_a_p_value_is_no_smaller_than_is_known(p, text):
    assert p_text(p) == text
