"""Limits that the command checks before anything starts are those of the processes."""

import re

from helpers.stack import ROOT
from tessera_cli.constants import MAX_FEATURES, MAX_INSTANCES


def limit(path: str, name: str) -> int:
    found = re.search(rf"\b{name} = (\d+);", (ROOT / "modules" / path).read_text())
    assert found, f"{path} has no {name}"
    return int(found[1])


def test_number_of_extractors() -> None:
    assert limit("messages/topics.h", "kMaxExtractors") == MAX_INSTANCES


def test_number_of_features() -> None:
    assert limit("features/feature_types.h", "kMaxFeatures") == MAX_FEATURES
