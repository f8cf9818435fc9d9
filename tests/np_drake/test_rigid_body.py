"""Laws of rotations and of the rigid body."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from np_drake import attitude, rigid_body
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
FINITE = st.floats(-10, 10)
QUATERNION = arrays(float, 4, elements=st.floats(-1, 1)).filter(lambda q: np.linalg.norm(q) > 0.1)


def vectors(n):
    return arrays(float, n, elements=FINITE)


@given(QUATERNION, vectors(3), vectors(3), vectors(4), vectors(6))
def test_inverse_dynamics_recover_the_wrench_of_forward_dynamics(q, v, w, u, chi):
    q = q / np.linalg.norm(q)
    x = np.concatenate([np.zeros(3), q, v, w])
    rate = rigid_body.state_derivative(VEHICLE, x, u, chi)
    found = rigid_body.residual_wrench(VEHICLE, q=q, w=w, a=rate[7:10], al=rate[10:13], u=u)
    np.testing.assert_allclose(found, chi, atol=1e-10)


@given(QUATERNION, vectors(3))
def test_rotations_agree_with_scipy(q, r):
    q = q / np.linalg.norm(q)
    R = Rotation.from_quat(q, scalar_first=True)
    np.testing.assert_allclose(attitude.rotate(q, r), R.apply(r), atol=1e-12)
    np.testing.assert_allclose(attitude.rotate_back(q, r), R.inv().apply(r), atol=1e-12)
    np.testing.assert_allclose(attitude.body_z(q), R.as_matrix()[:, 2], atol=1e-12)


@given(QUATERNION, QUATERNION)
def test_quaternion_product_composes_rotations(p, q):
    p, q = p / np.linalg.norm(p), q / np.linalg.norm(q)
    both = attitude.rotation_matrix(attitude.multiply(p, q))
    np.testing.assert_allclose(
        both, attitude.rotation_matrix(p) @ attitude.rotation_matrix(q), atol=1e-12
    )


def test_vectorised_and_single_calls_agree():
    rng = np.random.default_rng(0)
    x = rng.normal(size=(7, 13))
    u, chi = rng.normal(size=(7, 4)), rng.normal(size=(7, 6))
    rows = [rigid_body.state_derivative(VEHICLE, x[i], u[i], chi[i]) for i in range(7)]
    np.testing.assert_allclose(rigid_body.state_derivative(VEHICLE, x, u, chi), rows, atol=1e-13)
    np.testing.assert_allclose(
        attitude.rotation_matrix(x[:, 3:7])[3], attitude.rotation_matrix(x[3, 3:7]), atol=1e-13
    )


VECTORS = arrays(float, 3, elements=st.floats(-10, 10))


@given(VECTORS, VECTORS)
def test_the_skew_matrix_of_a_vector_times_another_is_their_cross_product(r, s):
    np.testing.assert_allclose(attitude.skew(r) @ s, np.cross(r, s), atol=1e-12)
    np.testing.assert_array_equal(attitude.skew(r).T, -attitude.skew(r))
    np.testing.assert_array_equal(
        attitude.skew(np.stack([r, s])), [attitude.skew(r), attitude.skew(s)]
    )
