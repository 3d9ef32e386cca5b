import numpy as np
import pytest

from logger.core import ekf
from postproc.reproductions import specification
from postproc.reproductions.specification import QUICK


def verdicts(group):
    return {check.claim: check.verdict for check in group(QUICK)}


def test_what_is_right_and_what_is_wrong():
    result = verdicts(specification._model_checks) | verdicts(specification._update_checks)
    wrong = {claim for claim, verdict in result.items() if verdict == "claim is wrong"}
    assert wrong == {
        "K of eta is above 0",
        next(claim for claim in result if "or equivalently" in claim),
    }
    assert {claim for claim, verdict in result.items() if verdict == "does not hold"} == {
        "K of the position is far above 0 at first (P = 1000 I)"
    }
    assert "fails" not in result.values()


def test_the_expected_level_and_its_slopes():
    expected_dbm = -40.0 - 15.0 * np.log10(20_000.0)
    assert expected_dbm == pytest.approx(specification._EXPECTED_DBM)
    assert specification.differences(specification._STATION) == pytest.approx(
        [0.065144, 0.065144, 1.0, -21.50515], abs=1e-5
    )


def test_the_gain_is_that_of_the_dense_formula():
    h = np.array(specification.differences(specification._STATION))
    p = (1000.0 + 1e-5) * np.eye(4)
    k = p @ h / (h @ p @ h + 9.0)
    step = ekf.step(specification._STATION, *specification._USER, -100.0)
    assert np.subtract(
        step.state[:4], specification._STATION[:4]
    ) / step.innovation_db == pytest.approx(k, rel=1e-6)
    text = " ".join(check.measured for check in specification._update_checks(QUICK))
    assert f"{k[0]:+.2e}" in text
    assert f"{k[3]:+.4f}" in text


def test_a_lost_sign_in_our_filter_fails_the_check(monkeypatch):
    def path_loss_of(state, x_m, y_m):
        hx, hy, one, he = right(state, x_m, y_m)
        return -hx, -hy, one, he

    right = ekf.jacobian
    monkeypatch.setattr(ekf, "jacobian", path_loss_of)
    assert (
        sum(verdict == "fails" for verdict in verdicts(specification._model_checks).values()) >= 3
    )


def test_a_covariance_that_grows_fails_the_check(monkeypatch):
    def grown(*args, **kwargs):
        step = right(*args, **kwargs)
        return step._replace(
            state=step.state._replace(p=tuple(1.1 * value for value in step.state.p))
        )

    right = ekf.step
    monkeypatch.setattr(ekf, "step", grown)
    assert verdicts(specification._update_checks)["P decreases with an update"] == "fails"
