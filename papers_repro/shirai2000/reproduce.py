"""Part (a): every derived number of tables 1 to 5 computed again, and an audit of what the tables and the text say."""

import tomllib
from pathlib import Path

from papers_repro.comparison import Report
from papers_repro.shirai2000.audit import audit
from papers_repro.shirai2000.deductions import deductions
from papers_repro.shirai2000.statements import statements
from papers_repro.shirai2000.tables import compare_derived, read_tables
from papers_repro.shirai2000.wheel_ways import wheel_findings

FOLDER = Path(__file__).parent


def reproduce(output: Path) -> Report:
    """Comparisons and findings of the printed tables; nothing further is written to `output`."""
    paper = tomllib.loads((FOLDER / "paper.toml").read_text())
    rows = read_tables(FOLDER / "tables.csv")
    wheel = paper["instruments"]["vehicle_speed"]
    return Report(
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
    )
