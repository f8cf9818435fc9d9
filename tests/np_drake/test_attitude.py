import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from np_drake import attitude

VECTORS = arrays(float, 3, elements=st.floats(-10, 10))


@given(VECTORS, VECTORS)
def test_the_skew_matrix_of_a_vector_times_another_is_their_cross_product(r, s):
    np.testing.assert_allclose(attitude.skew(r) @ s, np.cross(r, s), atol=1e-12)
    np.testing.assert_array_equal(attitude.skew(r).T, -attitude.skew(r))
    np.testing.assert_array_equal(
        attitude.skew(np.stack([r, s])), [attitude.skew(r), attitude.skew(s)]
    )
