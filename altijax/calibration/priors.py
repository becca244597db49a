"""What is known of constants before a recording: what a calibration says of them, else the table."""

from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from altijax.calibration.parameters import CONSTANTS
from altijax.calibration.records import Calibration

PARAMETERS = pd.DataFrame.from_dict(
    {name: (constant.nominal, constant.spread, constant.unit) for name, constant in CONSTANTS.items()},
    orient="index",
    columns=["nominal", "uncertainty", "unit"],
)
"""`CONSTANTS` as a table: nominal value, NaN where it is found by the method itself; by how much a consumer's sensor,
as mounted, may be off; unit."""


def prior_of(
    names: Iterable[str], calibration: Calibration | None = None, spreads: Mapping[str, float] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of constants before a recording.

    A calibrated constant has taken up what the others, left at nominal, did where it was fitted: it is off by its own
    error, correlated with that of the others calibrated, and, against each constant that was not, by what it absorbed.
    All methods get the same of a calibration: an absorbed constant counts with the spread that it was fitted under,
    that of `CONSTANTS`, or with the method's own where the method is surer of it.

    Parameters
    ----------
    names : several str
        Constants that a method is uncertain of, out of `CONSTANTS`.
    calibration : Calibration, optional
        Of any method; of its constants those named count.
    spreads : mapping, optional
        Standard deviation by name of what was not calibrated, where a method has its own.

    Returns
    -------
    mean : ndarray
        (names,) Values calibrated, else nominal ones.
    covariance : ndarray
        (names, names) In the order given.
    """
    names = list(names)
    own = {} if spreads is None else spreads
    std = np.array([own.get(name, CONSTANTS[name].spread) for name in names], float)
    mean = np.array([CONSTANTS[name].nominal for name in names], float)
    if calibration is None:
        return mean, np.diag(std**2)
    calibrated = np.isin(names, list(calibration.table.index))
    mine, others = ([name for name, at in zip(names, rows, strict=True) if at] for rows in (calibrated, ~calibrated))
    mean[calibrated] = calibration.values[mine]
    # What a method finds by itself has the spread that this recording gives it.
    fitted_under = np.array(
        [np.inf if np.isnan(CONSTANTS[name].nominal) else CONSTANTS[name].spread for name in others]
    )
    taken_up = np.minimum(std[~calibrated], fitted_under) ** 2
    gain = calibration.absorbed.reindex(index=mine, columns=others).fillna(0.0).to_numpy(float)
    covariance = np.diag(np.where(calibrated, 0.0, std) ** 2)
    covariance[np.ix_(calibrated, calibrated)] = calibration.covariance.loc[mine, mine] + gain * taken_up @ gain.T
    covariance[np.ix_(calibrated, ~calibrated)] = gain * taken_up
    covariance[np.ix_(~calibrated, calibrated)] = (gain * taken_up).T
    return mean, covariance
