"""Laws of the options: what real and ideal sensors share, and that a diagnosis obeys those it is
given.
"""

import pytest

from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.options import Options, Tolerance
from np_drake.vehicle import Vehicle

REAL = Options.for_sensors(True)


def test_tolerance_and_options_together_are_refused():
    with pytest.raises(ValueError, match="either tolerance or options"):
        diagnose(Vehicle(), [], [], tolerance=Tolerance(), options=REAL)


def test_a_material_force_is_in_proportion_to_a_material_position_error():
    dut = REAL.with_material(0.1).materiality
    assert (dut.position, dut.remaining_force) == (
        0.1,
        pytest.approx(2 * REAL.materiality.remaining_force),
    )
    with pytest.raises(ValueError, match="material position error must be positive"):
        REAL.with_material(0.0)
