"""python -m papers_repro [paper ...] [--output results] [--all]"""

import argparse
import importlib
import sys
from pathlib import Path
from textwrap import fill

from papers_repro.comparison import whole
from papers_repro.progress import paper_at_work
from papers_repro.report import WIDTH, deviations, format_report, summary, write_index, write_report

FOLDER = Path(__file__).parent


def known_papers() -> list[str]:
    """Folders with a reproduce.py."""
    return sorted(path.parent.name for path in FOLDER.glob("*/reproduce.py"))


def main(arguments: list[str] | None = None) -> int:
    """Run the papers asked for; 1 if anything deviates from what is recorded."""
    parser = argparse.ArgumentParser(
        prog="python -m papers_repro",
        description="Every number of a paper beside ours, a verdict for each, and the inconsistencies found.",
    )
    parser.add_argument("paper", nargs="*", help=f"without any, all: {', '.join(known_papers())}")
    parser.add_argument("--output", type=Path, default=Path("results"), help="folder of the results (default: results)")
    parser.add_argument("--all", action="store_true", help="print the numbers that match as well")
    options = parser.parse_args(arguments)
    unknown = [paper for paper in options.paper if paper not in known_papers()]
    if unknown:
        parser.error(f"unknown paper: {', '.join(unknown)}; known: {', '.join(known_papers())}")

    lines = []
    sound = True
    for paper in options.paper or known_papers():
        output = options.output / paper
        output.mkdir(parents=True, exist_ok=True)
        parts = []
        with paper_at_work(paper):
            for part in importlib.import_module(f"papers_repro.{paper}.reproduce").reproduce(output):
                print(f"\n{format_report(part, every_number=options.all)}\n", flush=True)
                parts.append(part)
        report = whole(parts)
        write_report(report, output)
        write_index(options.output)
        lines.append(f"{paper}: {summary(report.comparisons, report.findings)}")
        deviating = deviations(report, FOLDER / paper / "paper.toml")
        if deviating:
            sound = False
            lines.append(f"{paper}: contrary to what its paper.toml records:")
            lines += [
                fill(deviation, WIDTH, initial_indent="  ", subsequent_indent="      ") for deviation in deviating
            ]
    print(*lines, sep="\n")
    recorded = f"Verdicts and findings are {'as' if sound else 'NOT as'} recorded."
    print(f"{recorded} Written to {options.output}, where index.csv says which file holds which table or figure.")
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
