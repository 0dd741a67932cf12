"""Calls of the FMU in every state and with every kind of bad argument, as a careless simulator makes them.

A call is allowed in the states that the standard names; elsewhere, or with a bad argument, it returns `fmi3Error`, says
why in the simulator's log, and leaves the instance Terminated: its values can be read, and a reset begins anew.
"""

import ctypes
import math
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_int32, c_size_t, c_uint32, c_void_p

OK, ERROR = 0, 3
LOG = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
ENVIRONMENT = 0x1234
NAN, INF = math.nan, math.inf

ARGUMENTS = {
    "fmi3InstantiateCoSimulation": [c_char_p] * 3 + [c_bool] * 4 + [c_void_p, c_size_t, c_void_p, LOG, c_void_p],
    "fmi3FreeInstance": [c_void_p],
    "fmi3SetDebugLogging": [c_void_p, c_bool, c_size_t, c_void_p],
    "fmi3EnterInitializationMode": [c_void_p, c_bool, c_double, c_double, c_bool, c_double],
    "fmi3ExitInitializationMode": [c_void_p],
    "fmi3Terminate": [c_void_p],
    "fmi3Reset": [c_void_p],
    "fmi3DoStep": [c_void_p, c_double, c_double, c_bool] + [c_void_p] * 4,
}
VALUES = ["Float32", "Float64", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Boolean", "String"]
for kind in VALUES:
    for way in ("Get", "Set"):
        ARGUMENTS[f"fmi3{way}{kind}"] = [c_void_p, c_void_p, c_size_t, c_void_p, c_size_t]

# What this FMU cannot do.
REFUSED = """EnterConfigurationMode ExitConfigurationMode EnterEventMode EnterStepMode EvaluateDiscreteStates
    UpdateDiscreteStates GetBinary SetBinary GetClock SetClock GetIntervalDecimal SetIntervalDecimal GetIntervalFraction
    SetIntervalFraction GetShiftDecimal SetShiftDecimal GetShiftFraction SetShiftFraction GetFMUState SetFMUState
    FreeFMUState SerializedFMUStateSize SerializeFMUState DeserializeFMUState GetNumberOfVariableDependencies
    GetVariableDependencies GetDirectionalDerivative GetAdjointDerivative GetOutputDerivatives EnterContinuousTimeMode
    CompletedIntegratorStep SetTime SetContinuousStates GetContinuousStates GetContinuousStateDerivatives
    GetNumberOfContinuousStates GetNominalsOfContinuousStates GetNumberOfEventIndicators GetEventIndicators
    ActivateModelPartition""".split()

STATES = ["Instantiated", "InitializationMode", "StepMode", "Terminated"]
SETTABLE = {"parameter": STATES[:2], "input": STATES[:3], "output": [], "independent": []}
TYPES = {"Float64": c_double, "Int32": c_int32, "String": c_char_p}


class Fmu:
    """The library of an FMU, and the messages of its instances."""

    def __init__(self, folder, description):
        platform = next((folder / "binaries").iterdir())
        self.library = ctypes.CDLL(str(next(platform.iterdir())))
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.token = description.guid.encode()
        self.messages = []
        self.log = LOG(self._log)
        for name, arguments in ARGUMENTS.items():
            getattr(self.library, name).argtypes = arguments
        for name in REFUSED:
            getattr(self.library, "fmi3" + name).argtypes = [c_void_p]
        self.library.fmi3InstantiateCoSimulation.restype = c_void_p
        self.library.fmi3FreeInstance.restype = None

    def _log(self, environment, status, category, message):
        assert (environment, status) == (ENVIRONMENT, ERROR)
        self.messages.append(message.decode())

    def instantiate(self, name=b"arm", token=None, event_mode=False, intermediate=0):
        token = self.token if token is None else token
        arguments = name, token or None, None, False, True, event_mode, False, None, intermediate, ENVIRONMENT, self.log, None
        return self.library.fmi3InstantiateCoSimulation(*arguments)

    def call(self, instance, name, *arguments):
        return getattr(self.library, "fmi3" + name)(instance, *arguments)

    def refused(self, part, instance, name, *arguments):
        """The call is refused with a message that names the call and contains `part`."""
        self.messages.clear()
        status = self.call(instance, name, *arguments)
        [message] = self.messages or [None]
        assert status == ERROR and f"arm: fmi3{name}: " in message and part in message, (name, arguments, status, message)

    def enter(self, instance, start_s=0.0, stop_s=None):
        has_stop = stop_s is not None
        return self.call(instance, "EnterInitializationMode", False, 0.0, start_s, has_stop, stop_s if has_stop else 0.0)

    def step(self, instance, point_s, step_s):
        """The status of a step and the time after it."""
        flags, time_s = [c_bool(True) for _ in range(3)], c_double(NAN)
        status = self.call(instance, "DoStep", point_s, step_s, True, *map(byref, flags), byref(time_s))
        return status, time_s.value

    def get(self, instance, name):
        variable = self.variables[name]
        value, reference = TYPES[variable.type](), c_uint32(variable.valueReference)
        status = self.call(instance, "Get" + variable.type, byref(reference), 1, byref(value), 1)
        return status, value.value

    def set(self, instance, name, value):
        variable = self.variables[name]
        value, reference = TYPES[variable.type](value), c_uint32(variable.valueReference)
        return self.call(instance, "Set" + variable.type, byref(reference), 1, byref(value), 1)

    def in_state(self, state, **parameters):
        """A new instance that is in this state."""
        instance = self.instantiate()
        assert instance
        for name, value in parameters.items():
            assert self.set(instance, name.replace("__", "."), value) == OK
        if state != "Instantiated":
            assert self.enter(instance) == OK
        if state in ("StepMode", "Terminated"):
            assert self.call(instance, "ExitInitializationMode") == OK
        if state == "Terminated":
            assert self.call(instance, "Terminate") == OK
        return instance


def check_states(fmu):
    """Every call in every state."""
    flag, time_s = c_bool(), c_double()
    calls = {
        "SetDebugLogging": (STATES, (True, 0, None)),
        "EnterInitializationMode": (["Instantiated"], (False, 0.0, 0.0, False, 0.0)),
        "ExitInitializationMode": (["InitializationMode"], ()),
        "DoStep": (["StepMode"], (0.0, 0.001, True, byref(flag), byref(flag), byref(flag), byref(time_s))),
        "Terminate": (["StepMode"], ()),
        "Reset": (STATES, ()),
        **{"Get" + kind: (STATES, (None, 0, None, 0)) for kind in VALUES},
        **{"Set" + kind: (STATES[:3], (None, 0, None, 0)) for kind in VALUES},
        **{name: ([], ()) for name in REFUSED},
    }
    for name, (allowed, arguments) in calls.items():
        for state in STATES:
            instance = fmu.in_state(state)
            if state in allowed:
                assert fmu.call(instance, name, *arguments) == OK, (name, state, fmu.messages)
            else:
                fmu.refused(f"is not allowed in the state {state}", instance, name, *arguments)
                # As after every error: Terminated, readable, and new after a reset.
                fmu.refused("in the state Terminated", instance, "Terminate")
                assert fmu.get(instance, "theta1_rad")[0] == OK
                assert fmu.call(instance, "Reset") == OK
                assert fmu.enter(instance) == OK and fmu.call(instance, "ExitInitializationMode") == OK
                assert fmu.step(instance, 0.0, 0.5) == (OK, 0.5)
            fmu.library.fmi3FreeInstance(instance)
    for name in [name.removeprefix("fmi3") for name in ARGUMENTS if "Instance" not in name and "Instantiate" not in name]:
        assert fmu.call(None, name, *calls[name][1]) == ERROR
    fmu.library.fmi3FreeInstance(None)
    print(f"{len(calls)} calls in {len(STATES)} states: allowed exactly where the standard allows them")


def check_variables(fmu):
    """Every variable in every state, and bad arrays."""
    for variable in fmu.variables.values():
        value = b"" if variable.type == "String" else 1
        for state in STATES:
            instance = fmu.in_state(state)
            assert fmu.get(instance, variable.name)[0] == OK, (variable.name, state, fmu.messages)
            settable = state in SETTABLE[variable.causality]
            assert fmu.set(instance, variable.name, value) == (OK if settable else ERROR), (variable.name, state)
            fmu.library.fmi3FreeInstance(instance)
    value, reference = (c_double * 2)(), (c_uint32 * 2)(7, 8)
    for way in ("Get", "Set"):
        for part, kind, arguments in [
            ("2 value references, but 1 values", "Float64", (reference, 2, value, 1)),
            ("1 value references, but 2 values", "Float64", (reference, 1, value, 2)),
            ("null or not aligned", "Float64", (None, 1, value, 1)),
            ("null or not aligned", "Float64", (reference, 1, None, 1)),
            ("null or not aligned", "String", (byref(c_uint32(1)), 1, None, 1)),
            ("null or not aligned", "Float64", (reference, 1, ctypes.addressof(value) + 1, 1)),
            ("value reference 99", "Float64", (byref(c_uint32(99)), 1, value, 1)),
            ("value reference 4294967295", "Float64", (byref(c_uint32(2**32 - 1)), 1, value, 1)),
            ("value reference 7", "Float32", (reference, 1, value, 1)),
            ("value reference 7", "String", (reference, 1, (c_char_p * 1)(b""), 1)),
            ("value reference 0", "Int32", (byref(c_uint32(0)), 1, value, 1)),
            ("value reference 0", "String", (byref(c_uint32(0)), 1, (c_char_p * 1)(b""), 1)),
        ]:
            instance = fmu.in_state("Instantiated")
            fmu.refused(part, instance, way + kind, *arguments)
            fmu.library.fmi3FreeInstance(instance)
    # A call that is refused for its last variable has not set the others.
    friction = fmu.variables["belt.friction"].valueReference
    for bad in (99, 0, fmu.variables["settings"].valueReference, fmu.variables["theta1_rad"].valueReference):
        instance = fmu.in_state("Instantiated")
        before = fmu.get(instance, "belt.friction")
        references, values = (c_uint32 * 2)(friction, bad), (c_double * 2)(0.25, 0.25)
        fmu.refused(f"value reference {bad}", instance, "SetFloat64", references, 2, values, 2)
        assert fmu.get(instance, "belt.friction") == before
        fmu.library.fmi3FreeInstance(instance)
    settings = fmu.variables["settings"].valueReference
    instance = fmu.in_state("Instantiated")
    texts = (c_char_p * 2)(b"arm.tip_mass_kg=0.001", None)
    fmu.refused("a text is null", instance, "SetString", (c_uint32 * 2)(settings, settings), 2, texts, 2)
    assert fmu.get(instance, "settings") == (OK, b"")
    fmu.library.fmi3FreeInstance(instance)
    for part, value in [("a text is null", None), ("a text is not UTF-8", b"\xff")]:
        instance = fmu.in_state("Instantiated")
        fmu.refused(part, instance, "SetString", byref(c_uint32(1)), 1, (c_char_p * 1)(value), 1)
        fmu.library.fmi3FreeInstance(instance)
    print(f"{len(fmu.variables)} variables can be set exactly where the standard allows it")


def check_instantiation(fmu):
    for part, arguments in [
        ("instanceName is null", {"name": None}),
        ("instanceName is empty", {"name": b" "}),
        ("instanceName is not UTF-8", {"name": b"\xff"}),
        ("instantiationToken is null", {"token": b""}),
        ("instantiationToken 'other'", {"token": b"other"}),
        ("no event mode", {"event_mode": True}),
        ("requiredIntermediateVariables", {"intermediate": 1}),
    ]:
        fmu.messages.clear()
        assert fmu.instantiate(**arguments) is None
        assert part in fmu.messages[0], fmu.messages
    for name in ("fmi3InstantiateModelExchange", "fmi3InstantiateScheduledExecution"):
        getattr(fmu.library, name).restype = c_void_p
        assert getattr(fmu.library, name)() is None


def check_initialization(fmu):
    for part, arguments in [
        ("startTime = NaN", (False, 0.0, NAN, False, 0.0)),
        ("startTime = inf", (False, 0.0, INF, False, 0.0)),
        ("stopTime = NaN", (False, 0.0, 0.0, True, NAN)),
        ("stopTime = inf", (False, 0.0, 0.0, True, INF)),
        ("stopTime = 1 is not after startTime = 1", (False, 0.0, 1.0, True, 1.0)),
        ("tolerance = NaN", (True, NAN, 0.0, False, 0.0)),
        ("tolerance = -1", (True, -1.0, 0.0, False, 0.0)),
        ("tolerance = 0", (True, 0.0, 0.0, False, 0.0)),
    ]:
        instance = fmu.in_state("Instantiated")
        fmu.refused(part, instance, "EnterInitializationMode", *arguments)
        fmu.library.fmi3FreeInstance(instance)
    for part, name, value in [
        ("belt.friction = -1", "belt.friction", -1.0),
        ("belt.friction = NaN", "belt.friction", NAN),
        ("impact.restitution = 2", "impact.restitution", 2.0),
        ("belt.profile.speed_m_s = inf", "belt.speed_m_s", INF),
        ("initial.theta1_deg = NaN", "initial.theta1_deg", NAN),
        ("u1_nm = NaN", "u1_nm", NAN),
        ("did you mean 'tip_mass_kg'", "settings", b"arm.tip_mas_kg=0.1"),
        ("belt.friction is decided by the parameter belt.friction", "settings", b"arm.tip_mass_kg=0.001\nbelt.friction = 0.5"),
        ("belt.profile.speed_m_s is decided by the parameter belt.speed_m_s", "settings", b"belt.profile.speed_m_s=-0.5"),
        ("impact.restitution is decided by", "settings", b"impact={ restitution = 0.2 }"),
        ("initial.theta2_deg is decided by", "settings", b"initial.theta2_deg=18"),
        ("initial.theta1_deg is decided by", "settings", b"initial={ theta1_deg = 3.0, theta2_deg = 4.0 }"),
        ("initial.tip_m = 0.5 is outside the allowed range", "settings", b"initial.tip_m=0.5"),
        ("run.seed has no effect here; set keys of arm, belt, contact,", "settings", b"arm.tip_mass_kg=0.001\nrun.seed=3"),
        ("controller.governor.enabled has no effect here", "settings", b"controller.governor.enabled=false"),
        ("converters.force.noise_n has no effect here", "settings", b"converters.force.noise_n=0.1"),
        ("knowledge.tip_m has no effect here", "settings", b"knowledge.tip_m=0.001"),
        ("did you mean 'seed'", "settings", b"run.sed=3"),
        ("initial.elbow: initial.tip_m is missing", "settings", b"initial.elbow=up"),
    ]:
        instance = fmu.in_state("Instantiated")
        assert fmu.set(instance, name, value) == OK and fmu.enter(instance) == OK
        fmu.refused(part, instance, "ExitInitializationMode")
        assert "--set" not in fmu.messages[0]
        fmu.library.fmi3FreeInstance(instance)


def check_start(fmu):
    """The first outputs are those of a plant that has decided its contact, under the torques set before."""
    names = ("normal_force_n", "contact_mode", "theta1_dot_rad_s")
    starts = {}
    for torque_nm in (0.0, 2.0, -2.0):
        for state in STATES[:3]:
            instance = fmu.in_state(state, u1_nm=torque_nm)
            start = [fmu.get(instance, name) for name in names]
            [force_n, mode, _] = [value for status, value in start if status == OK]
            assert force_n >= 0.0 and (force_n > 0.0) == (mode != 0), (torque_nm, state, start)
            assert starts.setdefault(torque_nm, start) == start, (torque_nm, state)
            fmu.library.fmi3FreeInstance(instance)
    # The tip is placed instead of the angles, unless these are given as well.
    for settings, tip_m, is_up in [
        (b"initial.tip_m=0.05", 0.05, False),
        (b"initial.tip_m=-0.1\ninitial.elbow=up", -0.1, True),
        (b"initial={ tip_m = 0.02, elbow = 'up' }", 0.02, True),
        (b"arm.height_m=0.39\ninitial.tip_m=0.05", 0.05, False),
    ]:
        instance = fmu.in_state("StepMode", settings=settings)
        start = {name: fmu.get(instance, name)[1] for name in ("tip_t_m", "gap_m", "theta1_rad", "theta2_rad")}
        assert abs(start["tip_t_m"] - tip_m) < 1e-9 and abs(start["gap_m"]) < 1e-9, (settings, start)
        assert (start["theta2_rad"] > start["theta1_rad"]) == is_up, (settings, start)
        fmu.library.fmi3FreeInstance(instance)
    for name in ("initial.theta1_deg", "initial.theta2_deg"):
        instance = fmu.in_state("Instantiated", settings=b"initial.tip_m=0.05")
        assert fmu.set(instance, name, 20.0) == OK and fmu.enter(instance) == OK
        fmu.refused(f"{name} = 20 has no effect here: initial.tip_m in settings decides", instance, "ExitInitializationMode")
        fmu.library.fmi3FreeInstance(instance)
    # One torque lifts the tip, the other presses it on the belt, which throws it off.
    assert starts[2.0] != starts[-2.0], "torques set before the start change nothing"


def check_steps(fmu):
    """Bad steps are refused, change nothing, and end the run."""
    bad = [
        ("communicationStepSize = -0.05", 0.1, -0.05),
        ("communicationStepSize = 0", 0.1, 0.0),
        ("communicationStepSize = NaN", 0.1, NAN),
        ("communicationStepSize = inf", 0.1, INF),
        ("at most 3600 s", 0.1, 3600.1),
        ("at most 3600 s", 0.1, 1e300),
        ("is lost in 0.1 s", 0.1, 1e-18),
        ("currentCommunicationPoint = 0: the plant is at 0.1 s", 0.0, 0.05),
        ("currentCommunicationPoint = 5: the plant is at 0.1 s", 5.0, 0.1),
        ("currentCommunicationPoint = 0.100001", 0.100001, 0.1),
        ("currentCommunicationPoint = NaN", NAN, 0.1),
        ("currentCommunicationPoint = inf", INF, 0.1),
        ("currentCommunicationPoint = -inf", -INF, 0.1),
        ("after stopTime = 1", 0.1, 0.91),
    ]
    flag, time_s = c_bool(), c_double()
    for part, point_s, step_s in bad:
        instance = fmu.in_state("Instantiated")
        assert fmu.enter(instance, stop_s=1.0) == OK and fmu.call(instance, "ExitInitializationMode") == OK
        assert fmu.step(instance, 0.0, 0.1) == (OK, 0.1)
        before = fmu.get(instance, "theta1_rad")
        fmu.refused(part, instance, "DoStep", point_s, step_s, True, byref(flag), byref(flag), byref(flag), byref(time_s))
        assert time_s.value == 0.1 and fmu.get(instance, "theta1_rad") == before and fmu.get(instance, "time") == (OK, 0.1)
        assert fmu.step(instance, 0.1, 0.1)[0] == ERROR
        fmu.library.fmi3FreeInstance(instance)
    for name in ("u1_nm", "u2_nm"):
        for value in (NAN, INF):
            instance = fmu.in_state("StepMode")
            assert fmu.set(instance, name, value) == OK
            fmu.refused("torques are finite", instance, "DoStep", 0.0, 0.1, True, None, None, None, None)
            fmu.library.fmi3FreeInstance(instance)
    # The end may be off by rounding, and results need not be asked for.
    instance = fmu.in_state("Instantiated")
    assert fmu.enter(instance, 1e3, 1e3 + 0.3) == OK and fmu.call(instance, "ExitInitializationMode") == OK
    for tick in range(3):
        assert fmu.call(instance, "DoStep", 1e3 + tick * 0.1, 0.1 + 1e-12, True, None, None, None, None) == OK
    fmu.library.fmi3FreeInstance(instance)
    # However late it is, no step is skipped and none goes beyond the end.
    late_s, step_s = 1.7e9, 1.0 / 1024.0
    for part, skipped in [("currentCommunicationPoint", 2), ("after stopTime", 1)]:
        instance = fmu.in_state("Instantiated")
        assert fmu.enter(instance, late_s, late_s + 1.5 * step_s) == OK and fmu.call(instance, "ExitInitializationMode") == OK
        assert fmu.step(instance, late_s, step_s)[0] == OK
        fmu.refused(part, instance, "DoStep", late_s + skipped * step_s, step_s, True, None, None, None, None)
        fmu.library.fmi3FreeInstance(instance)
    print(f"{len(bad)} bad steps are refused")


def check_reset(fmu):
    """Nothing outlives a reset: neither parameters nor inputs nor the plant, in whatever state."""

    def run(instance):
        values = [fmu.get(instance, name) for name in fmu.variables if fmu.variables[name].type != "String"]
        assert fmu.enter(instance) == OK
        values += [fmu.get(instance, name) for name in ("theta1_rad", "u1_nm", "time")]
        assert fmu.set(instance, "initial.theta1_deg", 33.0) == OK
        values += [fmu.get(instance, "theta1_rad")]
        assert abs(values[-1][1] - math.radians(33.0)) < 1e-9, "the start is that of another plant"
        assert fmu.call(instance, "ExitInitializationMode") == OK and fmu.step(instance, 0.0, 0.1) == (OK, 0.1)
        return values + [fmu.get(instance, name) for name in fmu.variables]

    fresh = fmu.in_state("Instantiated")
    expected = run(fresh)
    for state in STATES:
        for steps in (0, 1):
            instance = fmu.in_state(state, belt__friction=0.5, initial__theta2_deg=19.0, u1_nm=0.3, settings=b"arm.tip_mass_kg=0.001")
            if state == "StepMode" and steps:
                assert fmu.step(instance, 0.0, 0.1) == (OK, 0.1)
            assert fmu.call(instance, "Reset") == OK
            assert run(instance) == expected, state
            fmu.library.fmi3FreeInstance(instance)
    # Instances do not share anything.
    others = [fmu.in_state("StepMode", belt__speed_m_s=speed) for speed in (-0.5, -0.1)]
    for point in range(10):
        for instance in others:
            assert fmu.step(instance, point * 0.1, 0.1)[0] == OK
    alone = fmu.in_state("StepMode", belt__speed_m_s=-0.5)
    for point in range(10):
        assert fmu.step(alone, point * 0.1, 0.1)[0] == OK
    assert fmu.get(others[0], "theta1_rad") == fmu.get(alone, "theta1_rad") != fmu.get(others[1], "theta1_rad")
    for instance in (fresh, alone, *others):
        fmu.library.fmi3FreeInstance(instance)


def check(folder, description):
    fmu = Fmu(folder, description)
    for part in (check_instantiation, check_states, check_variables, check_initialization, check_start, check_steps, check_reset):
        part(fmu)
