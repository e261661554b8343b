"""What depends on the version of FMI: all of it stands here."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime

from ..runtime.declare import Declaring
from .description import describe as describe2
from .description3 import describe as describe3


@dataclass(frozen=True)
class Edition:
    """One version of FMI, as an FMU speaks it through the native layer of a Python package."""

    layer: str  # the Python package that brings the native layer
    entry: str  # the script that this imports
    init: str  # what stands at the root of the package that travels
    slave: str  # the module beneath: where the runtime hears of FMI
    describe: Callable[[type[Declaring], str, str, datetime], bytes]
    icon: str  # where it belongs
    use: str  # what the page says of the ways to run it
    otherwise: str  # what to do for a platform that the layer does not know
    platforms: Mapping[str, str] = field(default_factory=dict)  # folder of binaries -> our name, where they differ


FMI2 = Edition(
    layer="pythonfmu",
    entry="""\
from {package} import {model}, lend

lend(globals())
""",
    init='''\
"""{name} as an FMI 2.0 co-simulation slave."""

from .{name} import {model} as Model
from .guard import lend
from .runtime.slave import slave_for

{model} = slave_for(Model)
''',
    slave="runtime/slave.py",
    describe=describe2,
    icon="model.png",
    use="",
    otherwise="add --native",
)

FMI3 = Edition(
    layer="pythonfmu3",
    # The native layer reads the name of the class in this very text, where it must stand on the line of its base.
    entry="""\
from {package} import {model} as Fmi3Slave
from {package} import leave_path


class {model}(Fmi3Slave):
    def __init__(self, resources, **more):
        super().__init__(resources=resources, **more)
        leave_path(resources)
""",
    init='''\
"""{name} for FMI 3.0: co-simulation and model exchange."""

from .{name} import {model} as Model
from .guard import leave_path
from .runtime.slave3 import slave_for

{model} = slave_for(Model)
''',
    slave="runtime/slave3.py",
    describe=describe3,
    icon="terminalsAndIcons/icon.png",
    use="""\
<p>In co-simulation neither start time, stop time nor tolerance reaches the FMU: the run begins where the first step
does, and <code>solver.rtol</code> sets the tolerance. In model exchange the importer's solver takes the place of ours,
and <code>solver.*</code> says nothing; where friction is dry, the mode changes at events, which the importer finds by
<code>events.to_rest</code> and <code>events.to_break_away</code>.</p>
""",
    otherwise="leave out --fmi 3 and add --native",
    platforms={"x86_64-linux": "linux64", "x86_64-windows": "win64"},
)
