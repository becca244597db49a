"""What is known of constants beforehand, as a table."""

import pandas as pd

from altijax.calibration.parameters import CONSTANTS

PARAMETERS = pd.DataFrame.from_dict(
    {name: (constant.nominal, constant.spread, constant.unit) for name, constant in CONSTANTS.items()},
    orient="index",
    columns=["nominal", "uncertainty", "unit"],
)
"""`CONSTANTS` as a table: nominal value, NaN where it is found by the method itself; by how much a consumer's sensor,
as mounted, may be off; unit."""
