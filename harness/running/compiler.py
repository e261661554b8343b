"""What a host in C needs of this machine: a compiler, Python as a shared library, the headers of FMI."""

import shutil
import sysconfig
from pathlib import Path

import fmpy

COMPILER = shutil.which("cc") or shutil.which("gcc")
EMBEDDED = Path(sysconfig.get_config_var("LIBDIR") or "", sysconfig.get_config_var("INSTSONAME") or "none")
HEADERS = Path(fmpy.__file__).parent / "c-code"
