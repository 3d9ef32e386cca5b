"""What stands beside a run is taken for its estimates only where it is as we write it."""

import json

import h5py
import numpy as np
import pytest

from logger.core.geo import Utm
from postproc.interop.estimates import stored_estimates

UTM = Utm.at(52.0, 13.0)
PLACE = {
    "lat": 52.0,
    "lon": 13.0,
    "probability": 1.0,
    "ellipse95": {"semi_major_m": 9.0, "semi_minor_m": 4.0, "azimuth_deg": 0.0},
}


def _summary(**changes):
    none = {"lat": None, "lon": None, "converged": False}
    cell = {
        "cell": "a",
        "verdict": "located",
        "n": 3,
        "modes": [PLACE],
        "best": PLACE,
        "warnings": [],
    }
    cell |= {
        "ekf": none,
        "rts": none,
        "batch": none,
        "region95": {"geojson": None},
        "region50": {"geojson": None},
    }
    return {"cells": [cell | changes]}


def _stored(path, summary):
    with h5py.File(path, "w") as file:
        file.attrs["run_id"] = "me"
        file["summary"] = np.bytes_(json.dumps(summary).encode())
    return path


def test_what_we_write_is_read(tmp_path):
    (found,) = stored_estimates(_stored(tmp_path / "a.h5", _summary()), "me", ["a"], UTM)
    assert (found.cell, len(found.positions)) == ("a", 1)
    assert stored_estimates(tmp_path / "a.h5", "another", ["a"], UTM) is None
    assert stored_estimates(tmp_path / "a.h5", "me", ["a", "b"], UTM) is None
    assert stored_estimates(tmp_path / "none.h5", "me", ["a"], UTM) is None


@pytest.mark.parametrize(
    "summary",
    [
        [],
        {},
        {"cells": 7},
        {"cells": [7]},
        _summary(verdict="ambiguous", modes=7),
        _summary(verdict="ambiguous", modes=[{}]),
        _summary(best=None),
        _summary(best=PLACE | {"lat": "x"}),
        _summary(best=PLACE | {"lat": 1e300}),
        _summary(region95={"geojson": {"coordinates": [[[[0, 0]]]]}}),
        _summary(region95=None),
    ],
)
def test_what_is_of_another_form_is_none(tmp_path, summary):
    assert stored_estimates(_stored(tmp_path / "a.h5", summary), "me", ["a"], UTM) is None


@pytest.mark.parametrize("link", ["external", "soft", "group", "numbers", "no file"])
def test_what_is_no_text_of_this_file_is_none(tmp_path, link):
    other = _stored(tmp_path / "other.h5", _summary())
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.attrs["run_id"] = "me"
        match link:
            case "external":
                file["summary"] = h5py.ExternalLink(str(other), "/summary")
            case "soft":
                file["summary"] = h5py.SoftLink("/elsewhere")
            case "group":
                file.create_group("summary")
            case "numbers":
                file["summary"] = np.zeros(5)
    if link == "no file":
        path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(99))
    assert stored_estimates(path, "me", ["a"], UTM) is None
