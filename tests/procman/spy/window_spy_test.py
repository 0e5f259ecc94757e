"""What `tessera spy` hands to lcm-spy."""

import zipfile

import pytest

from tessera_cli.files import BUILD
from tessera_cli.spy.window_spy import lcm_jars

JAR = BUILD / "tessera_types.jar"


def test_the_jar_has_types_and_plugins() -> None:
    if not JAR.is_file():
        pytest.skip(f"{JAR} is not there: no JDK was installed when Tessera was built")
    names = zipfile.ZipFile(JAR).namelist()
    assert "tessera/pose_t.class" in names
    assert {f"tessera/spy/{name}Plugin.class" for name in ("Image", "Path", "Map")} <= set(names)


def test_lcm_spy_is_in_the_jars_of_lcm() -> None:
    (jar,) = [path for path in lcm_jars() if path.name == "lcm.jar"]
    assert "lcm/spy/Spy.class" in zipfile.ZipFile(jar).namelist()
