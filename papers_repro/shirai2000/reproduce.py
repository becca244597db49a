"""Tables 1 to 5: every derived number computed again, an audit of tables and text, and the experiments simulated."""

import tomllib
from collections.abc import Iterator
from pathlib import Path

from papers_repro.comparison import Output, Report
from papers_repro.progress import stage
from papers_repro.shirai2000.audit import audit
from papers_repro.shirai2000.deductions import deductions
from papers_repro.shirai2000.statements import statements
from papers_repro.shirai2000.tables import compare_derived, read_tables
from papers_repro.shirai2000.wheel_ways import wheel_findings

FOLDER = Path(__file__).parent


def reproduce(output: Path) -> Iterator[Report]:
    """What the printed numbers say among themselves, then what simulations say of them; pictures go to `output`."""
    # Only here, as the audit of printed numbers does not need JAX.
    from papers_repro.shirai2000.simulated import simulated

    paper = tomllib.loads((FOLDER / "paper.toml").read_text())
    rows = read_tables(FOLDER / "tables.csv")
    wheel = paper["instruments"]["vehicle_speed"]
    with stage("printed numbers of tables 1 to 5"):
        printed = Report(
            title=f"{', '.join(paper['authors'])} ({paper['year']}): {paper['title']}",
            comparisons=compare_derived(rows),
            findings=[
                *audit(rows),
                *statements(rows, paper),
                *deductions(rows),
                *wheel_findings(rows, wheel_sensor="vehicle_speed", pulses_per_turn=wheel["pulses_per_turn"]),
            ],
            tables=paper["tables"],
            remarks=paper["remarks"],
            outputs=[
                Output(element=f"Table {table}", file="comparison.csv", holds="each derived number beside ours")
                for table in paper["tables"]
            ],
        )
    yield printed
    yield from simulated(rows, paper, output)
