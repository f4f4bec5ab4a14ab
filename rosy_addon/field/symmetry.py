"""The symmetry of a field: how many lines (pairs of opposite directions) its N directions form."""

from dataclasses import dataclass


@dataclass(frozen=True)
class FieldSymmetry:
    """The symmetry of a field of N directions.

    A direction and its opposite have the same streamlines, so they are called one *line* here. The N
    directions of a RoSy (a rotationally symmetric field) include their opposites if N is even. Directions
    that deviate from a RoSy include their opposites if N is even and all harmonics have even order.

    Attributes
    ----------
    degree : int
        N.
    harmonic_orders : tuple of int
        Orders j of the harmonics C_j by which the directions deviate from a RoSy (see
        `field.directional_field`). Empty for a RoSy.
    """

    degree: int
    harmonic_orders: tuple[int, ...] = ()

    @property
    def has_opposites(self) -> bool:
        """Whether the opposite of each direction is also a direction of the field."""
        return self.degree % 2 == 0 and not any(j % 2 for j in self.harmonic_orders)

    @property
    def line_count(self) -> int:
        """M, the number of lines through a point: N / 2 if the field has opposites, N otherwise."""
        return self.degree // 2 if self.has_opposites else self.degree

    @property
    def sheets_per_turn(self) -> int:
        """Number of sheets of the covering surface that a direction passes when it turns by 2 pi at a point.

        The covering surface contains each point of the surface once for each direction in which a streamline
        can pass it, on a separate *sheet*. There are 2 M sheets: forward and backward for each of the M lines
        (see `line_count`). A full turn passes all of them if the field is a RoSy or has opposites. Otherwise
        it passes only the N forward or only the N backward sheets.
        """
        if self.harmonic_orders and not self.has_opposites:
            return self.degree
        return 2 * self.line_count
