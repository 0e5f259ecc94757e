"""tessera evaluate: the error of runs or trajectory files."""

from argparse import Namespace

from tessera_cli.cli.parsing import Commands, add_command

EPILOG = """\
Files hold TUM rows `timestamp tx ty tz qx qy qz qw` or KITTI rows of 12 numbers.

examples:
  procman/tessera evaluate logs/mh01
  procman/tessera evaluate trajectory_kitti.txt data/kitti/poses/03.txt --align sim3 --report both.html
  procman/tessera evaluate logs/one logs/another --report comparison.html
"""


def add_parser(commands: Commands) -> None:
    summary = "Error of runs or trajectory files against ground truth, by the evo package."
    parser = add_command(commands, "evaluate", main, summary, EPILOG)
    parser.usage = "procman/tessera evaluate RUN|TRAJECTORY ... [GROUND_TRUTH] [options]"
    parser.add_argument(
        "paths",
        metavar="RUN|TRAJECTORY ... [GROUND_TRUTH]",
        nargs="+",
        help="runs' folders or trajectory files, one or several; a file after them is the truth of them all, "
        "by default each run's own ground_truth.txt",
    )
    parser.add_argument("--report", metavar="FILE.html", help="a report for people too, which compares them all")
    parser.add_argument(
        "--align", choices=("sim3", "se3"), help="default: se3 for a stereo or RGB-D run, sim3 (with scale) otherwise"
    )


def main(arguments: Namespace) -> int:
    from tessera_cli.report.evaluate import evaluate

    return evaluate(arguments)
