"""tessera experiment: measurements."""

from argparse import Namespace

from tessera_cli.cli.parsing import Commands, add_command
from tessera_cli.errors import UserError


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "experiment",
        main,
        "Measurements, as a table, a CSV file and a plot under logs/.",
        "examples:\n  procman/tessera experiment extraction\n  procman/tessera experiment places sim:street,seed=9\n",
    )
    parser.add_argument(
        "name",
        metavar="NAME",
        choices=("extraction", "places", "worlds"),
        help="extraction: time per image compared with cv::ORB; places: recall and precision of place recognition; "
        "worlds: how hard simulated and recorded sequences are",
    )
    parser.add_argument(
        "sources", metavar="SOURCE", nargs="*", help="places, worlds: sources with ground truth, instead of the default"
    )


def main(arguments: Namespace) -> int:
    match arguments.name:
        case "places":
            from tessera_cli.report.experiment_places import measure_places

            return measure_places(arguments.sources)
        case "worlds":
            from tessera_cli.report.experiment_worlds import measure_worlds

            return measure_worlds(arguments.sources)
    if arguments.sources:
        raise UserError("experiment extraction takes no SOURCE: it has images of its own.")
    from tessera_cli.report.experiment_extraction import measure_extraction

    return measure_extraction()
