"""Streamlines over the texels of many charts are those of the surface."""

import numpy as np
import pytest
from shapes import instance_of, torus
from uv_maps import patches_uv

from rosy_addon.compositor.covering import build_covering
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import surface_pixel_look
from rosy_addon.compositor.streamline_batch import StreamlineBatch
from rosy_addon.line_drawing.surface_particles import SurfaceParticles, advance
from rosy_addon.line_drawing.tangent_mesh import build_tangent_mesh, nearest_member
from rosy_addon.surface_texture.charts import uv_charts
from rosy_addon.surface_texture.draw import step_length
from rosy_addon.surface_texture.texel_field import frames_at, texel_field
from rosy_addon.surface_texture.texels import TexelSurface, rasterize_charts, texture_frame

#: Steps of the streamlines that are compared.
STEPS = 40


def torus_texels(degree, size):
    """A torus with a field, and the texels of 32 charts in a texture of some size."""
    instance = instance_of(torus(), degree)
    mesh = build_tangent_mesh(instance)
    charts = uv_charts(instance.surface, mesh, patches_uv(3))
    assert charts.chart.max() + 1 == 32
    texels = rasterize_charts(charts, texture_frame(charts, size, "torus"), "torus")
    return TexelSurface(instance, mesh, charts, texels, step_length(mesh, charts, texels))


@pytest.mark.parametrize("degree", [2, 3])
def test_streamlines_cross_seams_as_on_the_mesh(degree):
    """After 40 steps, streamlines are where particles on the mesh are, to less than a texel.

    Particles know neither texels nor charts. Streamlines begin within half a texel of its center.
    """
    surface = torus_texels(degree, 1024)
    _, mesh, charts, texels, step, _ = surface
    field = texel_field(surface, np.pi)
    look = surface_pixel_look(Look(), step, step)
    covering = build_covering(field, look, np.full((len(texels), 1), 0.1, dtype=np.float32))
    start = np.unique(field.seam_steps.source)
    start = start[field.representation[start] != 0][:: max(len(start) // 4000, 1)]
    # Sheet 0 is the member nearest to the frame.
    batch = StreamlineBatch(covering, [look], [None], STEPS, len(start))
    line = covering.cell_of_pixel[start].astype(np.intp)
    states = [line.copy() for line, *_ in batch.trace(line)]
    cell = states[STEPS][: len(start)] % covering.cell_count
    pixel_of_cell = np.zeros(covering.cell_count, dtype=np.intp)
    pixel_of_cell[covering.cell_of_pixel] = np.arange(len(texels))
    reached = pixel_of_cell[cell]

    triangle, weights = texels.triangle, texels.barycentric.astype(np.float64)
    z = np.einsum("nk,nk->n", weights[start], mesh.z[triangle[start]])
    frame = frames_at(charts, triangle[start], weights[start])
    ones, member = np.ones(len(start)), nearest_member(frame, z, degree)
    particles = SurfaceParticles(triangle[start], weights[start], member, ones)
    length, limits = STEPS * step * ones, {"max_segment_length": step * ones, "max_segments": 400}
    end, walked, *_ = advance(mesh, particles, length, **limits)
    arrived = walked > 0.999 * length
    assert (cell[arrived] != 0).mean() > 0.99
    both = np.flatnonzero(arrived & (cell != 0))
    streamline = mesh.points_at(triangle[reached[both]], weights[reached[both]])
    error = np.linalg.norm(streamline - mesh.points_at(end.triangle, end.weights)[both], axis=1)
    texel_size = np.sqrt(mesh.area.sum() / len(texels))
    assert np.median(error) < 0.7 * texel_size and np.quantile(error, 0.98) < 1.7 * texel_size


def test_steps_across_seams_are_isometries():
    """They lead as far on the surface as in the chart, and back to where they began."""
    surface = torus_texels(4, 512)
    charts, texels = surface.charts, surface.texels
    steps = texel_field(surface, np.pi).seam_steps
    source, target = texels.triangle[steps.source], texels.triangle[steps.target]
    displacement = np.exp(1j * np.arange(len(source)))
    before = charts.to_surface(source, displacement / 512)
    after = charts.to_surface(target, steps.displaced(np.arange(len(source)), displacement) / 512)
    # The triangles of the texels may differ from those where the step begins and ends.
    ratio = np.abs(after) / np.abs(before)
    assert np.median(np.abs(ratio - 1)) < 0.01 and np.quantile(np.abs(ratio - 1), 0.95) < 0.1
