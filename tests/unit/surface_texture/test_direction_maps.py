"""Anisotropy maps and flow maps decode to the direction of the field."""

import numpy as np
import pytest
from shapes import globe, instance_of, plane, rebuilt, torus
from uv_maps import patches_uv, torus_uv

from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.surface_texture.draw import draw_texture
from rosy_addon.surface_texture.line_order import corner_tangents

#: Largest mean error of a direction in radians, and the largest one of 95 %. With 8 bits a direction is right
#: to 0.3 degrees; tangents that are averaged over the faces around a corner differ from those of the face.
MEAN_ERROR, LARGE_ERROR = np.radians(0.5), np.radians(1.0)


def decoded(image, surface, uv):
    """(F, 3) directions at the centers of quads, and (F,) strengths, as a renderer decodes a map."""
    stored = np.rint(255 * image[..., :3]) / 255
    corner_uv = uv.reshape(-1, 4, 2)
    place = (corner_uv.mean(axis=1) * len(image)).astype(int)
    texel = stored[place[:, 1], place[:, 0]]
    points = surface.vertices[surface.corner_vertex].reshape(-1, 4, 3)
    # Least squares: points are linear in u and v.
    offset_uv = corner_uv - corner_uv.mean(axis=1, keepdims=True)
    offset = points - points.mean(axis=1, keepdims=True)
    along = np.linalg.pinv(offset_uv) @ offset
    along_u, along_v = along[:, 0], along[:, 1]
    normal = surface.face_normal
    tangent = along_u - (along_u * normal).sum(axis=1, keepdims=True) * normal
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = np.cross(normal, tangent)
    bitangent *= np.sign((bitangent * along_v).sum(axis=1, keepdims=True))
    x, y = 2 * texel[:, :2].T - 1
    return x[:, None] * tangent + y[:, None] * bitangent, texel[:, 2]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("uv", "degree"), [(torus_uv(), 2), (patches_uv(2), 4)], ids=["single", "patches"]
)
def test_maps_decode_to_the_field(uv, degree):
    """Also in charts that are turned and mirrored; the direction is one of the field."""
    surface = torus()
    vectors = generate(surface, "curvature", degree).vectors.copy()
    vectors[:48] = 0
    instance = MeshInstance(surface, np.eye(4), RosyField(degree, vectors))
    texture = draw_texture(instance, uv, Look(display="flat"), 512, content="anisotropy")
    assert texture.is_data
    direction, strength = decoded(texture.rgba, surface, uv)
    np.testing.assert_array_equal(strength[:48], 0)
    np.testing.assert_array_equal(strength[48:], 1)
    direction, vectors, normal = direction[48:], vectors[48:], surface.face_normal[48:]
    x = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    y = np.cross(normal, x)
    angle = np.arctan2((direction * y).sum(axis=1), (direction * x).sum(axis=1))
    sector = np.pi / degree
    error = np.abs((angle + sector) % (2 * sector) - sector)
    assert error.mean() < MEAN_ERROR and np.quantile(error, 0.95) < LARGE_ERROR
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, atol=0.01)


@pytest.mark.slow
def test_a_line_goes_on_where_its_directions_turn_over():
    """On an ellipsoid they do between two umbilics; away from these, one family is followed everywhere."""
    surface = rebuilt(globe(32, 64), globe(32, 64).vertices * (1, 0.7, 0.5))
    field, line = (generate(surface, "curvature", n) for n in (4, 2))
    first = surface.triangles[:, 0]
    tangent = corner_tangents(surface, field, 0.0)[first]
    a, b, c = 1.0, 0.7, 0.5
    squares = np.array([a**2 * (a**2 - b**2), 0, c**2 * (b**2 - c**2)]) / (a**2 - c**2)
    offset = np.abs(surface.vertices[surface.corner_vertex[first]]) - np.sqrt(squares)
    away = np.linalg.norm(offset, axis=1) > 0.2
    vectors = line.vectors[surface.triangle_face]
    along = np.abs((tangent * vectors).sum(axis=1)) > 0.7 * np.linalg.norm(vectors, axis=1)
    assert along[away].mean() in (0, 1)


@pytest.mark.slow
def test_directions_do_not_turn_over_within_a_chart():
    """A filter would average opposite directions to none."""
    instance = instance_of(torus(), 4, "curvature")
    rgba = draw_texture(instance, torus_uv(), Look(), 512, content="anisotropy").rgba
    inside = rgba[40:200, 40:470, :2]
    for axis in (0, 1):
        assert np.abs(np.diff(inside, axis=axis)).max() < 0.1


def test_flow_maps_have_directions_in_the_map():
    """On a map that is sheared and stretched, a field along a line goes along the image of that line."""
    square = plane(1, 1)
    points = square.vertices[square.corner_vertex, :2] / 2 + 0.5
    to_uv = np.array([[0.7, 0.2], [-0.1, 0.3]])
    along = np.array([np.cos(0.4), np.sin(0.4)])
    instance = MeshInstance(square, np.eye(4), RosyField(1, np.append(along, 0)[None]))
    uv = points @ to_uv.T + [0.15, 0.2]
    texture = draw_texture(instance, uv, Look(), 64, margin=0, content="flow")
    expected = to_uv @ along / np.linalg.norm(to_uv @ along)
    decoded = 2 * texture.rgba[..., :2] - 1
    np.testing.assert_allclose(decoded, np.broadcast_to(expected, decoded.shape), atol=1e-5)
