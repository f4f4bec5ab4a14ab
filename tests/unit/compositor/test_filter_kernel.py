"""Sums of the weights of samples along streamlines, against explicit sums."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rosy_addon.compositor.filter_kernel import full_sample_count, kernel_weights
from rosy_addon.compositor.look import Look


@st.composite
def streamlines(draw):
    full_length = draw(st.integers(0, 400))
    return draw(st.integers(0, full_length)), draw(st.integers(0, full_length)), full_length


@given(streamlines())
def test_sums_of_tapered_weights_in_closed_form(streamline):
    forward, backward, full_length = streamline
    distance = np.abs(np.arange(-backward, forward + 1))
    weight = 1 - distance / (full_length + 1)
    actual = kernel_weights(np.float64(forward), np.float64(backward), full_length, tapered=True)
    np.testing.assert_allclose(actual.total, weight.sum(), rtol=1e-9)
    np.testing.assert_allclose(
        actual.effective_samples, weight.sum() ** 2 / (weight**2).sum(), rtol=1e-9
    )


@given(streamlines())
def test_without_taper_every_sample_counts_as_one(streamline):
    forward, backward, full_length = streamline
    actual = kernel_weights(forward, backward, full_length, tapered=False)
    assert actual.total == actual.effective_samples == forward + backward + 1


def test_tapered_streamlines_have_three_quarters_of_the_samples():
    for length in (40, 400):
        plain, tapered = (
            full_sample_count(Look(length=length, taper=taper)) for taper in (False, True)
        )
        assert plain == 2 * length + 1
        assert abs(tapered / plain - 0.75) < 0.01
