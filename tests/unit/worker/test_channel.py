"""Messages between two processes, here between two ends of a pipe in one."""

from multiprocessing import Pipe

import numpy as np
import pytest
from shapes import icosphere, instance_of

from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.worker.channel import CHUNK_BYTES, Channel
from rosy_addon.worker.start import PACKAGE


@pytest.fixture
def ends():
    first, second = (Channel(connection, PACKAGE) for connection in Pipe())
    yield first, second
    first.connection.close()
    second.connection.close()


def passed(ends, message):
    ends[0].send(message)
    return ends[1].receive()


@pytest.mark.parametrize(
    "array",
    [
        np.arange(12.0).reshape(3, 4),
        np.asfortranarray(np.arange(12.0).reshape(3, 4)),
        np.arange(24)[::2],
        np.zeros((0, 3)),
        np.zeros(CHUNK_BYTES // 8, dtype=np.float64)[:4000],
    ],
    ids=["plain", "fortran", "strided", "empty", "view"],
)
def test_arrays_arrive_and_can_be_written(ends, array):
    (actual,) = passed(ends, (array,))
    assert actual.dtype == array.dtype and np.array_equal(actual, array)
    actual[...] = 1


def test_meshes_are_sent_once(ends):
    ball = icosphere(2)
    instance = instance_of(ball, 4, "axis")
    first = passed(ends, ("draw", instance))[1]
    assert np.array_equal(first.surface.vertices, ball.vertices)
    assert passed(ends, ("draw again", instance, ball)) == ("draw again", first, first.surface)
    moved = MeshInstance(ball, 2 * np.eye(4), instance.field)
    second = passed(ends, (moved,))[0]
    assert second.surface is first.surface and second.field is first.field and second is not first


def test_what_is_not_used_is_forgotten(ends):
    ball = icosphere(1)
    first = passed(ends, ball)
    assert passed(ends, "nothing") == "nothing" and not ends[1]._kept
    assert passed(ends, ball) is not first


def test_cached_properties_stay_behind(ends):
    ball = icosphere(1)
    _ = ball.face_normal
    assert "face_normal" not in vars(passed(ends, ball))


def test_what_cannot_be_pickled_leaves_the_channel_usable(ends):
    ball = icosphere(1)
    with pytest.raises(Exception, match="pickle"):
        ends[0].send((ball, lambda: 0))
    assert np.array_equal(passed(ends, ball).vertices, ball.vertices)


def test_the_end_is_noticed(ends):
    ends[0].connection.close()
    assert ends[1].connection.poll()
    with pytest.raises(EOFError):
        ends[1].receive()
