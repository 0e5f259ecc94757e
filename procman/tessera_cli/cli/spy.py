"""tessera spy: lcm-spy with Tessera's message types."""

import os
from argparse import Namespace
from pathlib import Path

from tessera_cli.errors import RunFailed
from tessera_cli.files import BUILD, ROOT
from tessera_cli.settings import bus_url

PORT_OFFSETS = {"main": 0, "camera": 1, "work": 2, "procman": 3}


def main(arguments: Namespace) -> int:
    jar = BUILD / "tessera_types.jar"
    if not jar.is_file():
        raise RunFailed(
            f"{jar} is missing: the build makes it where a JDK is installed; procman/tessera setup installs one."
        )
    if not os.environ.get("DISPLAY"):
        raise RunFailed("lcm-spy is a window and needs a display, but DISPLAY is not set.")
    url = bus_url(arguments.port + PORT_OFFSETS[arguments.bus])
    class_path = os.pathsep.join(filter(None, [str(jar), os.environ.get("CLASSPATH")]))
    os.environ.update(CLASSPATH=class_path, LCM_DEFAULT_URL=url)
    print(f"tessera: lcm-spy on {url}", flush=True)
    spy = Path(ROOT / ".venv" / "bin" / "lcm-spy")
    os.execv(spy, [str(spy), f"--lcm-url={url}"])
