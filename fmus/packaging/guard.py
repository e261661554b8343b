"""What keeps the native layer of pythonfmu from freeing twice; this file travels inside every FMU.

Both seen with pythonfmu 0.7.0, the first in reference counts, the second with valgrind:

1. Every instance releases one reference to the names of the entry script, which was only lent.  A script without
   functions of its own loses its names under the second instance.  So each run of the script keeps one more.
2. At the end of the process the library releases its state in a static destructor, then again through the pointer
   left over, which now and then ends in "corrupted double-linked list".  `finalizePythonInterpreter` clears the
   pointer; called while Python still runs it makes the later releases find nothing.
"""

import atexit
import os
import sys
from contextlib import suppress
from ctypes import PyDLL
from glob import escape, glob

lent = []
watched = set()


def hold(names):
    """Called by the entry script, with its names, whenever the native layer runs it for a new instance."""
    lent.append(names)
    resources = sys.path[0]  # put there by the native layer just before
    if sys.platform == "linux" and resources not in watched:
        watched.add(resources)
        for path in glob(os.path.join(escape(resources), "../binaries/linux64/*.so")):
            with suppress(OSError, AttributeError):  # a host that loaded a copy of the file: out of reach
                atexit.register(PyDLL(path, os.RTLD_NOLOAD | os.RTLD_LAZY).finalizePythonInterpreter)
