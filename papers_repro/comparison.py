"""Printed numbers against recomputed ones, in exact arithmetic: a verdict for each, and the reason where one is found.

A printed number stands for all values that round to it. The same number computed again from other printed numbers is a
`match` when it is one of them: within half a unit of the last printed digit (a tie rounds either way). If it is not,
the hypotheses in `HYPOTHESES` are tried in order; the first under which the printed digits come out makes the verdict
`explained` and names it. A hypothesis with freedom in it comes after those without, and a rule (dropping digits, taking
another quantity) counts only where it reproduces more numbers of the table than the plain rule does. Else it `differs`.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache
from math import inf

# Exact; infinite only as a ratio to an error of zero.
Value = Fraction | float

HALF = Fraction(1, 2)


@dataclass(frozen=True)
class Interval:
    """All values from `low` to `high`, ends included, with the arithmetic that printed tables need."""

    low: Value
    high: Value

    def __sub__(self, other: "Interval") -> "Interval":
        return Interval(self.low - other.high, self.high - other.low)

    def __abs__(self) -> "Interval":
        if self.low >= 0:
            return self
        return Interval(max(-self.high, Fraction(0)), max(-self.low, self.high))

    def __and__(self, other: "Interval") -> "Interval | None":
        low, high = max(self.low, other.low), min(self.high, other.high)
        return Interval(low, high) if low <= high else None


@dataclass(frozen=True)
class Printed:
    """A number as printed. `1/27` stands for its denominator, of which the digits were printed.

    Attributes
    ----------
    text
        The characters in the paper.
    value
        The number, or the denominator of a reciprocal.
    unit
        One unit of the last printed digit.
    reciprocal
        Whether it was printed as 1/n.
    """

    text: str
    value: Fraction
    unit: Fraction
    reciprocal: bool


@dataclass(frozen=True, kw_only=True)
class Recomputed:
    """A number computed again.

    Attributes
    ----------
    value
        From the inputs as printed.
    reach
        All values it takes while each input stays within half a unit of its last printed digit.
    truncating
        Whether its table drops digits where others round, by `rounding_votes`.
    other_quantity
        Name of another measured quantity that its table is found to have used, and the number with it.
    """

    value: Value
    reach: Interval
    truncating: bool = False
    other_quantity: "tuple[str, Recomputed] | None" = None


# How a printed input is read: `as_printed` or `before_rounding`.
Reading = Callable[[str], Interval]


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One number of a paper beside ours.

    Attributes
    ----------
    table, row, column
        Where it stands.
    unit
        Unit of `ours` and `difference`; "1/n" says that they are denominators.
    printed
        The number as printed.
    ours
        The number computed again by the plain rule.
    difference
        Ours minus printed.
    verdict
        "match", "explained" or "differs".
    explanation
        Name of the hypothesis that reproduces the printed digits, empty for the other two verdicts.
    note
        How it does so, or how far ours can reach.
    """

    table: str
    row: str
    column: str
    unit: str
    printed: str
    ours: float
    difference: float
    verdict: str
    explanation: str = ""
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Something that the printed numbers, taken together, show.

    Attributes
    ----------
    kind
        Short name of the rule that is broken, or of what follows.
    inconsistency
        True where numbers or statements contradict each other, False where more is learned from them.
    rule
        The rule, in a sentence.
    where, printed, expected
        The place, what stands there and what should; for what is learned, what follows from it.
    evidence
        The deciding number.
    """

    kind: str
    inconsistency: bool
    rule: str
    where: str
    printed: str
    expected: str
    evidence: str


@dataclass(frozen=True, kw_only=True)
class Output:
    """A file of the results, and which element of the paper it holds.

    Attributes
    ----------
    element
        As the paper calls it: "Table 2", "Fig. 6", "Eq. (5)".
    file
        Name in the paper's folder of results.
    holds
        What of it.
    """

    element: str
    file: str
    holds: str


@dataclass(frozen=True, kw_only=True)
class Report:
    """A part of what one paper's `reproduce` hands over, or all of it.

    Attributes
    ----------
    title
        One line.
    comparisons
        Every number, in the order of the paper.
    findings
        What an audit of them found.
    tables
        A line on what each table holds, by `Comparison.table`.
    remarks
        Lines a reader needs: what was not published, what was not run and why.
    outputs
        Which files hold which elements of the paper.
    """

    title: str
    comparisons: list[Comparison] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    tables: dict[str, str] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    outputs: list[Output] = field(default_factory=list)


def whole(parts: Iterable[Report]) -> Report:
    """All parts of a report together, under the title of the first."""
    first, *others = parts
    together = first
    for part in others:
        together = replace(
            together,
            comparisons=together.comparisons + part.comparisons,
            findings=together.findings + part.findings,
            tables=together.tables | part.tables,
            remarks=together.remarks + part.remarks,
            outputs=together.outputs + part.outputs,
        )
    return together


@cache
def parse(text: str) -> Printed:
    """A printed decimal such as ``-0.099`` or reciprocal such as ``1/27``; ValueError for anything else."""
    if not re.fullmatch(r"-?\d+(\.\d+)?|1/\d+", text):
        raise ValueError(f"text must be a decimal or 1/n as printed, got {text!r}")
    digits = text.removeprefix("1/")
    decimals = len(digits.partition(".")[2])
    return Printed(text, Fraction(digits), Fraction(1, 10**decimals), digits != text)


@cache
def as_printed(text: str) -> Interval:
    """A printed number taken at its word."""
    return Interval(parse(text).value, parse(text).value)


@cache
def before_rounding(text: str) -> Interval:
    """All values that round to a printed number."""
    printed = parse(text)
    return Interval(printed.value - HALF * printed.unit, printed.value + HALF * printed.unit)


def recompute(formula: Callable[[Reading], Interval]) -> Recomputed:
    """The value and the reach of a formula, which is written once for any reading of its printed inputs."""
    return Recomputed(value=formula(as_printed).low, reach=formula(before_rounding))


def ratio(numerator: Interval, denominator: Interval) -> Interval:
    """Quotient of two intervals without negative values, infinite where the denominator is zero."""

    def quotient(n: Value, d: Value) -> Value:
        return n / d if d > 0 else inf

    return Interval(quotient(numerator.low, denominator.high), quotient(numerator.high, denominator.low))


def mean(intervals: Sequence[Interval]) -> Interval:
    """Mean of values that move independently."""
    zero: Value = Fraction(0)
    n = len(intervals)
    return Interval(sum((i.low for i in intervals), zero) / n, sum((i.high for i in intervals), zero) / n)


def rounding_votes(numbers: Iterable[tuple[Printed, Value]]) -> tuple[int, int]:
    """How many of the numbers come out by dropping digits alone, and how many by rounding alone.

    A reciprocal below 1/1 has no vote: it could only be printed as 1/1.
    """
    truncation = rounding = 0
    for printed, value in numbers:
        if not (printed.reciprocal and value < 1):
            truncation += truncates_to(printed, value) and not rounds_to(printed, value)
            rounding += rounds_to(printed, value) and not truncates_to(printed, value)
    return truncation, rounding


def write_like(printed: Printed, value: Value, more: int = 0) -> str:
    """A value in the form of a printed number, with some more digits."""
    decimals = len(printed.text.partition(".")[2]) + more
    return f"{'1/' if printed.reciprocal else ''}{float(value):.{decimals}f}"


def rounds_to(printed: Printed, value: Value) -> bool:
    """Whether a value rounds to a printed number, a tie either way."""
    return -HALF * printed.unit <= value - printed.value <= HALF * printed.unit


def truncates_to(printed: Printed, value: Value) -> bool:
    """Whether a value becomes a printed number by dropping its further digits."""
    sign = -1 if printed.text.startswith("-") else 1
    return 0 <= sign * (value - printed.value) < printed.unit


def _below_one(printed: Printed, ours: Recomputed) -> str | None:
    """An accuracy of less than 1/1 is printed as 1/1."""
    return "" if printed.reciprocal and printed.value == 1 and ours.value < 1 else None


def _truncated(printed: Printed, ours: Recomputed) -> str | None:
    """Digits are dropped instead of rounded, as in more numbers of this table than not."""
    return "" if ours.truncating and truncates_to(printed, ours.value) else None


def _fewer_digits(printed: Printed, ours: Recomputed) -> str | None:
    """The zeros at the end (two or more, behind two digits or more) only hold places."""
    digits = printed.text.removeprefix("1/")
    zeros = len(digits) - len(digits.rstrip("0"))
    if "." in digits or zeros < 2 or len(digits) - zeros < 2:
        return None
    coarse = replace(printed, unit=Fraction(10**zeros))
    return f"to {len(digits) - zeros} digits" if rounds_to(coarse, ours.value) else None


def _other_quantity(printed: Printed, ours: Recomputed) -> str | None:
    """Another measured quantity was compared with the actual value, as in more numbers of this table than not."""
    if ours.other_quantity is None:
        return None
    name, other = ours.other_quantity
    if rounds_to(printed, other.value):
        return f"{name} gives {write_like(printed, other.value, 1)}"
    inputs = _unrounded_inputs(printed, other)
    return inputs and f"{name}, {inputs}"


def _unrounded_inputs(printed: Printed, ours: Recomputed) -> str | None:
    """It was computed from inputs with more digits than printed, each within half a unit of its last printed one."""
    if ours.other_quantity is not None:
        return None
    if ours.truncating:
        possible = printed.value <= ours.reach.high and ours.reach.low < printed.value + printed.unit
    else:
        possible = before_rounding(printed.text) & ours.reach is not None
    return f"reach {_span(printed, ours.reach)}" if possible else None


def _repeated_digit(printed: Printed, ours: Recomputed) -> str | None:
    """A digit was set twice; not one after the point, which would leave fewer decimals than its column has."""
    whole = printed.text.partition(".")[0]
    for i in range(1, len(whole)):
        if whole[i] == whole[i - 1]:
            meant = printed.text[:i] + printed.text[i + 1 :]
            if rounds_to(parse(meant), ours.value) or _truncated(parse(meant), ours) is not None:
                return f"{meant} must have been meant"
    return None


def _span(printed: Printed, reach: Interval) -> str:
    return f"{write_like(printed, reach.low, 1)}..{write_like(printed, reach.high, 1).removeprefix('1/')}"


# In the order in which they are tried.
HYPOTHESES: dict[str, Callable[[Printed, Recomputed], str | None]] = {
    "below one": _below_one,
    "truncated": _truncated,
    "fewer digits": _fewer_digits,
    "other quantity": _other_quantity,
    "unrounded inputs": _unrounded_inputs,
    "repeated digit": _repeated_digit,
}


def compare(*, table: str, row: str, column: str, unit: str, printed: str, ours: Recomputed) -> Comparison:
    """The verdict on one printed number."""
    number = parse(printed)
    verdict, explanation, note = "differs", "", f"inputs reach {_span(number, ours.reach)}"
    if rounds_to(number, ours.value):
        verdict, note = "match", ""
    else:
        for name, hypothesis in HYPOTHESES.items():
            reproduced = hypothesis(number, ours)
            if reproduced is not None:
                verdict, explanation, note = "explained", name, reproduced
                break
    return Comparison(
        table=table,
        row=row,
        column=column,
        unit="1/n" if number.reciprocal else unit,
        printed=printed,
        ours=float(ours.value),
        difference=float(ours.value - number.value),
        verdict=verdict,
        explanation=explanation,
        note=note,
    )


def compare_bound(*, table: str, row: str, column: str, unit: str, bound: str, ours: float) -> Comparison:
    """The verdict on a number that must not exceed a bound: "match" where it holds."""
    limit = float(bound)
    return Comparison(
        table=table,
        row=row,
        column=column,
        unit=unit,
        printed=f"<= {bound}",
        ours=ours,
        difference=ours - limit,
        verdict="match" if ours <= limit else "differs",
    )
