"""`tessera spy`: the window of lcm-spy, with Tessera's types and plugins (procman/lcm_spy)."""

import os
import shutil
import sysconfig
from argparse import Namespace
from pathlib import Path
from typing import NoReturn

from tessera_cli.console import say
from tessera_cli.errors import RunError
from tessera_cli.files import BUILD
from tessera_cli.lcm_bus import is_on_lan, stack_bus_url

# Images and maps of a stack take more than the 128 MB of LCM's own script.
MEMORY = "-Xmx1g"


def open_window(arguments: Namespace) -> NoReturn:
    """lcm-spy takes the place of this process."""
    jar, java = BUILD / "tessera_types.jar", shutil.which("java")
    if not jar.is_file() or java is None:
        missing = "java" if java is None else str(jar)
        hint = "the build makes the types where a JDK is installed; procman/tessera setup installs one"
        raise RunError(f"{missing} is missing: {hint}. spy --text needs neither.")
    if not os.environ.get("DISPLAY"):
        raise RunError("lcm-spy is a window and needs a display, but DISPLAY is not set; spy --text needs none.")
    lan = is_on_lan(arguments)
    url = stack_bus_url(arguments.bus, arguments.port, lan)
    os.environ.update(
        TESSERA_MAIN_URL=stack_bus_url("main", arguments.port, lan),
        TESSERA_CAMERA_URL=stack_bus_url("camera", arguments.port, lan),
        TESSERA_MAP_URL=stack_bus_url("map", arguments.port, lan),
    )
    say(f"lcm-spy on {url}: a double click opens a channel")
    # lcm-spy looks for plugins in all jars of the class path, and complains of each class of LCM's own ones that lacks
    # something: those go beside it. It reads the variable too, and would find everything twice.
    os.environ.pop("CLASSPATH", None)
    beside = f"-Xbootclasspath/a:{os.pathsep.join(map(str, lcm_jars()))}"
    options = [beside, "-Djava.net.preferIPv4Stack=true", MEMORY, "-cp", str(jar)]
    os.execv(java, [java, *options, "lcm.spy.Spy", f"--lcm-url={url}"])


def lcm_jars() -> list[Path]:
    """Of the lcm package."""
    folder = Path(sysconfig.get_path("platlib")) / "share" / "java"
    return sorted(folder.glob("*.jar"))
