"""Laws of the skill of trained predictors on flights."""

from np_drake.skill.flight_skill import diverged


def test_a_flight_on_which_a_forecast_diverges_is_named():
    """Ours only: nothing keeps a baseline from it."""
    row = {"flight": "one", "model": "lifted", "force_rmse": 1.0, "torque_rmse": 1.0}
    row |= {
        "force_peak": 1.2,
        "torque_peak": float("nan"),
    }  # no torque in the label, so none to compare with
    assert diverged([row, {**row, "flight": "two", "model": "DMDc", "force_peak": 1e9}]) == []
    assert diverged([row, {**row, "flight": "two", "force_peak": 11.0}]) == ["two"]
    assert diverged([{**row, "torque_rmse": float("inf")}]) == ["one"]
