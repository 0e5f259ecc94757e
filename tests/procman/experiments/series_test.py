"""What makes the figures of an experiment less trustworthy is told."""

import json
from pathlib import Path
from typing import Any

from tessera_cli.experiments.plan import THIS, ExperimentFolder, PlannedRun, Sequence, alternate
from tessera_cli.experiments.series import CIRCUMSTANCES, disturbances

RUNS = alternate([Sequence("a drive", "mono", "kitti:/a/drive")], [THIS], 3)


def write_run(folder: ExperimentFolder, run: PlannedRun, others_percent: float = 1.0, **summary: Any) -> None:
    path = folder.run_path(run)
    path.mkdir(parents=True)
    (path / "summary.json").write_text(json.dumps({"ended": "complete", **summary}))
    (path / CIRCUMSTANCES).write_text(json.dumps({"duration_s": 9.0, "others_percent": others_percent}))


def test_nothing_is_said_of_quiet_runs(tmp_path: Path) -> None:
    folder = ExperimentFolder(tmp_path)
    for run in RUNS:
        write_run(folder, run, messages_repaired=0, frames_dropped=0, extractor_restarts=0)
    assert disturbances(folder, RUNS) == []


def test_other_programs_lost_messages_and_restarts_are_told(tmp_path: Path) -> None:
    folder = ExperimentFolder(tmp_path)
    write_run(folder, RUNS[0], others_percent=80.0)
    write_run(folder, RUNS[1], messages_repaired=7)
    write_run(folder, RUNS[2], messages_repaired=3, extractor_restarts=1)
    busy, lost, restarted = disturbances(folder, RUNS)
    assert busy.startswith("During 1 of 3 runs, other programs used up to 80 %")
    assert lost.startswith("In 2 of 3 runs messages got lost and were sent again, up to 7")
    assert restarted == "a_drive_mono_this_3: 1 restarted extractors."
