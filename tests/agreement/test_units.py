"""The fewest units that explain all ratios."""

import pytest

from altijax.agreement.units import LOGGED, Ratio, fitting_units


def ratio(value, **powers):
    return Ratio(low=value, high=value, powers=powers, tolerance=0.07)


@pytest.mark.parametrize("quantity", ["speed", "gnss_speed"])
@pytest.mark.parametrize("unit", LOGGED["speed"])
def test_every_unit_of_speed_is_told_by_another_speed(quantity, unit):
    size = LOGGED[quantity][unit]
    value = size if quantity == "gnss_speed" else 1 / size
    assert fitting_units([ratio(value, gnss_speed=1, speed=-1)])[0] == {quantity: unit}


@pytest.mark.parametrize("unit", LOGGED["gyro"])
def test_every_unit_of_a_gyro_is_told_by_the_course(unit):
    assert fitting_units([ratio(1 / LOGGED["gyro"][unit], gyro=-1)])[0] == {"gyro": unit}


def test_what_agrees_needs_no_unit_and_what_no_unit_explains_has_none():
    assert fitting_units([ratio(1.03, gnss_speed=1, speed=-1)]) == [{}]
    assert fitting_units([ratio(1.4, gnss_speed=1, speed=-1)]) == []


def test_one_unit_that_explains_three_ratios_is_preferred_to_two():
    three = [ratio(3.6, speed=1), ratio(1.0, gnss_speed=1), ratio(1 / 3.6, gnss_speed=1, speed=-1)]
    assert fitting_units(three) == [{"speed": "km/h"}]
    both = [ratio(3.6, speed=1), ratio(1 / 57.3, gyro=-1)]
    assert fitting_units(both)[0] == {"speed": "km/h", "gyro": "deg/s"}
    assert ratio(3.6, speed=1).misfit({"speed": 3.6}) == 0 < ratio(3.6, speed=1).misfit({})
