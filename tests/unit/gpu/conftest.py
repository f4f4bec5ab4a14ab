"""What the tests of the graphics card share."""

import pytest


@pytest.fixture(scope="module")
def device():
    """A plain OpenGL context."""
    pytest.importorskip("moderngl", reason="no moderngl")
    from harness.egl_device import EglDevice

    try:
        return EglDevice()
    except Exception as error:
        pytest.skip(f"no OpenGL context through EGL: {error}")
