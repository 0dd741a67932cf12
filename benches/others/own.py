"""Our own plants through the C interface, with their own converters."""

import ctypes
import time


class Snapshot(ctypes.Structure):
    _fields_ = [
        ("time_s", ctypes.c_double),
        ("theta_rad", ctypes.c_double * 2),
        ("theta_dot_rad_s", ctypes.c_double * 2),
        ("tip_t_m", ctypes.c_double),
        ("gap_m", ctypes.c_double),
        ("slip_velocity_m_s", ctypes.c_double),
        ("belt_speed_m_s", ctypes.c_double),
        ("normal_force_n", ctypes.c_double),
        ("tangential_force_n", ctypes.c_double),
        ("torque_nm", ctypes.c_double * 2),
        ("contact_mode", ctypes.c_uint8),
    ]


def version():
    return ""


class Plant:
    """A bench whose converters are the plant's."""

    def __init__(self, library, scenario):
        self.library = library
        self.plant = library.new("plant", scenario)
        self.is_lost = ctypes.c_bool()
        self.snapshot = Snapshot()
        self.cpu_s = 0.0

    def __del__(self):
        self.library.c.painleve_plant_free(self.plant)

    def sample(self, frame):
        self.library.call("painleve_plant_sample", self.plant, ctypes.byref(frame), ctypes.byref(self.is_lost))

    def advance(self, answer):
        start = time.process_time()
        self.library.call("painleve_plant_advance", self.plant, ctypes.byref(answer))
        self.cpu_s += time.process_time() - start
        self.library.call("painleve_plant_snapshot", self.plant, ctypes.byref(self.snapshot))

    def tip_t_m(self):
        return self.snapshot.tip_t_m

    def links_rad(self):
        return tuple(self.snapshot.theta_rad)

    def touches(self):
        return self.snapshot.contact_mode != 0


def bench(name, library, run, scenario, _make):
    return Plant(library, scenario(run, name.rsplit(" ", 1)[1]))
