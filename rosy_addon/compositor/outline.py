"""Outlines: ink lines along silhouettes, borders and sharp creases, found in the G-buffer.

An edge lies between two adjacent pixels if the surface does not continue from one to the other
(`pixel_neighbors.neighbor_masks`). Where one surface occludes the other, the line is drawn only on
the nearer one.
"""

from __future__ import annotations

import numpy as np

from ..progress import Progress, Task, run_to_completion, subtask
from ..projection.gbuffer import GBuffer
from ..projection.pixel_blocks import pixel_blocks
from ..projection.pixel_neighbors import affine_depth, neighbor_masks_task
from .look import Look

#: Minimum depth difference at an occlusion, in multiples of the depth tolerance per pixel (see
#: `pixel_neighbors.affine_depth`).
DEPTH_JUMP = 2.0

#: Label of all steps.
STEP_LABEL = "drawing outlines"

#: (dx, dy, bit) of the four nearest neighbors. The bit is that of `neighbor_masks`.
NEIGHBORS_4 = ((1, 0, 5), (-1, 0, 3), (0, 1, 7), (0, -1, 1))


def outline_coverage(gbuffer: GBuffer, look: Look) -> np.ndarray:
    """Return the coverage by outlines, without progress reports; see `outline_task`."""
    return run_to_completion(outline_task(gbuffer, look))


def outline_task(gbuffer: GBuffer, look: Look) -> Task[np.ndarray]:
    """Compute the coverage of each pixel by outlines.

    Parameters
    ----------
    gbuffer : GBuffer
    look : Look
        In pixels of the frame. Its `outline`, `crease_angle` and `cross_creases` are used.

    Returns
    -------
    (P,) float32 ndarray
        0 to 1.
    """
    width, height = gbuffer.camera.width, gbuffer.camera.height
    radius = int(np.ceil(look.outline))
    # The frame has an empty margin that is wider than the lines.
    stride = width + 2 * radius + 2
    entry_of_cell = np.full((height + 2 * radius + 2) * stride, -1, dtype=np.int32)
    cell = np.empty(len(gbuffer.pixel), dtype=np.int32)
    for block in pixel_blocks(len(cell)):
        yield Progress(0.1 * block.start / len(cell), STEP_LABEL)
        row, column = np.divmod(gbuffer.pixel[block], np.int32(width))
        cell[block] = (row + radius + 1) * np.int32(stride) + column + np.int32(radius + 1)
        entry_of_cell[cell[block]] = np.arange(block.start, block.stop, dtype=np.int32)
    # Larger depths are nearer to the eye.
    depth, tolerance = np.empty((2, len(cell)), dtype=np.float32)
    for block in pixel_blocks(len(cell)):
        yield Progress(0.1 + 0.1 * block.start / len(cell), STEP_LABEL)
        depth[block], tolerance[block] = affine_depth(gbuffer.part(block))
    edge_pixels, line_width = yield from subtask(
        _outline_edges_task(gbuffer, look, entry_of_cell, cell, stride, depth, tolerance), 0.2, 0.9
    )
    depth_slack = np.float32(DEPTH_JUMP) * tolerance[edge_pixels]
    coverage = np.zeros(len(cell), dtype=np.float32)
    for distance, dx, dy in _disc_offsets(radius):
        yield Progress(0.9, STEP_LABEL)
        neighbor = entry_of_cell.take(cell[edge_pixels] + (dy * stride + dx))
        paintable = (neighbor >= 0) & (
            gbuffer.instance_id.take(neighbor) == gbuffer.instance_id[edge_pixels]
        )
        paintable &= depth.take(neighbor) >= depth[edge_pixels] - depth_slack * np.float32(
            max(distance, 1.0)
        )
        pixel_coverage = np.clip(line_width[paintable] - np.float32(distance), 0, 1)
        neighbor = neighbor[paintable]
        coverage[neighbor] = np.maximum(coverage[neighbor], pixel_coverage)
    return coverage


def _outline_edges_task(
    gbuffer: GBuffer,
    look: Look,
    entry_of_cell: np.ndarray,
    cell: np.ndarray,
    stride: int,
    depth: np.ndarray,
    tolerance: np.ndarray,
) -> Task[tuple[np.ndarray, np.ndarray]]:
    """Find the pixels at an edge of their surface, unless the neighbor occludes them.

    Both sides of a crease are edges, so each gets half the width. There is no edge at the border of
    the frame, and none where the surface continues but the field ends.

    Returns
    -------
    edge_pixels : (n,) intp ndarray
        Entries of the G-buffer.
    line_width : (n,) float32 ndarray
        Width of the line at these pixels, in pixels.
    """
    masks_task = neighbor_masks_task(gbuffer, look.crease_angle, look.cross_creases)
    mask = yield from subtask(masks_task, 0.0, 0.6, STEP_LABEL)
    defined = gbuffer.representation != 0
    line_width = np.zeros(len(cell), dtype=np.float32)
    for block in pixel_blocks(len(cell)):
        yield Progress(0.6 + 0.4 * block.start / len(cell), STEP_LABEL)
        row, column = np.divmod(gbuffer.pixel[block], np.int32(gbuffer.camera.width))
        for dx, dy, bit in NEIGHBORS_4:
            inside = (column + dx >= 0) & (column + dx < gbuffer.camera.width)
            inside &= (row + dy >= 0) & (row + dy < gbuffer.camera.height)
            is_border = inside & defined[block] & (mask[block] >> np.uint16(bit) & 1 == 0)
            border = np.flatnonzero(is_border) + block.start
            neighbor = entry_of_cell.take(cell[border] + (dy * stride + dx))
            jump_limit = np.float32(DEPTH_JUMP) * tolerance[border]
            jump = (depth.take(neighbor) - depth[border]) / jump_limit
            same_depth = (np.abs(jump) <= 1) & (neighbor >= 0)
            width = np.where(same_depth, np.float32(look.outline / 2), np.float32(look.outline))
            width[(jump > 1) & (neighbor >= 0)] = 0
            same_instance = gbuffer.instance_id.take(neighbor) == gbuffer.instance_id[border]
            width[same_instance & ~defined.take(neighbor) & (neighbor >= 0)] = 0
            line_width[border] = np.maximum(line_width[border], width)
    edge_pixels = np.flatnonzero(line_width)
    return edge_pixels, line_width[edge_pixels]


def _disc_offsets(radius: int) -> list[tuple[float, int, int]]:
    """(distance, dx, dy) of the pixels within `radius` pixels of a pixel, itself included."""
    steps = range(-radius, radius + 1)
    offsets = [(float(np.hypot(dx, dy)), dx, dy) for dy in steps for dx in steps]
    return [offset for offset in offsets if offset[0] <= radius]
