"""The verbs have the arguments that their design promises, and answer from the one package as from `estimates`."""

import inspect

import pytest

import altijax
from altijax import estimates


@pytest.mark.parametrize(
    ("verb", "arguments"),
    [
        ("estimate_elevation", ("method", "calibration", "initial_vertical_speed", "known_heights")),
        (
            "estimate_speed",
            ("method", "aid_until", "calibration", "initial_speed", "initial_pitch", "sensors"),
        ),
        ("estimate_motion", ("method", "calibration", "use_gyro", "wind", "delay")),
        ("calibrate", ("method", "until")),
    ],
)
def test_verbs_take_what_is_promised_by_keyword(verb: str, arguments: tuple[str, ...]) -> None:
    function = getattr(estimates, verb)
    assert function is getattr(altijax, verb)
    keyword_only = [
        name
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    ]
    assert set(arguments) <= set(keyword_only)
