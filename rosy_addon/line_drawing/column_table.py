"""`ColumnTable`: a table of numpy columns to which rows are appended."""

from __future__ import annotations

import numpy as np

#: Rows for which a new table has memory. It is doubled when the rows do not fit.
INITIAL_CAPACITY = 1024


class ColumnTable:
    """A table of growing columns with equal row counts; each column is an attribute.

    A subclass declares each column as a class attribute: an array without rows, of its shape and dtype.

    Columns are longer than `count`; their remaining rows are reserve. When a column grows, it is
    replaced by a new array, so do not keep references to columns across `append`.

    Attributes
    ----------
    count : int
        Number of rows.
    """

    def __init__(self) -> None:
        self.count = 0
        columns = vars(type(self)).items()
        self._column_names = [name for name, column in columns if isinstance(column, np.ndarray)]
        for name in self._column_names:
            column = getattr(self, name)
            setattr(self, name, np.zeros((INITIAL_CAPACITY, *column.shape[1:]), column.dtype))

    def append(self, **values: np.ndarray) -> np.ndarray:
        """Append rows and return their numbers. Columns that are not given are 0 in new rows."""
        row_count = len(next(iter(values.values())))
        first, self.count = self.count, self.count + row_count
        for name in self._column_names:
            column = getattr(self, name)
            while self.count > len(column):
                column = np.concatenate([column, np.zeros_like(column)])
                setattr(self, name, column)
            if name in values:
                column[first : self.count] = values[name]
        return np.arange(first, self.count)
