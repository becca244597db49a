"""What is known of constants beforehand."""

from altijax.calibration.parameters import CONSTANTS
from altijax.calibration.priors import PARAMETERS


def test_the_table_is_that_of_the_constants() -> None:
    assert list(PARAMETERS.index) == list(CONSTANTS)
    for name, row in PARAMETERS.iterrows():
        constant = CONSTANTS[str(name)]
        assert (row["uncertainty"], row["unit"]) == (constant.spread, constant.unit)
    assert list(PARAMETERS.index[PARAMETERS["nominal"].isna()]) == ["initial_vertical_speed"]
