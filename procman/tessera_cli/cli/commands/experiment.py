"""tessera experiment: measurements, each a subcommand."""

from argparse import Namespace

from tessera_cli.cli.options import add_extractors, add_frames, add_port, add_settings
from tessera_cli.cli.parsing import (
    Commands,
    Parser,
    add_command,
    add_group,
    sensor_and_source,
    tiles,
    whole_number,
)
from tessera_cli.constants import FAULT_KINDS, FAULT_PROCESSES
from tessera_cli.files import ROOT

PERFORMANCE = """\
Without --source: KITTI 03 mono, EuRoC MH_01 stereo, kitchen RGB-D and sim:street-short stereo; a sequence that is not
there is left out. Simulated worlds are rendered into a log first, so that rendering does not count.

The folder holds each run, the table as performance.json and performance.csv, and performance.html. An experiment that
was interrupted continues where it stopped when the same command is given again with its --out.

Exit status: 0 measured; 1 a run failed, or runs of one commit differ in their results; 2 the arguments are wrong.

examples:
  procman/tessera experiment performance --against HEAD~1
  procman/tessera experiment performance --against f1d2cc7 --out logs/performance
  procman/tessera experiment performance --source stereo=kitti:DIR mono=sim:street-short --frames 0:200 --repetitions 3
"""
DISTRIBUTION = """\
The hosts are network namespaces on one switch, made and removed by the command, which needs root. Each configuration
runs --repetitions times as fast as it goes, once with one frame at a time (latency), and the largest one with a fault
in the middle: a host that is killed and comes back, and 2 % of the packets lost. All must give the same trajectory
and map.

The folder holds each run, the tables as {name}.json, .csv and .md, {name}.html, and its pictures. An experiment that
was interrupted continues where it stopped when the same command is given again with its --out.

Exit status: 0 measured; 1 a run failed, lost track or gave another result; 2 the arguments are wrong.

examples:
  sudo procman/tessera experiment {name}
  sudo procman/tessera experiment {name} kitti:DIR --frames 0:300 --out logs/{name}
  sudo procman/tessera experiment {name} stereo=sim:street --extractors 1 4 --tiles 1x1 2x2 --repetitions 1 --no-faults
  sudo procman/tessera experiment {name} --set dispatcher.pack_tiles=false    # then: experiment compare A B
"""
FAULTS = """\
One run is left alone; in all others faults are thrown, one after the other, as the seed shuffles them: a process gets
SIGKILL, or SIGSTOP for some seconds; an extractor gets a tenth of a core for some seconds; 2 % of all packets are lost
for some seconds. The next fault comes when there are poses again. Every run must end with the trajectory and the map
of the undisturbed one. Slow nodes and lost packets need root: the runs have a network of their own then.

The folder holds each run, the table as faults.json, each fault in faults.csv, and faults.html. An experiment that was
interrupted continues where it stopped when the same command is given again with its --out; more faults are added.

Exit status: 0 all runs ended like the undisturbed one; 1 one did not; 2 the arguments are wrong.

examples:
  sudo procman/tessera experiment faults kitti:DIR --minutes 30 --faults 200
  sudo procman/tessera experiment faults stereo=sim:street-short --faults 20 --seed 3
  procman/tessera experiment faults sim:street-short --kinds kill --processes mapper loop_closer
"""
LATENCY = """\
Without --source: KITTI 03 mono and EuRoC MH_01 stereo. Twelve live runs of each: with nothing else running and with an
endless loop on every core, at the rate of the source and three times as fast, with one extractor and with two. The
folder holds the runs, and the table as latency.md.

examples:
  procman/tessera experiment latency
  procman/tessera experiment latency --source stereo=sim:street-short --frames 0:100
"""
CORES = """\
Without --source: the sequences of `performance`. Each runs once on each number of cores that --cores names and this
machine has. For all of them the table says how many frames a second the work itself allows: all cores together can't
do more, nor can the process that has most to do. Trajectory and map must be the same.

The folder holds the runs, and the table as cores.csv.

examples:
  procman/tessera experiment cores
  procman/tessera experiment cores --source rgbd=tum:DIR --cores 1 2 3 4
"""
COMPARE = """\
examples:
  procman/tessera experiment compare logs/homogeneous logs/heterogeneous --out comparison.html
"""
DISTRIBUTIONS = {
    "single": "P extractors on one machine, images cut into L x C tiles: speed, accuracy, latency and traffic.",
    "homogeneous": "The same with the extractors on a second host as fast as the first, 1 Gbit/s.",
    "heterogeneous": "The same with P slow nodes, four to a host, on links of 100 Mbit/s.",
}
SOURCES = "sources with ground truth, instead of the default"


