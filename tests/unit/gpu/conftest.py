"""What the tests of the graphics card share."""

import pytest


@pytest.fixture(scope="session")
def device():
    """A plain OpenGL context."""
    pytest.importorskip("moderngl", reason="no moderngl")
    from harness.egl_device import EglDevice

    try:
        return EglDevice()
    except Exception as error:
        pytest.skip(f"no OpenGL context through EGL: {error}")


@pytest.fixture(scope="session")
def card(device):
    """The renderer on this context."""
    from rosy_addon.gpu.renderer import GpuRenderer

    return GpuRenderer(device)
