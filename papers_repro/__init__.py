"""What the papers printed, computed again: every number beside ours, a verdict, and the reason where code finds one.

    python -m papers_repro [paper ...] [--output results] [--all]

A paper is a folder here with a `reproduce.py`. It is found by being there; the whole protocol is one function,

    def reproduce(output: Path) -> Iterator[Report]

where `output` is the paper's own folder of results (it exists) for whatever files it makes. It hands over its report in
parts, each as soon as it is ready, and shows what it is doing by `papers_repro.progress.stage`. A `Report`
(papers_repro.comparison) holds comparisons, findings, remarks such as what could not be run and why, and which files
hold which element of the paper; `index.csv` in the folder of all results lists these. A `paper.toml` beside
`reproduce.py` records what is known to deviate, so that a change either way is seen:

    [verdicts]          outcome = ["table/row/column", ...]
    [findings."kind"]   "where" = "expected"

An outcome is `differs` or the name of the hypothesis that explains the number; what is not named must `match`.

`python -m papers_repro` exits with 1 as soon as a verdict or a finding is not the recorded one.
Verdicts and findings come from what a paper printed; the record is read only afterwards, to compare.
"""