def add_parser(commands: Commands) -> None:
    experiments = add_group(
        commands,
        "experiment",
        "Measurements, as a table, a CSV file and a plot or page under logs/.",
        "examples:\n  procman/tessera experiment performance --against HEAD~1\n"
        "  procman/tessera experiment extraction\n  procman/tessera experiment places sim:street,seed=9\n",
    )
    _add_performance(experiments)
    for name, summary in DISTRIBUTIONS.items():
        _add_distribution(experiments, name, summary)
    _add_faults(experiments)
    compare = add_command(
        experiments, "compare", _compare, "Two of these three experiments beside each other.", COMPARE
    )
    compare.add_argument("first", metavar="A", help="the folder of an experiment")
    compare.add_argument("second", metavar="B", help="that of another one")
    compare.add_argument("--out", metavar="FILE.html", help="the page, default comparison.html in the working folder")
    _add_latency(experiments)
    _add_cores(experiments)
    add_command(experiments, "extraction", _extraction, "Time per image, compared with cv::ORB.")
    places = add_command(experiments, "places", _places, "Recall and precision of place recognition.")
    places.add_argument("sources", metavar="SOURCE", nargs="*", help=SOURCES)
    worlds = add_command(experiments, "worlds", _worlds, "How hard simulated and recorded sequences are.")
    worlds.add_argument("sources", metavar="SOURCE", nargs="*", help=SOURCES)


def _add_performance(experiments: Commands) -> None:
    summary = "Speed, CPU time, accuracy and repeatability of whole runs: this checkout against another commit."
    parser = add_command(experiments, "performance", _performance, summary, PERFORMANCE)
    parser.add_argument(
        "--against",
        metavar="COMMIT|DIR",
        help="what to compare with: a commit, which is built beside (in the user's cache folder, kept and used again), "
        "or the folder of a built checkout; default: only this checkout is measured",
    )
    count = whole_number(1, 100)
    parser.add_argument(
        "--repetitions", type=count, metavar="N", default=5, help="runs of each sequence and commit, default 5"
    )
    _add_sources(parser)
    add_frames(parser, ", for a quick check")
    add_extractors(parser, 1)
    parser.add_argument(
        "--no-timeline",
        action="store_true",
        help="leave out the picture of a frame's way through the processes, which takes one more run of each sequence",
    )
    _add_out(parser, "performance")
    add_port(parser)


def _add_distribution(experiments: Commands, name: str, summary: str) -> None:
    epilog = DISTRIBUTION.format(name=name)
    parser = add_command(experiments, name, _distribution, summary, epilog)
    parser.set_defaults(experiment=name)
    parser.add_argument(
        "source",
        metavar="SOURCE",
        nargs="?",
        type=sensor_and_source,
        help="[mono|stereo|rgbd=]SOURCE, default KITTI 03, else sim:street, mono",
    )
    count = whole_number(1, 100)
    parser.add_argument(
        "--repetitions", type=count, metavar="N", default=3, help="runs of each configuration, default 3"
    )
    parser.add_argument(
        "--extractors", type=whole_number(1, 64), metavar="P", nargs="+", help="instead of the experiment's own"
    )
    parser.add_argument("--tiles", type=tiles, metavar="LxC", nargs="+", help="instead of the experiment's own cuts")
    if name == "heterogeneous":
        parser.add_argument(
            "--step-ms",
            type=whole_number(20, 10_000),
            metavar="MS",
            default=200,
            help="that a slow node takes to extract a whole image, default 200",
        )
    parser.add_argument("--no-faults", action="store_true", help="leave out the killed node and the lost packets")
    add_frames(parser, ", for a quick check")
    add_settings(parser)
    _add_data(parser)
    _add_out(parser, name)
    add_port(parser)


