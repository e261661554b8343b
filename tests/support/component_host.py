"""A host of WebAssembly components (FMI-LS-WASM), by wasmtime."""

from wasmtime import Engine, Store
from wasmtime.component import Component, Linker, Record, Variant

CO_SIMULATION, MODEL_EXCHANGE = "co-simulation", "model-exchange"


class RefusedError(Exception):
    """A call returned a status other than ok."""


class ComponentHost:
    """A component in a store with a limit of its memory in bytes. `messages` has the arguments of the log."""

    def __init__(self, component, memory_size):
        self.messages = []
        engine = Engine()
        self.component = Component(engine, component)
        linker = Linker(engine)
        with linker.root() as root, root.add_instance("fmi:fmi3/callbacks@3.0.0") as callbacks:
            callbacks.add_func("log-message", lambda store, *words: self.messages.append(words))
        self.store = Store(engine)
        self.store.set_limits(memory_size=memory_size)
        self.instance = linker.instantiate(self.store, self.component)
        self.imports = set(self.component.type.imports(engine))

    def function(self, interface, name):
        """Return a function of an interface."""
        index = self.instance.get_export_index(self.store, f"fmi:fmi3/{interface}@3.0.0")
        found = self.instance.get_func(self.store, self.instance.get_export_index(self.store, name, index))
        return lambda *arguments: found(self.store, *arguments)

    def instantiate(self, interface, token, *options, name="test"):
        """Return an FMU, or None if it refuses; `options` are Booleans and lists behind the flag of logging."""
        create = self.function(interface, f"[static]{interface}-instance.instantiate-{interface}")
        handle = create(name, token, "", False, True, *options)
        return handle and ComponentFmu(self, interface, handle)


class ComponentFmu:
    """An instance; its methods have the names of the draft with underscores."""

    def __init__(self, host, interface, handle):
        self._host, self._interface, self._handle, self._functions = host, interface, handle, {}

    def __getattr__(self, name):
        method = self._functions.get(name)
        if method is None:
            full_name = f"[method]{self._interface}-instance.{name.replace('_', '-')}"
            method = self._functions[name] = self._host.function(self._interface, full_name)

        def call(*arguments):
            result = method(self._handle, *arguments)
            if isinstance(result, Variant):
                result = result.payload if result.tag == "ok" else raise_status(result.payload)
            if isinstance(result, str):
                return None if result == "ok" else raise_status(result)
            return vars(result) if isinstance(result, Record) else result

        return call

    def free(self):
        """Drop the handle, which frees the instance."""
        self._handle.drop(self._host.store)


def raise_status(status):
    """Raise RefusedError."""
    raise RefusedError(status)
