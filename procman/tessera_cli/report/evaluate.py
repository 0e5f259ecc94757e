"""tessera evaluate: the error of runs or trajectory files against ground truth, printed, and as a report for people."""

from argparse import Namespace
from dataclasses import replace
from pathlib import Path

import numpy as np

from tessera_cli.errors import UserError
from tessera_cli.runs.run_folder import Result, read_pair, read_run


def main(arguments: Namespace) -> int:
    paths = [Path(text) for text in arguments.paths]
    # A file behind others is the truth of them all.
    truth = paths.pop() if len(paths) > 1 and not paths[-1].is_dir() else None
    results = _name_apart([_read(path, truth, arguments) for path in paths], paths)
    if len(results) == 1:
        _print_one(results[0])
    else:
        _print_table(results)
    if arguments.report:
        _write_report(results, Path(arguments.report))
    return 0


def _read(path: Path, truth: Path | None, arguments: Namespace) -> Result:
    """Without a report nothing but the error counts, so that it must be there."""
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


def _name_apart(results: list[Result], paths: list[Path]) -> list[Result]:
    """Those of one name get their folders' names too."""
    names = [result.name for result in results]
    return [
        replace(result, name=f"{path.absolute().parent.name}/{result.name}") if names.count(result.name) > 1 else result
        for result, path in zip(results, paths)
    ]


def _print_one(result: Result) -> None:
    error = result.error
    if error is None:
        print(f"RMS error  not measured: {result.error_note}")
        return
    errors = error.errors_m
    print(f"poses      {len(errors)} of {error.num_estimated} have a ground truth")
    print(f"alignment  {error.alignment}, scale {error.scale:.6f}")
    print(f"RMS error  {error.rms_m:.4f} m")
    print(
        f"           mean {errors.mean():.4f} m, median {np.median(errors):.4f} m, 95 % {np.percentile(errors, 95):.4f} m, "
        f"max {errors.max():.4f} m"
    )


def _print_table(results: list[Result]) -> None:
    width = max(len(result.name) for result in results)
    print(
        f"{'':{width}}  {'poses':>6}  {'RMS m':>9}  {'mean m':>9}  {'median m':>9}  {'95 % m':>9}  {'max m':>9}  alignment"
    )
    for result in results:
        error = result.error
        if error is None:
            print(f"{result.name:{width}}  not measured: {result.error_note}")
            continue
        errors = error.errors_m
        figures = (error.rms_m, errors.mean(), np.median(errors), np.percentile(errors, 95), errors.max())
        print(
            f"{result.name:{width}}  {len(errors):6}  "
            + "  ".join(f"{figure:9.4f}" for figure in figures)
            + f"  {error.alignment}, scale {error.scale:.6g}"
        )


def _write_report(results: list[Result], path: Path) -> None:
    from tessera_cli.report.html_report import write_report

    if path.is_dir() or not path.absolute().parent.is_dir():
        raise UserError(f"--report {path}: name a file in a folder that exists.")
    write_report(results, path)
    print(f"report     {path.absolute()}")
