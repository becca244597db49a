"""Constants fitted to a reference: the record of them, and what an estimate may take them for."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from altijax.drives import Drive
from altijax.elevation_estimate.model import NOMINAL, PARAMETERS, elevation, uncertain_constants
from altijax.elevation_estimate.posterior import Constants


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Calibration:
    """Constants fitted to a reference, how well they are known, and whether they help where they were not fitted.

    Attributes
    ----------
    method : str
        Method whose misfit was minimised.
    values, std : Series
        Value and standard deviation by parameter name.
    correlation : DataFrame
        Correlation between the parameters.
    absorbed : DataFrame
        By how much each value moves if one of the constants left at nominal (columns) is off by one unit.
    held_out : DataFrame
        One row a recording: last time used, and the misfit (RMS, its offset removed) with nominal and with fitted
        constants, on what was fitted and on what was held out; NaN where nothing was.
    """

    method: str
    values: pd.Series
    std: pd.Series
    correlation: pd.DataFrame
    absorbed: pd.DataFrame
    held_out: pd.DataFrame

    def _table(self) -> pd.DataFrame:
        return pd.DataFrame(
            {"value": self.values, "std": self.std, "unit": PARAMETERS["unit"].reindex(self.values.index)}
        )

    def __repr__(self) -> str:
        return f"Calibration of {self.method!r}\n{self._table()}\n{self.held_out.T}"

    def _repr_html_(self) -> str:
        title = f"<p>Calibration of <b>{self.method}</b>; RMS misfit where fitted and where held out</p>"
        return title + self._table().to_html(border=0) + self.held_out.round(3).to_html(border=0)


def prior_constants(
    drive: Drive, method: str, calibration: Calibration | None = None, fixed: dict[str, float] | None = None
) -> Constants:
    """What is known of a method's constants before a drive.

    Parameters
    ----------
    drive : Drive
        The drive.
    method : {"shirai", "slope", "fused"}
        The method.
    calibration : Calibration, optional
        Of any method; other constants are those of an instrument that nobody has calibrated.
    fixed : dict of str to float, optional
        Constants known exactly, which are left out.

    Returns
    -------
    constants : Constants
        A calibrated constant has taken up what the others, left at nominal, did where it was fitted: it is off by its
        own error and, against each of them, by what it absorbed.
    """
    fixed = {} if fixed is None else fixed
    values = {} if calibration is None else {str(name): float(value) for name, value in calibration.values.items()}
    names = [name for name in values if name not in fixed]
    others = {name: std for name, std in uncertain_constants(drive, method).items() if name not in values | fixed}
    covariance = np.diag(np.square([*np.zeros(len(names)), *others.values()]))
    if calibration is not None:
        std = calibration.std[names].to_numpy()
        own = calibration.correlation.loc[names, names].to_numpy() * np.outer(std, std)
        absorbed = calibration.absorbed if calibration.method == method else pd.DataFrame()
        gain = absorbed.reindex(index=names, columns=list(others)).fillna(0.0).to_numpy()
        through = np.vstack([gain, np.eye(len(others))])
        covariance = through @ np.diag(np.square(list(others.values()))) @ through.T
        covariance[: len(names), : len(names)] += own
    mean = NOMINAL | values
    if "initial_vertical_speed" in others:
        mean["initial_vertical_speed"] = float(elevation({**values, **fixed}, drive, "shirai")["vertical_speed"][0])
    order = (*names, *others)
    return Constants(names=order, mean=np.array([mean[name] for name in order]), covariance=covariance)