def _add_faults(experiments: Commands) -> None:
    summary = "Processes killed and stopped, slow nodes and lost packets: every run ends with the same map."
    parser = add_command(experiments, "faults", _faults, summary, FAULTS)
    parser.add_argument("source", metavar="SOURCE", type=sensor_and_source, help="[mono|stereo|rgbd=]SOURCE")
    parser.add_argument(
        "--minutes",
        type=whole_number(1, 10_000),
        metavar="N",
        default=60,
        help="no fault is thrown after so many minutes, default 60",
    )
    parser.add_argument(
        "--faults",
        type=whole_number(1, 100_000),
        metavar="N",
        default=100,
        help="that are thrown in all runs together, default 100",
    )
    parser.add_argument("--seed", type=whole_number(0, 999_999_999), metavar="S", default=1, help="default 1")
    parser.add_argument(
        "--kinds", choices=FAULT_KINDS, nargs="+", default=list(FAULT_KINDS), help="of faults, default all"
    )
    parser.add_argument(
        "--processes",
        choices=FAULT_PROCESSES,
        nargs="+",
        default=list(FAULT_PROCESSES),
        help="that they hit, default all",
    )
    add_frames(parser, ", for a quick check")
    add_extractors(parser, 1)
    add_settings(parser)
    _add_out(parser, "faults")
    add_port(parser)


def _add_latency(experiments: Commands) -> None:
    summary = "From a frame's capture to its pose in live runs: idle and busy machine, rates, extractors and tiles."
    parser = add_command(experiments, "latency", _latency, summary, LATENCY)
    _add_sources(parser)
    add_frames(parser, ", for a quick check")
    add_port(parser)


def _add_cores(experiments: Commands) -> None:
    summary = "The frame rate against the number of cores, and what bounds it."
    parser = add_command(experiments, "cores", _cores, summary, CORES)
    parser.add_argument(
        "--cores", type=whole_number(1, 1024), metavar="N", nargs="+", default=[1, 2, 4, 8], help="default 1 2 4 8"
    )
    _add_sources(parser)
    add_frames(parser, ", for a quick check")
    add_extractors(parser, 1)
    _add_out(parser, "cores")
    add_port(parser)


def _add_sources(parser: Parser) -> None:
    parser.add_argument(
        "--source",
        dest="sources",
        type=sensor_and_source,
        metavar="SPEC",
        nargs="+",
        action="extend",
        default=[],
        help="[mono|stereo|rgbd=]SOURCE instead of the standard sequences, default mono",
    )
    _add_data(parser)


def _add_out(parser: Parser, name: str) -> None:
    parser.add_argument("--out", metavar="DIR", help=f"default logs/<date-time>-experiment-{name}")
    parser.add_argument("--force", action="store_true", help="an earlier experiment in --out may be replaced")


def _add_data(parser: Parser) -> None:
    data = ROOT.parent / "shared" / "data"
    parser.add_argument(
        "--data", metavar="DIR", default=str(data), help=f"holds kitti/, euroc/ and rgbd/, default {data}"
    )


def _distribution(arguments: Namespace) -> int:
    from tessera_cli.experiments.distribution.experiment import measure_distribution
    from tessera_cli.experiments.distribution.grid import EXPERIMENTS

    return measure_distribution(arguments, EXPERIMENTS[arguments.experiment])


def _compare(arguments: Namespace) -> int:
    from tessera_cli.experiments.distribution.experiment import compare_distributions

    return compare_distributions(arguments)


def _faults(arguments: Namespace) -> int:
    from tessera_cli.experiments.faults.experiment import measure_faults

    return measure_faults(arguments)


def _performance(arguments: Namespace) -> int:
    from tessera_cli.experiments.performance import measure_performance

    return measure_performance(arguments)


def _latency(arguments: Namespace) -> int:
    from tessera_cli.experiments.latency import measure_latency

    return measure_latency(arguments)


def _cores(arguments: Namespace) -> int:
    from tessera_cli.experiments.cores import measure_cores

    return measure_cores(arguments)


def _extraction(_arguments: Namespace) -> int:
    from tessera_cli.experiments.extraction import measure_extraction

    return measure_extraction()


def _places(arguments: Namespace) -> int:
    from tessera_cli.experiments.places import measure_places

    return measure_places(arguments.sources)


def _worlds(arguments: Namespace) -> int:
    from tessera_cli.experiments.worlds import measure_worlds

    return measure_worlds(arguments.sources)
