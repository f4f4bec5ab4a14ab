"""`compare`: measure how several fields differ, and list it in a table."""

import json
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from ..core.errors import RosyError, RosyWarning, one_line
from ..field.analysis import DEFAULT_REACH, SingularityMatching, format_degrees, match_on_surface
from ..field.field import Difference, Field
from ..field.surface import is_same_surface

#: Replacements for characters that LaTeX interprets.
_LATEX = {
    **{character: f"\\{character}" for character in "&%$#_{}"},
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
}


#: Columns of the table, by title: the key of its values in `Comparison.rows`, and the function that formats
#: a value.
_COLUMNS: dict[str, tuple[str, Callable[[Any], str]]] = {
    "degree": ("degree", str),
    "energy": ("energy", "{:.4g}".format),
    **{key: (key, str) for key in ("singularities", "positive", "negative")},
}
#: Columns that are added if there are differences from the first field, by title.
_DIFFERENCE_COLUMNS: dict[str, tuple[str, Callable[[Any], str]]] = {
    "matched": ("matched", str),
    "mean (deg)": ("mean", format_degrees),
    "95 % (deg)": ("p95", format_degrees),
    "largest (deg)": ("max", format_degrees),
    "on face": ("worst_face", str),
}


@dataclass(frozen=True, eq=False)
class Comparison:
    """The differences of several fields from the first of them. A notebook shows them as a table.

    Attributes
    ----------
    fields : dict of str to Field
        The fields, by title.
    differences : dict of str to Difference
        Differences of the other fields from the first one, by title. A field of another degree, or on other
        vertices or faces than the first, has no item.
    matchings : dict of str to SingularityMatching
        Pairs of singularities of the first field and of another field that match, by the title of the other.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> comparison = rf.compare({"form": rf.form(torus), "turned": rf.form(torus).rotated(0.1)})
    >>> round(comparison.rows[1]["mean"], 2)
    5.73
    """

    fields: dict[str, Field]
    differences: dict[str, Difference]
    matchings: dict[str, SingularityMatching]

    def __repr__(self) -> str:
        return f"<Comparison: {', '.join(self.fields)}>"

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Measurements of each field, with angles in degrees.

        Keys are title, degree, energy (see `Field.energy`), and numbers of singularities: singularities
        (all), positive and negative. Fields with a difference from the first one have more keys. These are
        mean, rms, p95, max, worst_face, worst_position (the center of that face) and compared (see
        `Difference`), matched (the number of pairs of singularities that match), and matched_distance (the
        mean distance of a pair in units of the mesh; None if there is no pair).
        """
        return [self._row(title, field) for title, field in self.fields.items()]

    def _row(self, title: str, field: Field) -> dict[str, Any]:
        index = field.singularities.index
        row: dict[str, Any] = {
            "title": title,
            "degree": field.degree,
            "energy": field.energy,
            "singularities": len(index),
            "positive": int((index > 0).sum()),
            "negative": int((index < 0).sum()),
        }
        if title not in self.differences:
            return row
        difference, matching = self.differences[title], self.matchings[title]
        for name in ("mean", "rms", "p95", "max"):
            row[name] = float(np.degrees(getattr(difference, name)))
        worst = row["worst_face"] = difference.worst_face
        row["worst_position"] = field.surface.face_center[worst].tolist() if worst >= 0 else None
        row["compared"] = difference.compared
        row["matched"] = len(matching.distance)
        row["matched_distance"] = float(matching.distance.mean()) if row["matched"] else None
        return row

    def cells(self) -> list[list[str]]:
        """Return the table as texts: a row of titles, then a row for each field. A missing value is "-".

        Line breaks and control characters in titles of fields are escaped.
        """
        columns = _COLUMNS | (_DIFFERENCE_COLUMNS if self.differences else {})
        cells = [["field", *columns]]
        for row in self.rows:
            values = [write(row[key]) if key in row else "-" for key, write in columns.values()]
            cells.append([one_line(row["title"]), *values])
        return cells

    def to_text(self) -> str:
        """Return the table with aligned columns, for a terminal."""
        cells = self.cells()
        # Titles are aligned to the left, and numbers to the right.
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        formats = [f"{{:<{widths[0]}}}", *(f"{{:>{width}}}" for width in widths[1:])]
        lines = ["  ".join(formats).format(*row).rstrip() for row in cells]
        if self.differences:
            first = one_line(next(iter(self.fields)))
            lines.append(f"Angles and matched singularities are those to '{first}'.")
        return "\n".join(lines)

    __str__ = to_text

    def to_json(self) -> str:
        """Return the `rows` as a JSON array."""
        return json.dumps(self.rows)

    def to_latex(self) -> str:
        """Return the table as a ``tabular`` of LaTeX, which needs the package ``booktabs``."""
        cells = self.cells()
        head, *body = [" & ".join(map(_latex_text, row)) + r" \\" for row in cells]
        begin = rf"\begin{{tabular}}{{l{'r' * (len(cells[0]) - 1)}}}"
        lines = [begin, r"\toprule", head, r"\midrule", *body, r"\bottomrule", r"\end{tabular}"]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        head, *body = [[escape(text) for text in row] for row in self.cells()]
        rows = ["<tr>" + "".join(f"<th>{text}</th>" for text in head) + "</tr>"]
        rows += ["<tr>" + "".join(f"<td>{text}</td>" for text in row) + "</tr>" for row in body]
        return f"<table>{''.join(rows)}</table>"


def _latex_text(text: str) -> str:
    """Return a text escaped for LaTeX. The sign of a missing value, "-", becomes "--"."""
    return "--" if text == "-" else "".join(_LATEX.get(letter, letter) for letter in text)


def compare(
    fields: Sequence[Field] | Mapping[str, Field], *, reach: float = DEFAULT_REACH
) -> Comparison:
    """Compare fields with the first of them: angles, energies and singularities.

    Parameters
    ----------
    fields : sequence of Field, or mapping of str to Field
        The keys of a mapping are the titles of the fields. In a sequence, the titles are "field 1",
        "field 2" and so on.
    reach : float
        Singularities of two fields match if they have the same index and are at most this far apart, as a
        fraction of the longest side of the mesh. The nearest pairs are matched first. Each singularity is in
        at most one pair.

    Raises
    ------
    RosyError
        If there is no field.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> fields = {"form": rf.form(torus), "along z": rf.along_axis(torus, (0, 0, 1))}
    >>> print(rf.compare(fields))  # doctest: +ELLIPSIS
    field    degree  energy  singularities  positive  negative ...
    """
    titled = titled_fields(fields)
    reference = next(iter(titled.values()))
    comparison = Comparison(titled, {}, {})
    for title, field in list(titled.items())[1:]:
        if field.degree != reference.degree:
            continue
        if not is_same_surface(field.surface, reference.surface):
            first = next(iter(titled))
            text = f"{title}: is on other vertices or faces than {first}: no angles to it"
            warnings.warn(text, RosyWarning, stacklevel=2)
            continue
        comparison.differences[title] = reference.difference(field)
        pair = reference.singularities, field.singularities
        comparison.matchings[title] = match_on_surface(field.surface, *pair, reach)
    return comparison


def titled_fields(fields: Iterable[Field] | Mapping[str, Field]) -> dict[str, Field]:
    """Return a dictionary of fields by title, with the titles that `compare` gives them.

    Raises
    ------
    RosyError
        If there is no field.
    """
    if isinstance(fields, Mapping):
        titled = dict(fields)
    else:
        titled = {f"field {number}": field for number, field in enumerate(fields, 1)}
    if not titled:
        raise RosyError("there is no field to compare: give one or more")
    return titled
