"""Sums of the weights of samples along streamlines, against explicit sums."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from planar_fields import kernel_window

from rosy_addon.compositor.filter_kernel import full_sample_count, kernel_weights


@st.composite
def streamlines(draw):
    full_length = draw(st.integers(0, 400))
    return draw(st.integers(0, full_length)), draw(st.integers(0, full_length)), full_length


@pytest.mark.parametrize("kernel", ["box", "taper", "ramp"])
@given(streamlines())
def test_sums_of_weights_in_closed_form(kernel, streamline):
    forward, backward, full_length = streamline
    weight = kernel_window(full_length, kernel)[full_length - backward :][: backward + 1 + forward]
    actual = kernel_weights(np.float64(forward), np.float64(backward), full_length, kernel)
    np.testing.assert_allclose(actual.total, weight.sum(), rtol=1e-9)
    expected = weight.sum() ** 2 / (weight**2).sum()
    np.testing.assert_allclose(actual.effective_samples, expected, rtol=1e-9)


def test_other_kernels_have_three_quarters_of_the_samples():
    for length in (40, 400):
        kernels = "box", "taper", "ramp"
        plain, tapered, oriented = (full_sample_count(length, kernel) for kernel in kernels)
        assert plain == 2 * length + 1
        assert abs(tapered / plain - 0.75) < 0.01 and abs(oriented / plain - 0.75) < 0.01
