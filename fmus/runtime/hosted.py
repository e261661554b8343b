"""A declared model in the hands of a host, whatever the version of FMI: rules.py decides, this asks and tells.

Nothing here lets an exception into the host: the native layer would free what it still needs, and a host that is not
Python would abort.  What is wrong is remembered and said in one sentence, in the log and on standard error; do_step
then returns False and every calculated Real reads NaN.
"""

from __future__ import annotations

from typing import Any
from weakref import WeakSet

from . import rules
from .boundary import guarded
from .codes import OK
from .declare import Declaring, variables
from .state import Saved, shape


def hosting(slave: type[Hosted], model: type[Declaring]) -> Any:
    """The class of slaves of a model class, under its name.

    A spare instance says what there is: CPython 3.11 reads the attributes of an object whose __dict__ has been
    looked at twice as slowly, so nobody looks at that of an instance which runs.
    """
    spare = model()
    about = {"Model": model, "variables": variables(spare), "shape": shape(spare), "__module__": __name__}
    about["living"] = WeakSet()
    made: Any = type(model.__name__, (slave,), about)
    made.bare = made  # an entry script may derive from it
    return made


class Hosted(Saved):
    """One instance of the model `Model`.

    A base class after this one has `instance_name` and log(sentence, status).
    """

    Model: type  # of the subclass that hosting() makes

    @guarded
    def __init__(self, **kwargs: Any) -> None:
        try:
            self.begin(**kwargs)
        except Exception:
            raise
        except BaseException as error:  # the layer that resets an instance needs the new one
            self.begin(**kwargs)
            self.rescue(error)

    def begin(self, **kwargs: Any) -> None:
        """As after instantiation."""
        super().__init__(**kwargs)
        self.living.add(self)
        self.model = self.Model()
        self.run = rules.Run(self.model.tolerance)
        self.give_access()

    @guarded
    def exit_initialization_mode(self) -> None:
        try:
            status = rules.begin(self.run, self.model)
            if status != OK:
                self.give_up(status)
        except BaseException as error:  # an exception that left Python would crash the host
            self.rescue(error)

    @guarded
    def do_step(self, current_time: float, step_size: float) -> Any:
        try:
            run, model = self.run, self.model
            seen = run.observed
            status = rules.step(run, model, current_time, step_size)
            if status != OK:
                return self.give_up(status, current_time, step_size)
            if seen:  # who has read the last point will read this one too, and this way is shorter
                rules.show(run, model)
            return True
        except BaseException as error:  # as above
            return self.rescue(error)
