"""The polynomials of `deterministic_trig`, against numpy's functions in double precision."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rosy_addon.core.deterministic_trig import cos_sin, unit_phasor, vector_angle

ANGLES = st.floats(-1e4, 1e4)


FULL_TURN = np.linspace(-np.pi, np.pi, 200_001)


def test_vector_angle():
    parts = np.cos(FULL_TURN), np.sin(FULL_TURN)
    x, y = (np.float32(7) * part.astype(np.float32) for part in parts)
    np.testing.assert_allclose(vector_angle(x, y), np.arctan2(y.astype(float), x), atol=5e-7)
    assert vector_angle(np.zeros(1, np.float32), np.zeros(1, np.float32)) == 0


def test_cosine_and_sine():
    angle = (FULL_TURN / 2).astype(np.float32)
    cosine, sine = cos_sin(angle)
    np.testing.assert_allclose(cosine, np.cos(angle.astype(float)), atol=3e-7)
    np.testing.assert_allclose(sine, np.sin(angle.astype(float)), atol=3e-7)


@given(ANGLES)
def test_unit_phasor(angle):
    phase = unit_phasor(np.array([angle]))
    assert phase.dtype == np.complex64
    np.testing.assert_allclose(phase, np.exp(1j * angle), atol=4e-7)
