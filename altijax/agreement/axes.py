"""Where forward, left and up are on the sensor, by gravity and by driving, against what the axes code says."""

from collections.abc import Iterator, Mapping

import numpy as np

from altijax.agreement.correlation import Match
from altijax.agreement.pairs import Finding, Key
from altijax.formats.axes import axes_to_matrix, likeness, right_handed_codes

FORWARD: tuple[Key, ...] = (("force and change of speed", "wheel"), ("force and change of speed", "gnss"))
SIDE: Key = ("force to the side and turning", "gnss")
TURNING: Key = ("turning and course", "gnss")
GRAVITY: Key = ("gravity and up", "imu")


def judge_axes(matches: Mapping[Key, Match], level: np.ndarray | None, upright: bool, axes: str) -> Iterator[Finding]:
    """Disagreements between the axes code, gravity, changes of speed and turns.

    Parameters
    ----------
    matches : mapping of pair to Match
        What was compared.
    level : (3, 3) or None
        Forward, left and up in body axes, by row, as gravity and the code have them.
    upright : bool
        Whether gravity is nearer to the z axis than to any other.
    axes : str
        The code.
    """
    if level is None:
        return
    forward = max((matches[key] for key in FORWARD if key in matches), key=lambda found: found.score, default=None)
    ahead = _angle(forward, 0.0) if forward is not None else None
    side = matches.get(SIDE)
    # Whatever leans into its turns is not pushed to the side.
    left = _angle(side, 90.0) if side is not None and 0.5 < side.scale[0] and side.scale[1] < 2.5 else None
    turning = matches.get(TURNING)
    sign = 0 if turning is None or not told(turning) else int(np.sign(turning.coefficients[0]))
    keys = tuple(key for key in (*FORWARD, SIDE, TURNING) if key in matches)
    mirrored = ahead is not None and left is not None and abs(wrapped(ahead - left)) > 120
    inverted = level[2, 2] < -0.7
    backwards = ahead is not None and abs(ahead) > 135
    # Of axes that are all reversed, left is where up and forward say it is not; of a reversed z axis alone, forward is.
    if sign < 0 and not inverted and left is not None and abs(left) > 120:
        # Gyro and force are on one side, the course alone on the other.
        yield _course_mirrored((TURNING, SIDE))
        return
    whole = ahead is None and left is not None and abs(left) < 45
    if (
        inverted
        and sign < 0
        and ((ahead is None and not whole and left is not None) or (ahead is not None and not backwards))
    ):
        yield _one_axis((*keys, GRAVITY), 0.0, inverted)
    elif inverted and (sign < 0 or (backwards and (mirrored or sign == 0))):
        sure = mirrored or whole or (backwards and sign < 0)
        yield _reversed((*keys, GRAVITY), better_code(level, ahead, axes), sure=sure)
    elif mirrored:
        yield _one_axis(keys, float(ahead or 0.0), inverted)
    elif not upright or (ahead is not None and abs(ahead) > 50):
        yield _turned((*keys, GRAVITY), level, upright, ahead, forward, axes)
    elif ahead is None and left is not None and abs(left) > 60:
        yield _turned((SIDE,), level, upright, left, side, axes)
    if sign < 0 and not inverted and turning is not None:
        yield Finding(
            verdict="wrong" if turning.score > 5 and turning.correlation > 0.9 else "doubtful",
            pairs=(TURNING,),
            stream="imu",
            seen=f"column gz: the gyro turns {-1 / turning.scale[0]:.2g} times as far as the GNSS course, "
            "to the other side",
            cause="gx, gy, gz have the other sign, for a left turn is positive, or other axes than the accelerometer",
            remedy="read with units={'gyro': '-rad/s'} where all three have it ('rad/s' if they are right)",
            quantities=("gyro",),
        )


def judge_gyro_axes(turning: Match | None) -> Iterator[Finding]:
    """Course that follows another axis of the gyro than the one that gravity says is up."""
    if turning is None or turning.score < 4 or turning.correlation < 0.9:
        return
    direction = turning.coefficients / np.linalg.norm(turning.coefficients)
    if abs(direction[2]) < 0.5:
        where = ", ".join(f"{component:.2f}" for component in direction)
        yield Finding(
            verdict="wrong" if turning.score > 6 else "doubtful",
            pairs=(TURNING,),
            stream="imu",
            seen=f"columns gx, gy, gz: the course follows the gyro about ({where}) forward, left, up, not about up",
            cause="the gyro's axes are not those of the accelerometer",
            remedy="turn or rename the gyro's columns in the file, so that both sensors have the same x, y and z",
            quantities=("gyro axes",),
        )


