"""Slave of a `--runtime python` FMU. It stands in the FMU's resources beside the kernel library and the model, needs
nothing but Python's standard library, and hands every call to the library's own FMI 2 face: one set of rules, the same
bits as the native FMU. GUID and LIBRARY are filled in at export."""

import ctypes
import os
import pathlib
import sys

from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

GUID = "@GUID@"
LIBRARY = "@LIBRARY@"
OK = 0
LOGGER = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


class Callbacks(ctypes.Structure):
    """fmi2CallbackFunctions; without memory functions the library takes its own."""

    _fields_ = [
        ("logger", LOGGER),
        ("allocate", ctypes.c_void_p),
        ("free", ctypes.c_void_p),
        ("step_finished", ctypes.c_void_p),
        ("environment", ctypes.c_void_p),
    ]


def load_library(resources):
    """The kernel library of this platform beside the model."""
    suffix = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
    library = ctypes.CDLL(os.path.join(resources, LIBRARY + suffix))
    library.fmi2Instantiate.restype = ctypes.c_void_p
    return library


class GearStage(Fmi2Slave):
    """One instance. A setter cannot report an error (it would be fatal): it is logged and makes the next step fail."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.instance = None
        self.refused = False
        self.library = load_library(self.resources)
        self.callbacks = Callbacks(logger=LOGGER(self._take_message))
        location = pathlib.Path(self.resources).resolve().as_uri()
        self.instance = self.library.fmi2Instantiate(
            self.instance_name.encode(), 1, GUID.encode(), location.encode(), ctypes.byref(self.callbacks), 0, 0
        )
        if not self.instance:
            raise RuntimeError("the kernel refused to make an instance: " + self._messages())

    def __del__(self):
        if getattr(self, "instance", None):
            self.library.fmi2FreeInstance(ctypes.c_void_p(self.instance))

    def setup_experiment(self, start_time, stop_time=None, tolerance=None):
        stop = ctypes.c_double(stop_time or 0.0)
        self._demand(
            "fmi2SetupExperiment", 0, ctypes.c_double(0), ctypes.c_double(start_time), int(stop_time is not None), stop
        )

    def enter_initialization_mode(self):
        self._demand("fmi2EnterInitializationMode")

    def exit_initialization_mode(self):
        self._demand("fmi2ExitInitializationMode")

    def terminate(self):
        self._call("fmi2Terminate")

    def do_step(self, current_time, step_size):
        try:
            done = self._call("fmi2DoStep", ctypes.c_double(current_time), ctypes.c_double(step_size), 1)
            return done == OK and not self.refused
        except Exception as error:
            self.log(f"do_step: {error}", Fmi2Status.error)
            return False

    def get_real(self, vrs):
        return self._get("fmi2GetReal", vrs, ctypes.c_double)

    def get_integer(self, vrs):
        return self._get("fmi2GetInteger", vrs, ctypes.c_int)

    def get_boolean(self, vrs):
        return [bool(value) for value in self._get("fmi2GetBoolean", vrs, ctypes.c_int)]

    def set_real(self, vrs, values):
        self._set("fmi2SetReal", vrs, values, ctypes.c_double)

    def set_integer(self, vrs, values):
        self._set("fmi2SetInteger", vrs, values, ctypes.c_int)

    def set_boolean(self, vrs, values):
        self._set("fmi2SetBoolean", vrs, [int(value) for value in values], ctypes.c_int)

    def _get_fmu_state(self):
        state, size = ctypes.c_void_p(), ctypes.c_size_t()
        self._demand("fmi2GetFMUstate", ctypes.byref(state))
        try:
            self._demand("fmi2SerializedFMUstateSize", state, ctypes.byref(size))
            image = ctypes.create_string_buffer(size.value)
            self._demand("fmi2SerializeFMUstate", state, image, size)
            return image.raw
        finally:
            self._call("fmi2FreeFMUstate", ctypes.byref(state))

    def _set_fmu_state(self, image):
        state = ctypes.c_void_p()
        self._demand("fmi2DeSerializeFMUstate", image, ctypes.c_size_t(len(image)), ctypes.byref(state))
        try:
            self._demand("fmi2SetFMUstate", state)
            self.refused = False
        finally:
            self._call("fmi2FreeFMUstate", ctypes.byref(state))

    @staticmethod
    def _fmu_state_to_bytes(image):
        return image

    @staticmethod
    def _fmu_state_from_bytes(image):
        return bytes(image)

    def _call(self, function, *arguments):
        return getattr(self.library, function)(ctypes.c_void_p(self.instance), *arguments)

    def _demand(self, function, *arguments):
        if self._call(function, *arguments) != OK:
            raise RuntimeError(f"{function} was refused: " + self._messages())

    def _get(self, function, vrs, kind):
        values = (kind * len(vrs))()
        self._demand(function, (ctypes.c_uint * len(vrs))(*vrs), ctypes.c_size_t(len(vrs)), values)
        return list(values)

    def _set(self, function, vrs, values, kind):
        arguments = (ctypes.c_uint * len(vrs))(*vrs), ctypes.c_size_t(len(vrs)), (kind * len(vrs))(*values)
        self.refused = self._call(function, *arguments) != OK or self.refused

    def _take_message(self, environment, name, status, category, message):
        self.log(
            message.decode("utf-8", "replace").replace("%%", "%"), Fmi2Status(status), (category or b"logAll").decode()
        )

    def _messages(self):
        return "; ".join(message.msg for message in self.log_queue)
