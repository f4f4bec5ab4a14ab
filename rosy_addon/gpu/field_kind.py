"""`FieldKind`: the shader constants that all fields of one degree share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ..field.rosy_field import RosyField
from ..field.symmetry import FieldSymmetry
from ..projection.field_channel import FieldChannel
from .mesh_buffers import field_channels


@dataclass(frozen=True)
class FieldKind:
    """The shader constants of all fields of one degree.

    Attributes
    ----------
    degree : int
        N.
    channels : tuple of FieldChannel
        Layers of the image of field channels: harmonics without gaps, then the families.
    symmetry : FieldSymmetry
    """

    degree: int
    channels: tuple[FieldChannel, ...]
    symmetry: FieldSymmetry

    @property
    def harmonic_orders(self) -> list[int]:
        """Orders j of the harmonics, the first layers. Layers that fill a gap are 0."""
        return [order for kind, order in self.channels if kind == "deviation"]

    @property
    def line_count(self) -> int:
        """M, the number of lines through a pixel."""
        return self.symmetry.line_count

    @property
    def sheets_per_turn(self) -> int:
        """Sheets of a full turn."""
        return self.symmetry.sheets_per_turn

    @property
    def family_count(self) -> int:
        """The number of families, 1 without labels."""
        return self.channels[-1][1] if self.channels and self.channels[-1][0] == "family" else 1


def field_kinds(fields: Iterable[RosyField]) -> dict[int, FieldKind]:
    """Return the kinds of fields, by degree."""
    channels: dict[int, list[FieldChannel]] = {}
    for field in fields:
        channels.setdefault(field.degree, []).extend(field_channels(field))
    return {
        degree: _field_kind(degree, kind_channels)
        for degree, kind_channels in sorted(channels.items())
    }


def _field_kind(degree: int, channels: Sequence[FieldChannel]) -> FieldKind:
    """Return a kind with harmonics without gaps, and the first channel of families."""
    harmonic_orders = [order for kind, order in channels if kind == "deviation"]
    ordered: list[FieldChannel] = []
    if harmonic_orders:
        ordered = [("deviation", j) for j in range(min(harmonic_orders), max(harmonic_orders) + 1)]
    ordered += [channel for channel in channels if channel[0] == "family"][:1]
    # The symmetry depends on the harmonics that exist, not on those that fill gaps.
    return FieldKind(degree, tuple(ordered), FieldSymmetry(degree, tuple(harmonic_orders)))
