"""A declared model in the hands of a host, whatever the version of FMI: rules.py decides, this asks and tells.

Nothing here lets an exception into the host: the native layer would free what it still needs, and a host that is not
Python would abort.  What is wrong is remembered and said in one sentence, in the log and on standard error; do_step
then returns False and every calculated Real reads NaN.
"""

from __future__ import annotations

from typing import Any
from weakref import WeakSet

from . import call_sequence
from .codes import OK
from .pythonfmu_workarounds import signal_safe
from .saved_state import SavedStateAccess, attribute_tree
from .variable_declarations import VariableOwner, variables


def make_fmu_class(slave: type[FmuInstance], model: type[VariableOwner]) -> Any:
    """The class of slaves of a model class, under its name.

    A spare instance says what there is: CPython 3.11 reads the attributes of an object whose __dict__ has been
    looked at twice as slowly, so nobody looks at that of an instance which runs.
    """
    spare = model()
    about = {
        "Model": model,
        "variables": variables(spare),
        "attribute_tree": attribute_tree(spare),
        "__module__": __name__,
    }
    about["instances"] = WeakSet()
    made: Any = type(model.__name__, (slave,), about)
    made.plain_class = made  # an entry script may derive from it
    return made


class FmuInstance(SavedStateAccess):
    """One instance of the model `Model`.

    A base class after this one has `instance_name` and log(sentence, status).
    """

    Model: type  # of the subclass that hosting() makes

    @signal_safe
    def __init__(self, **kwargs: Any) -> None:
        try:
            self.initialize(**kwargs)
        except Exception:
            raise
        except BaseException as error:  # the layer that resets an instance needs the new one
            self.initialize(**kwargs)
            self.handle_exception(error)

    def initialize(self, **kwargs: Any) -> None:
        """As after instantiation."""
        super().__init__(**kwargs)
        self.instances.add(self)
        self.model = self.Model()
        self.run = call_sequence.RunState(self.model.tolerance)
        self.initialize_access()

    @signal_safe
    def exit_initialization_mode(self) -> None:
        try:
            status = call_sequence.exit_initialization(self.run, self.model)
            if status != OK:
                self.fail_with_status(status)
        except BaseException as error:  # an exception that left Python would crash the host
            self.handle_exception(error)

    @signal_safe
    def do_step(self, current_time: float, step_size: float) -> Any:
        try:
            run, model = self.run, self.model
            seen = run.outputs_current
            status = call_sequence.do_step(run, model, current_time, step_size)
            if status != OK:
                return self.fail_with_status(status, current_time, step_size)
            if seen:  # who has read the last point will read this one too, and this way is shorter
                call_sequence.set_outputs(run, model)
            return True
        except BaseException as error:  # as above
            return self.handle_exception(error)
