"""Axes codes: where a sensor's x, y and z point on the vehicle."""

import itertools

import numpy as np

LETTERS = {"F": (1, 0, 0), "B": (-1, 0, 0), "L": (0, 1, 0), "R": (0, -1, 0), "U": (0, 0, 1), "D": (0, 0, -1)}
"""Directions on the vehicle in body axes (forward, left, up)."""


def axes_to_matrix(axes: str) -> np.ndarray:
    """Rotation from sensor axes to body axes (forward, left, up).

    Parameters
    ----------
    axes : str
        Where the sensor's x, y and z point on the vehicle, one letter each: F or B (forward, backward), L or R (left,
        right), U or D (up, down).

    Returns
    -------
    C : (3, 3)
        Maps sensor vectors to body vectors.

    Raises
    ------
    ValueError
        If `axes` is not three letters, one of each pair, forming right-handed axes.
    """
    wrong = None
    if len(axes) != 3 or not set(axes) <= set(LETTERS):
        wrong = "needs three letters out of F/B, L/R, U/D"
    else:
        C = np.array([LETTERS[letter] for letter in axes], dtype=float).T
        if np.linalg.matrix_rank(C) < 3:
            wrong = "needs one letter of each pair F/B, L/R, U/D"
        elif np.linalg.det(C) < 0:
            wrong = "is left-handed"
    if wrong:
        alike = {code: likeness(code, axes) for code in right_handed_codes()}
        near = [code for code in alike if alike[code] == max(alike.values())][:3]
        raise ValueError(f"axes {axes!r} {wrong}; right-handed and near it: {', '.join(near)}")
    return C


def right_handed_codes() -> list[str]:
    """The 24 codes that are rotations."""
    codes = ["".join(letters) for letters in itertools.product(LETTERS, repeat=3)]
    return [code for code in codes if np.linalg.det(np.array([LETTERS[letter] for letter in code])) > 0.5]


def likeness(code: str, other: str) -> int:
    """How many letters two codes share."""
    return sum(a == b for a, b in zip(code, other, strict=False))
