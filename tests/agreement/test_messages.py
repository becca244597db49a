"""What is wrong beyond doubt raises, unless the user insisted; what is doubtful is a sentence."""

import pytest

from altijax.agreement.messages import tell_disagreements
from altijax.formats.stream_checks import RecordingError
from tests.agreement.drives import late, scaled, streams


def test_wrong_raises_with_the_file_and_stated_units_do_not():
    given = scaled(streams(), "wheel", ["speed"], 3.6)
    given["wheel"].attrs["file"] = "my_wheel.csv"
    with pytest.raises(RecordingError, match=r"my_wheel.csv: .*3.6 times.*units={'speed': 'km/h'}"):
        tell_disagreements(given, "FLU", (), [])
    problems: list[str] = []
    tell_disagreements(given, "FLU", ("speed",), problems)
    assert len(problems) == 1 and "looks like km/h" in problems[0]


def test_doubt_is_a_sentence_and_agreement_none():
    problems: list[str] = []
    tell_disagreements(late(streams(), "gnss", 0.0, 1.02), "FLU", (), problems)
    assert len(problems) == 1 and "clock runs" in problems[0]
    tell_disagreements(streams(), "FLU", (), problems)
    assert len(problems) == 1
