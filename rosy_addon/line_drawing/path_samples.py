"""Place samples along traced paths, and cut paths at samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..projection.pixel_blocks import part_of
from .surface_particles import SurfaceParticles, TracedPath

#: Two positions along a path count as the same if they differ by less than this fraction of a step.
ARC_EPS = 1e-9


class PathSamples(NamedTuple):
    """k samples along the paths of n particles, sorted by rank, then by particle.

    Attributes
    ----------
    particle : (k,) intp ndarray
        Index of the particle on whose path the sample is.
    rank : (k,) intp ndarray
        Position of the sample in the sequence of samples along its path, from 0.
    previous : (k,) intp ndarray
        Index of the sample before it on the same path; -1 if it is the first.
    arc : (k,) float64 ndarray
        Distance of the sample from the beginning of the path, in world space.
    position : SurfaceParticles
        Particles at the samples, which can continue along the path.
    """

    particle: np.ndarray
    rank: np.ndarray
    previous: np.ndarray
    arc: np.ndarray
    position: SurfaceParticles

    def take(self, indices: np.ndarray) -> PathSamples:
        """Return the samples at `indices`. These must include all samples before them on the same paths."""
        number = np.full(len(self.particle) + 1, -1)
        number[indices] = np.arange(len(indices))
        particle, rank, previous, arc = (column[indices] for column in self[:4])
        return PathSamples(particle, rank, number[previous], arc, self.position.take(indices))


class SampledPath:
    """The paths of n particles, which can be sampled and cut at distances from their beginnings.

    Parameters
    ----------
    path : TracedPath
        Segments of all paths.
    sign : (n,) ndarray
        1 if the particle moves along the direction of its member, -1 if against it.
    """

    def __init__(self, path: TracedPath, sign: np.ndarray) -> None:
        self.path = part_of(path, np.argsort(path.particle, kind="stable"))
        self.sign = sign
        particle, length = self.path.particle, self.path.length
        # Distances along all paths, one after another.
        self._end = np.cumsum(length)
        first = np.searchsorted(particle, np.arange(len(sign) + 1))
        before = np.concatenate([[0.0], self._end])
        self._first_segment, self._start = first[:-1], before[first[:-1]]
        #: (n,) float64: lengths of the paths, in world space.
        self.length = before[first[1:]] - self._start

    def samples(
        self,
        first_step: np.ndarray,
        next_step: Callable[[SurfaceParticles, np.ndarray], np.ndarray],
        ended: np.ndarray,
    ) -> PathSamples:
        """Return samples along the paths, each one step after the sample before it.

        A path also has a sample at its end if it is shorter than its first step, or if its particle cannot
        continue there.

        Parameters
        ----------
        first_step : (n,) ndarray
            Lengths of the first steps, in world space.
        next_step : callable
            Function, called as ``next_step(position, particle)`` with particles at samples and the indices of
            their paths. It returns the lengths of the steps to the next samples, in world space.
        ended : (n,) bool ndarray
            Whether the particle cannot continue at the end of its path.
        """
        path = self.path
        particle = np.flatnonzero(self.length > 0)
        arc, step = np.zeros(len(particle)), first_step[particle]
        row = np.full(len(particle), -1)
        columns: list[tuple[np.ndarray, ...]] = []
        sample_count, rank = 0, 0
        while len(particle):
            length = self.length[particle]
            arc = arc + step
            is_beyond = arc > length + ARC_EPS * step
            kept = np.flatnonzero(~is_beyond | ended[particle] | (rank == 0))
            arc, is_beyond = np.minimum(arc, length)[kept], is_beyond[kept]
            particle, step, row = particle[kept], step[kept], row[kept]
            along = self._start[particle] + arc
            segment = np.searchsorted(self._end, along - ARC_EPS * step)
            segment = np.maximum(segment, self._first_segment[particle])
            length, rest = path.length[segment], self._end[segment] - along
            fraction = 1 - np.divide(rest, length, out=np.zeros_like(rest), where=length > 0)
            begin, end = path.begin_weights[segment], path.end_weights[segment]
            weights = begin + np.clip(fraction, 0, 1)[:, None] * (end - begin)
            triangle, member = path.triangle[segment], path.member[segment]
            position = SurfaceParticles(triangle, weights, member, self.sign[particle])
            columns.append((particle, np.full(len(particle), rank), row, arc, *position.columns))
            row = np.arange(sample_count, sample_count + len(particle))
            sample_count += len(particle)
            rank += 1
            kept = np.flatnonzero(~is_beyond)
            particle, arc, row = particle[kept], arc[kept], row[kept]
            step = next_step(position.take(kept), particle)
        if not columns:
            return PathSamples(*np.empty((3, 0), np.intp), np.empty(0), SurfaceParticles.empty())
        joined = [np.concatenate(column) for column in zip(*columns, strict=True)]
        return PathSamples(*joined[:4], SurfaceParticles(*joined[4:]))

    def cut(self, arc: np.ndarray) -> TracedPath:
        """Return the segments of the paths up to the (n,) distances `arc` from their beginnings."""
        path = self.path
        begin = self._end - path.length - self._start[path.particle]
        fraction = (arc[path.particle] - begin) / np.where(path.length > 0, path.length, 1)
        kept = np.flatnonzero(fraction > ARC_EPS)
        path, fraction = part_of(path, kept), fraction[kept]
        is_cut = fraction < 1 - ARC_EPS
        begin, end = path.begin_weights, path.end_weights
        end = np.where(is_cut[:, None], begin + fraction[:, None] * (end - begin), end)
        length = np.where(is_cut, fraction, 1) * path.length
        return path._replace(end_weights=end, length=length)
