"""tessera evaluate: the error of runs or trajectory files against ground truth, printed and as a report."""

from argparse import Namespace
from dataclasses import replace
from pathlib import Path

import numpy as np

from tessera_cli.errors import UserError
from tessera_cli.runs.run_folder import Result, read_pair, read_run
from tessera_cli.runs.trajectories import TrajectoryError

HEADINGS = ("RMS m", "mean m", "median m", "95 % m", "max m")


def evaluate(arguments: Namespace) -> int:
    paths = [Path(text) for text in arguments.paths]
    # A file after others is the truth of them all.
    truth = paths.pop() if len(paths) > 1 and not paths[-1].is_dir() else None
    results = _with_distinct_names([_read(path, truth, arguments) for path in paths], paths)
    if len(results) == 1:
        _print_one(results[0])
    else:
        _print_table(results)
    if arguments.report:
        _write_report(results, Path(arguments.report))
    return 0


def _read(path: Path, truth: Path | None, arguments: Namespace) -> Result:
    """Without a report only the error is shown, so there must be one."""
    if not path.is_dir():
        if truth is None:
            raise UserError(f"{path} brings no ground truth: give GROUND_TRUTH as the last argument.")
        return read_pair(path, truth, arguments.align)
    result = read_run(path, truth, arguments.align)
    if result.error is None and not arguments.report:
        if result.truth is None:
            raise UserError(f"{path} brings no ground truth: give GROUND_TRUTH as the last argument.")
        raise UserError(f"{path}: {result.error_note}")
    return result


def _with_distinct_names(results: list[Result], paths: list[Path]) -> list[Result]:
    """Those of one name get their folders' names too."""
    names = [result.name for result in results]
    return [
        replace(result, name=f"{path.absolute().parent.name}/{result.name}") if names.count(result.name) > 1 else result
        for result, path in zip(results, paths)
    ]


def _statistics(error: TrajectoryError) -> tuple[float, ...]:
    """As HEADINGS."""
    errors = error.errors_m
    return (error.rms_m, errors.mean(), np.median(errors), np.percentile(errors, 95), errors.max())


def _print_one(result: Result) -> None:
    error = result.error
    if error is None:
        print(f"RMS error  not measured: {result.error_note}")
        return
    rms, mean, median, p95, largest = _statistics(error)
    print(f"poses      {len(error.errors_m)} of {error.num_estimated} have a ground truth")
    print(f"alignment  {error.alignment}, scale {error.scale:.6f}")
    print(f"RMS error  {rms:.4f} m")
    print(f"           mean {mean:.4f} m, median {median:.4f} m, 95 % {p95:.4f} m, max {largest:.4f} m")


def _print_table(results: list[Result]) -> None:
    width = max(len(result.name) for result in results)
    headings = "  ".join(f"{heading:>9}" for heading in HEADINGS)
    print(f"{'':{width}}  {'poses':>6}  {headings}  alignment")
    for result in results:
        error = result.error
        if error is None:
            print(f"{result.name:{width}}  not measured: {result.error_note}")
            continue
        figures = "  ".join(f"{figure:9.4f}" for figure in _statistics(error))
        alignment = f"{error.alignment}, scale {error.scale:.6g}"
        print(f"{result.name:{width}}  {len(error.errors_m):6}  {figures}  {alignment}")


def _write_report(results: list[Result], path: Path) -> None:
    from tessera_cli.report.html_report import write_report  # late: the figures take a second to load

    if path.is_dir() or not path.absolute().parent.is_dir():
        raise UserError(f"--report {path}: name a file in a folder that exists.")
    write_report(results, path)
    print(f"report     {path.absolute()}")
