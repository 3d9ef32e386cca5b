import msgspec
import pytest

from logger.device.clock import Clock
from logger.device.status import PortStatus, Status
from logger.doctor.single_tests import status_lines, unit_line

S = 10**9


def test_the_status_of_a_service_is_evaluated():
    now_ns = Clock().now_ns()
    port = PortStatus("/dev/x", event="no such port; is the device plugged in?")
    well = Status("recording", "", "run-1", 1, now_ns, 0, now_ns, 3, 2, 1, 0, 10, None, {})

    def states(**changes):
        return {
            line.what: line.state for line in status_lines(msgspec.structs.replace(well, **changes))
        }

    assert set(states().values()) == {"ok"}
    assert states(state="no fix")["status"] == "warn"
    assert states(state="error", ports={"modem": port}) == states() | {
        "status": "fail",
        "modem": "fail",
    }
    assert states(synced_ns=now_ns - 60 * S)["card"] == "fail"
    assert states(synced_ns=None, since_ns=now_ns - S)["card"] == "ok"
    assert states(waiting=6)["queue"] == "warn"
    assert states(left_out=("x is no file",))["estimate"] == "warn"
    assert states(no_estimate="no live estimate")["estimate"] == "warn"
    assert states(now_ns=now_ns - 60 * S) == {"status": "fail"}


@pytest.mark.parametrize(
    ("active", "enabled", "state", "advice"),
    [
        ("active", "enabled", "ok", "is active"),
        ("inactive", "enabled", "warn", "enable --now"),
        ("active", "disabled", "warn", "enable --now"),
        ("failed", "enabled", "fail", "journalctl -u fieldlogger"),
        ("activating", "enabled", "fail", "journalctl -u fieldlogger"),
        ("inactive", "unknown", "ok", "start `fieldlogger run`"),
        ("inactive", "not-found", "ok", "start `fieldlogger run`"),
    ],
)
def test_what_systemd_says_of_the_unit_leads_to_the_right_advice(active, enabled, state, advice):
    # `enable --now` does not repair what fails, and finds no unit where pipx installed
    line = unit_line(active, enabled)
    assert line.state == state
    assert advice in line.text
