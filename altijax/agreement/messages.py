"""Disagreements told: as errors where they are beyond doubt, else as sentences."""

from collections.abc import Collection, Mapping

import pandas as pd

from altijax.agreement.report import agreement_report
from altijax.formats.stream_checks import RecordingError


def tell_disagreements(
    streams: Mapping[str, pd.DataFrame | None], axes: str, insisted: Collection[str] | None, problems: list[str]
) -> None:
    """Raise for what is wrong beyond doubt, append a sentence to `problems` for what is doubtful.

    What rests on something that the user insisted on (a unit, the axes code, a clock that were stated; all of it, where
    it is None) does not raise.
    """
    _, findings = agreement_report(streams, axes)
    wrong = []
    for finding in findings:
        frame = streams[finding.stream]
        file = finding.stream if frame is None else frame.attrs.get("file", finding.stream)
        comma = "," if finding.seen.startswith("column") else ":"
        told = f"{file}{comma} {finding.seen}; {finding.cause}: {finding.remedy}"
        if finding.verdict == "wrong" and insisted is not None and not set(finding.quantities) & set(insisted):
            wrong.append(told)
        else:
            problems.append(told)
    if wrong:
        raise RecordingError("\n".join(wrong))