def told(found: Match) -> bool:
    """Whether chance does not explain a match."""
    return found.score > 3 or (found.score > 2 and found.correlation > 0.9)


def wrapped(angle: float) -> float:
    """An angle in degrees between -180 and 180."""
    return (angle + 180) % 360 - 180


def better_code(level: np.ndarray, ahead: float | None, axes: str) -> str:
    """The code that puts gravity up and, where driving tells it, forward ahead; else the nearest to `axes`."""
    C = axes_to_matrix(axes)
    up = C.T @ level[2]
    codes = right_handed_codes()
    best = max(float(axes_to_matrix(code)[2] @ up) for code in codes)
    codes = [code for code in codes if axes_to_matrix(code)[2] @ up > best - 1e-9]
    if ahead is None:
        front = axes.index("F" if "F" in axes else "B")
        return max(codes, key=lambda code: (likeness(code, axes), code[front] == axes[front]))
    direction = np.cos(np.radians(ahead)) * level[0] + np.sin(np.radians(ahead)) * level[1]
    return max(codes, key=lambda code: float(axes_to_matrix(code)[0] @ (C.T @ direction)))


def _angle(found: Match, expected: float) -> float | None:
    """By how many degrees to the left a horizontal direction is off; None where it is not told."""
    if not told(found):
        return None
    direction, std = found.coefficients, found.coefficient_std
    if np.degrees(np.linalg.norm(std) / np.linalg.norm(direction)) > 25:
        # The axis that hardly moves says nothing, yet the other may say its sign.
        direction = np.where(np.abs(direction) > 3 * std, direction, 0)
        if not direction.any():
            return None
    return wrapped(float(np.degrees(np.arctan2(direction[1], direction[0]))) - expected)


def _reversed(keys: tuple[Key, ...], code: str, sure: bool) -> Finding:
    other = "" if sure else f"; or the sensor is turned: axes={code!r}"
    return Finding(
        verdict="wrong" if sure else "doubtful",
        pairs=keys,
        stream="imu",
        seen="columns ax, ay, az: gravity is not up, and forward is backward too",
        cause="all three have the other sign, as iOS logs them (gravity instead of specific force)",
        remedy=f"read with units={{'accelerometer': '-m/s^2'}}, or '-g'{other}",
        quantities=("accelerometer",),
    )


def _one_axis(keys: tuple[Key, ...], ahead: float, inverted: bool) -> Finding:
    if abs(wrapped(2 * ahead)) > 90:
        axis, mend = "forward and left are exchanged", "exchange the columns of these two axes in the file"
    else:
        name = "up" if inverted else "left" if abs(ahead) < 90 else "forward"
        axis, mend = f"the axis that points {name} has the other sign", "change the sign of that column in the file"
    return Finding(
        verdict="wrong",
        pairs=keys,
        stream="imu",
        seen=f"columns ax, ay, az: {axis}, against the change of speed and the turns",
        cause="the axes are left-handed, which no axes code can mend",
        remedy=mend,
        quantities=("accelerometer",),
    )


def _course_mirrored(keys: tuple[Key, ...]) -> Finding:
    return Finding(
        verdict="wrong",
        pairs=keys,
        stream="gnss",
        seen="its course turns to the other side than the gyro and the force to the side",
        cause="v_e or v_n has the other sign, they are exchanged, or the course counts counter-clockwise",
        remedy="change the sign or exchange the names of the columns, so that v_e is to the East and v_n to the North",
        quantities=("gnss_velocity",),
    )


def _turned(
    keys: tuple[Key, ...], level: np.ndarray, upright: bool, ahead: float | None, found: Match | None, axes: str
) -> Finding:
    code = better_code(level, ahead, axes)
    seen = []
    if not upright:
        where = ", ".join(f"{component:.2f}" for component in level[2])
        seen.append(f"the mean points to ({where}) forward, left, up, so gravity is not up")
    if ahead is not None and abs(ahead) > 50:
        side = "left" if ahead > 0 else "right"
        seen.append(f"the force of driving points {abs(ahead):.0f} deg to the {side} of where it should")
    sure = ahead is not None and found is not None and abs(ahead) > 60 and found.score > 3 and found.correlation > 0.8
    doubt = "" if ahead is not None else "; no change of speed tells where forward is, so make sure of it"
    return Finding(
        verdict="wrong" if sure else "doubtful",
        pairs=keys,
        stream="imu",
        seen=f"columns ax, ay, az: with axes={axes!r} {' and '.join(seen)}",
        cause="the axes code is not how the sensor is mounted",
        remedy=f"axes={code!r} would put it there{doubt}",
        quantities=("axes",),
    )
