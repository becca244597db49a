"""Velocities against the positions they should lead to: exchanged or reversed components."""

from collections.abc import Iterator

import numpy as np

from altijax.agreement.correlation import Match
from altijax.agreement.pairs import STEP, Finding, Key, Pair

_MIRRORS = {
    0: "v_n has the other sign",
    180: "v_e has the other sign (West is positive in the file)",
    90: "v_e and v_n are exchanged",
    -90: "v_e and v_n are exchanged, and have the other sign",
}
_TURNS = {180: "v_e and v_n have the other sign", 90: "v_e is v_n, and v_n is -v_e", -90: "v_e is -v_n, and v_n is v_e"}


def velocity_match(pair: Pair) -> Match | None:
    """How moves follow the path that velocities make, as complex numbers east + i north; None where nothing moves.

    ``coefficients`` are the share of the moves that the path explains, and that its mirror image explains, by real and
    imaginary parts.
    """
    path, moved = pair.others[0], pair.series
    both = np.isfinite(path) & np.isfinite(moved)
    path, moved = path[both], moved[both]
    size = float(np.sqrt((abs(path) ** 2).sum() * (abs(moved) ** 2).sum()))
    # Positions jump by metres at rest.
    if both.sum() * STEP < 10 or not size > 0 or np.median(abs(moved)) < 10:
        return None
    straight, mirrored = complex((np.conj(path) * moved).sum() / size), complex((path * moved).sum() / size)
    # Moves over ten seconds repeat each other between.
    freedom = max(both.sum() * STEP / 10, 2.0)
    best = min(max(abs(straight), abs(mirrored)), 1 - 1e-9)
    return Match(
        lag=0.0,
        lag_std=np.inf,
        coefficients=np.array([straight.real, straight.imag, mirrored.real, mirrored.imag]),
        coefficient_std=np.full(4, np.sqrt((1 - best**2) / freedom)),
        scale=(1.0, 1.0),
        correlation=best,
        score=float(np.arctanh(best) * np.sqrt(freedom)),
        lags=np.zeros((0, 3)),
    )


def judge_velocity(key: Key, found: Match | None) -> Iterator[Finding]:
    """Components that are exchanged or have the other sign."""
    if found is None:
        return
    straight, mirrored = complex(*found.coefficients[:2]), complex(*found.coefficients[2:])
    turn = float(np.degrees(np.angle(straight)))
    if abs(straight) > 0.9 and abs(turn) < 30:
        return
    cause = None
    if abs(straight) > 0.95 and abs(straight) >= abs(mirrored):
        cause = next((why for angle, why in _TURNS.items() if _near(turn, angle)), None)
    elif abs(mirrored) > 0.95:
        turn = float(np.degrees(np.angle(mirrored)))
        cause = next((why for angle, why in _MIRRORS.items() if _near(turn, angle)), None)
    if cause is None and max(abs(straight), abs(mirrored)) < 0.95:
        return
    yield Finding(
        verdict="wrong" if cause else "doubtful",
        pairs=(key,),
        stream="gnss",
        seen="its velocities do not lead where its positions go "
        f"(they follow them by {abs(straight):.2f} of 1, turned by "
        f"{turn:.0f} deg)",
        cause=cause or "the course is not that of the positions",
        remedy="exchange the names of the columns or change their signs so that v_e is to the East, v_n to the North",
        quantities=("gnss_velocity",),
    )


def _near(angle: float, other: float) -> bool:
    return abs((angle - other + 180) % 360 - 180) < 20
