"""Arrays filled up to a few sizes, so that recordings of like length share what was compiled (NumPy, not traced)."""

import numpy as np


def bucket(count: int, least: int) -> int:
    """The size that an array of so many rows is filled up to.

    Parameters
    ----------
    count : int
        Rows.
    least : int
        The smallest size.

    Returns
    -------
    size : int
        `least`, or the first of its doubles that is large enough.
    """
    size = least
    while size < count:
        size *= 2
    return size


def padded(values: np.ndarray, size: int, fill: float | None = None, axis: int = 0) -> np.ndarray:
    """An array filled up along one axis.

    Parameters
    ----------
    values : ndarray
        At most `size` long along the axis.
    size : int
        Length afterwards.
    fill : float, optional
        What it is filled up with; its last entry by default.
    axis : int, optional
        The axis.

    Returns
    -------
    padded : ndarray
        The array, then the filling.
    """
    values = np.asarray(values)
    ends = [(0, 0)] * values.ndim
    ends[axis] = (0, size - values.shape[axis])
    return np.pad(values, ends, mode="edge") if fill is None else np.pad(values, ends, constant_values=fill)
