"""What a compositor sees: pixels, the field on them, and where a streamline may go next."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property

import numpy as np

from ..field.directions import evaluate
from ..field.rosy_field import check_degree
from ..projection.carried import Trait
from ..projection.gbuffer import GBuffer
from ..projection.steps import links, screen_axes
from ..trigonometry import phase_of

#: Offsets of the 3 x 3 neighbours, in the order of the bits of `links`.
OFFSETS = tuple((dx, dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1))


@dataclass(frozen=True, eq=False)
class Flow:
    """A field of one degree on a flat list of P pixels, with no geometry left in it.

    Attributes
    ----------
    degree : int
    width, height : int
        Of the frame, in pixels.
    pixel : (P,) int32 ndarray
        Flat indices, ascending, from the lower left.
    representation : (P,) complex64 ndarray
        z = rho exp(i N t), t an angle in the view plane; 0 where the field is undefined.
    axes : (P, 2) complex64 ndarray or None
        On screen, in pixels as x + i y, the axes of the view plane's frame at each pixel as they
        lie on the surface. None in the plane, where they are 1 and i.
    joined : (P,) uint16 ndarray
        To which of its 3 x 3 neighbours a streamline may step from each pixel: bit i is for
        `OFFSETS[i]`. Pixels where the field is undefined are joined to none.
    traits : dict of Trait to (P,) complex64 ndarray
        What the field has besides, in the view plane: by how much its directions deviate from the
        members of the RoSy that tells them apart, and which line belongs to the stored member.
    """

    degree: int
    width: int
    height: int
    pixel: np.ndarray
    representation: np.ndarray
    axes: np.ndarray | None
    joined: np.ndarray
    traits: dict[Trait, np.ndarray] = dataclass_field(default_factory=dict)

    @cached_property
    def harmonics(self) -> list[tuple[int, np.ndarray]]:
        """Pairs of j and C_j, (P,) complex64, of `field.directions`; none of a RoSy."""
        return [
            (number, values)
            for (kind, number), values in self.traits.items()
            if kind == "deviation"
        ]

    @property
    def is_paired(self) -> bool:
        """Whether each direction has an opposite one, with which it shares its streamlines."""
        return self.degree % 2 == 0 and not any(j % 2 for j, _ in self.harmonics)

    @property
    def lines(self) -> int:
        """M, the images that show all directions: N, or N / 2 where opposite ones share one."""
        return self.degree // 2 if self.is_paired else self.degree

    def direction(self, member: np.ndarray) -> np.ndarray:
        """The directions that belong to members.

        Parameters
        ----------
        member : (P,) complex ndarray
            Unit vectors in the view plane's frame, of the RoSy.

        Returns
        -------
        (P,) complex ndarray
            Unit vectors, likewise: of a RoSy the same.
        """
        if not self.harmonics:
            return member
        member = member.astype(np.complex128)
        return phase(member * evaluate(self.harmonics, member))

    @cached_property
    def neighbours(self) -> np.ndarray:
        """(9, P + 1) int32: the entry of the list after a step to each of `OFFSETS`.

        P where streamlines end; column P, the state of those that have, leads to P alone. One row
        an offset, since a streamline goes on in one direction and then finds the next entries side
        by side.
        """
        count = len(self.pixel)
        entry = np.full(self.height * self.width, count, dtype=np.int32)
        entry[self.pixel] = np.arange(count, dtype=np.int32)
        table = np.full((9, count + 1), count, dtype=np.int32)
        for bit, (dx, dy) in enumerate(OFFSETS):
            here = np.flatnonzero(self.joined >> bit & 1)
            table[bit, here] = entry[self.pixel[here] + (dy * self.width + dx)]
        return table

    def on_screen(self, member: np.ndarray, foreshorten: bool = False) -> np.ndarray:
        """Directions in the view plane as they run on screen.

        Parameters
        ----------
        member : (P,) complex ndarray
            Unit vectors in the view plane's frame.
        foreshorten : bool
            Keep the length that they have on screen, instead of length 1.

        Returns
        -------
        (P,) complex64 ndarray
            Pixels.
        """
        if self.axes is None:
            return member.astype(np.complex64)
        # In double precision, so that all releases of numpy round to the same single one.
        x, y = self.axes[:, 0].astype(np.complex128), self.axes[:, 1].astype(np.complex128)
        direction = x * member.real + y * member.imag
        return direction.astype(np.complex64) if foreshorten else phase(direction)

    def turning(self, direction: np.ndarray, member: np.ndarray) -> np.ndarray:
        """How fast directions turn from pixel to pixel, by differences over linked neighbours.

        Parameters
        ----------
        direction : (P,) complex64 ndarray
            On screen.
        member : (P,) complex64 ndarray
            The same in the view plane, where members are told apart: a neighbour that differs by
            more than half the angle between them is on another one, and does not count.

        Returns
        -------
        (P,) complex64 ndarray
            d angle / dx + i d angle / dy, radians per pixel.
        """
        direction, member = (np.append(phase(a), np.complex64(0)) for a in (direction, member))
        here, member_here = direction[:-1].conj(), member[:-1].conj()
        same = np.cos(np.pi / max(self.degree, 2))
        sine = []
        for offset in ((-1, 0), (1, 0), (0, -1), (0, 1)):
            there = self.neighbours[OFFSETS.index(offset), :-1]
            turn = direction.take(there) * here
            alike = (member.take(there) * member_here).real > same
            sine.append(np.where(alike & (turn.real > 0), turn.imag, 0))
        left, right, below, above = sine
        return 0.5 * ((right - left) + 1j * (above - below)).astype(np.complex64)


def phase(numbers: np.ndarray) -> np.ndarray:
    """complex64 numbers scaled to modulus 1; 0 stays 0."""
    numbers = numbers.astype(np.complex128)
    size = np.sqrt(numbers.real**2 + numbers.imag**2)
    return np.divide(numbers, size, out=numbers, where=size > 0).astype(np.complex64)


def surface_flow(gbuffer: GBuffer, degree: int, crease_angle: float, cross_creases: bool) -> Flow:
    """The pixels of a G-buffer that show fields of one degree.

    Parameters
    ----------
    gbuffer : GBuffer
    degree : int
    crease_angle : float
        Radians; streamlines end where normals of neighbouring pixels differ by more.
    cross_creases : bool
        Let them cross all the same.
    """
    joined = links(gbuffer, crease_angle, cross_creases)
    axes = screen_axes(gbuffer)
    chosen = np.asarray(gbuffer.degrees)[gbuffer.body] == degree
    if chosen.all():
        chosen = slice(None)
    z = gbuffer.representation[chosen]
    pixel, camera, joined = gbuffer.pixel[chosen], gbuffer.camera, joined[chosen]
    if not z.all():
        joined = _closed(joined, pixel, camera.width, camera.height, z != 0)
    return Flow(
        degree=degree,
        width=camera.width,
        height=camera.height,
        pixel=pixel,
        representation=z,
        axes=axes[chosen],
        joined=joined,
        traits=_own({trait: values[chosen] for trait, values in gbuffer.traits.items()}),
    )


def _own(traits: dict[Trait, np.ndarray]) -> dict[Trait, np.ndarray]:
    """The traits that fields of one degree have; the others are those of fields of other degrees.

    What they have not is as a RoSy has it: 1 for C_0, which goes with other harmonics, else 0.
    """
    first = ("deviation", 0)
    found = {trait for trait, values in traits.items() if trait != first and values.any()}
    free = any(kind == "deviation" for kind, _ in found)
    if first in traits and (free or (traits[first] != 1).any()):
        found.add(first)
    return {trait: values for trait, values in traits.items() if trait in found}


def planar_flow(
    angles: np.ndarray, degree: int, magnitude: np.ndarray | float | None = None
) -> Flow:
    """A field in the plane, given by the angle of a member at each pixel.

    Parameters
    ----------
    angles : (H, W) ndarray
        Radians, counter-clockwise from the direction of the rows, which are counted from the
        bottom. NaN is undefined.
    degree : int
    magnitude : (H, W) ndarray or float, optional
        rho, 1 if not given.
    """
    degree = check_degree(degree)
    angles = np.asarray(angles, dtype=np.float64)
    height, width = angles.shape
    rho = np.broadcast_to(np.float32(1) if magnitude is None else magnitude, angles.shape)
    defined = np.isfinite(angles) & (rho > 0)
    z = phase_of(np.where(defined, degree * angles, 0.0).ravel())
    z *= np.where(defined, rho, 0).astype(np.float32).ravel()
    pixel = np.arange(height * width, dtype=np.int32)
    everywhere = np.full(len(pixel), 0b111_111_111, dtype=np.uint16)
    return Flow(
        degree=degree,
        width=width,
        height=height,
        pixel=pixel,
        representation=z,
        axes=None,
        joined=_closed(everywhere, pixel, width, height, z != 0),
    )


def _closed(
    joined: np.ndarray, pixel: np.ndarray, width: int, height: int, defined: np.ndarray
) -> np.ndarray:
    """`Flow.joined`: bits of `links`, but for those that lead to where the field is undefined.

    Parameters
    ----------
    joined : (P,) uint16 ndarray
    pixel : (P,) int ndarray
    width, height : int
        Of the frame; nothing is defined beyond it.
    defined : (P,) bool ndarray
    """
    frame = np.zeros(height * width, dtype=bool)
    frame[pixel] = defined
    frame = frame.reshape(height, width)
    inside = np.pad(frame, 1).astype(np.uint16)
    # Three neighbours in a row are three bits, in the order of `OFFSETS`.
    row = inside[:, :-2] | inside[:, 1:-1] << 1 | inside[:, 2:] << 2
    goes_on = row[:-2] | row[1:-1] << 3 | row[2:] << 6
    goes_on *= frame
    return joined & goes_on.ravel()[pixel]


def blend_weights(flow: Flow, guiding_angle: float) -> np.ndarray:
    """(P,) float32: cos^2 (N (t - phi) / 2), the share of the first set of member images.

    Equal to 0 at the breaking points of that set and to 1 at those of the other.
    """
    toward = turned(phase(flow.representation), -flow.degree * guiding_angle)
    return (0.5 + 0.5 * toward.real).astype(np.float32)


def nearest_member(flow: Flow, guiding_angle: float) -> np.ndarray:
    """(P,) complex64: the member nearest to a guiding angle, in the view plane (equations 3, 4).

    Of two equally near ones it is the one on the counter-clockwise side, as in the paper.
    """
    toward = flow.representation.astype(np.complex128)
    toward *= np.exp(-1j * flow.degree * guiding_angle)
    member = np.exp(1j * (np.angle(toward) / flow.degree + guiding_angle))
    member[flow.representation == 0] = 0
    return member.astype(np.complex64)


def turned(numbers: np.ndarray, angle: float) -> np.ndarray:
    """complex64 numbers rotated by an angle; the product is rounded once, by every numpy alike."""
    return (numbers.astype(np.complex128) * np.complex128(np.exp(1j * angle))).astype(np.complex64)


def all_members(flow: Flow, guiding_angle: float) -> list[np.ndarray]:
    """N times (P,) complex64: the member nearest to a guiding angle, and its rotations."""
    nearest = nearest_member(flow, guiding_angle)
    return [turned(nearest, 2 * np.pi * k / flow.degree) for k in range(flow.degree)]
