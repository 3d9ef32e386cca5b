from postproc.json_text import as_json
from postproc.results import summary
from postproc.smooth import smooth_run
from tests.kit.smoothed import write_run


def test_processes_give_what_one_gives(tmp_path):
    run = write_run(tmp_path / "a.journal", seconds=60, cells=4)
    alone, shared = (summary(smooth_run(run, processes=n)) for n in (1, 2))
    assert as_json(shared) == as_json(alone)
    assert len(shared["cells"]) == 4
