import json

import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import read_run
from postproc.cli import main
from postproc.interop.importing import import_walk, recognise

HEADER = {"analyzers": [{"name": "x", "version": 1}], "rayhunter": {}, "report_version": 2}
V2 = {
    "packet_timestamp": "2024-05-01T10:00:05+00:00",
    "skipped_message_reason": None,
    "events": [
        None,
        {"event_type": "Informational", "message": "nothing"},
        {"event_type": "High", "message": "null cipher"},
    ],
}
V1 = {
    "timestamp": "2024-05-01T10:00:07Z",
    "skipped_message_reasons": [],
    "analysis": [
        {
            "timestamp": "2024-05-01T10:00:06Z",
            "events": [
                {
                    "event_type": {"type": "QualitativeWarning", "severity": "Medium"},
                    "message": "2G downgrade",
                }
            ],
        }
    ],
}
GPX = (
    '<gpx xmlns="http://www.topografix.com/GPX/1/1" version="1.1" creator="x"><trk><trkseg>'
    '<trkpt lat="52.5" lon="13.5"><time>2024-05-01T10:00:00Z</time></trkpt>'
    '<trkpt lat="52.5001" lon="13.5"><time>2024-05-01T10:00:10Z</time></trkpt>'
    "</trkseg></trk></gpx>"
)


@pytest.fixture
def source(tmp_path):
    lines = [HEADER, V2, V2 | {"events": []}, V1]
    (tmp_path / "a.ndjson").write_text("".join(json.dumps(line) + "\n" for line in lines))
    return tmp_path / "a.ndjson"


def test_warnings_of_both_versions(source):
    form = recognise(source)
    header, warning, quiet, old = form.read(source)
    assert form.name == "Rayhunter analysis, NDJSON"
    assert (header.why, quiet.why) == ("the header of the report", "a message without a warning")
    assert (warning.utc_ns, warning.text) == (
        1_714_557_605 * 10**9,
        "Rayhunter, high: null cipher",
    )
    assert old.text == "Rayhunter, medium: 2G downgrade"


def test_with_a_track_they_become_notes_at_their_places(source, tmp_path, capsys):
    (tmp_path / "walk.gpx").write_text(GPX)
    run = tmp_path / "run.h5"
    assert main(["import", str(source), "--track", str(tmp_path / "walk.gpx"), "-o", str(run)]) == 0
    assert "0 readings, 2 remarks, 0 bad rows" in capsys.readouterr().out
    notes = [record for _, record in read_run(run).records("notes")]
    remarks = [note for note in notes if note.value.code == "remark"]
    assert [note.t_ns for note in remarks] == [5 * 10**9, 6 * 10**9]
    assert remarks[0].value.text == (
        "2024-05-01T10:00:05Z at 52.500050, 13.500000: Rayhunter, high: null cipher"
    )
    assert len(list(read_run(run).records("fixes"))) == 2


def test_without_a_track_nothing_can_be_located(source, tmp_path):
    with pytest.raises(RunFileError, match="2 remarks have no place: .* with --track"):
        import_walk(source, tmp_path / "run.h5")
