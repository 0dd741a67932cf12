"""Joins a painleve bus as its controller, as described in docs/interface.md. Needs iceoryx2 0.9.x (PyPI)."""

import fcntl
import os
import struct
import time
from ctypes import Structure, c_int32, c_uint8, c_uint16, c_uint32
from pathlib import Path

import iceoryx2 as iox2

CONFIGURATION_CAPACITY = 2048
BEGIN, END = 1, 2
SILENCE_LIMIT_S = 1.5


class SensorFrame(Structure):
    _fields_ = [("tick", c_uint32), ("sequence", c_uint32), ("joints", c_uint32 * 2),
                ("normal_force", c_int32), ("tangential_force", c_int32), ("inputs", c_uint32)]

    @staticmethod
    def type_name():
        return "painleve::SensorFrame"


class ActuatorFrame(Structure):
    _fields_ = [("tick", c_uint32), ("sequence", c_uint32), ("torques", c_int32 * 2),
                ("reference_tip_um", c_int32), ("estimated_tip_um", c_int32),
                ("state", c_uint8), ("fault", c_uint8), ("flags", c_uint16)]

    @staticmethod
    def type_name():
        return "painleve::ActuatorFrame"


class SessionMessage(Structure):
    _fields_ = [("kind", c_uint32), ("tick_hz", c_uint32), ("pacing", c_uint32), ("length", c_uint32),
                ("configuration", c_uint8 * CONFIGURATION_CAPACITY)]

    @staticmethod
    def type_name():
        return "painleve::SessionMessage"


def place():
    """Returns the folder of this user's buses."""
    user = os.getuid()
    for folder in (os.environ.get("XDG_RUNTIME_DIR"), f"/run/user/{user}"):
        if folder and os.path.isabs(folder) and os.path.isdir(folder):
            status = os.stat(folder)
            if status.st_uid == user and status.st_mode & 0o022 == 0:
                return Path(folder) / "painleve"
    return Path(f"/tmp/painleve-{user}")


FLOCK = "hhqqi4x"


def lock(file, byte):
    """Locks one byte of a file until the process ends, however it ends."""
    fcntl.fcntl(file, fcntl.F_OFD_SETLK, struct.pack(FLOCK, fcntl.F_WRLCK, os.SEEK_SET, byte, 1, 0))


def is_locked(path, byte):
    """Returns whether a living process has locked one byte of a file."""
    try:
        with open(path, "r+b", buffering=0) as file:
            answer = fcntl.fcntl(file, fcntl.F_OFD_GETLK, struct.pack(FLOCK, fcntl.F_WRLCK, os.SEEK_SET, byte, 1, 0))
    except FileNotFoundError:
        return False
    return struct.unpack(FLOCK, answer)[0] != fcntl.F_UNLCK


class Bus:
    """The controller's end of a bus. Iterate over it for sensor frames; `send` answers them."""

    PLANT, CONTROLLER = 1, 2

    def __init__(self, name, controller, wait_s=10.0):
        """Joins the plant on bus `name`; `controller` is its name in the plant's report."""
        folder, end = place() / name, time.monotonic() + wait_s
        while (run := self._ready_run(folder)) is None:
            if time.monotonic() > end:
                raise TimeoutError(f"no plant waits on bus {name}: painleve plant --bus {name} --wait-s 60")
            time.sleep(0.01)
        self._lock_file = open(folder / "lock", "r+b", buffering=0)
        lock(self._lock_file, self.CONTROLLER)
        os.close(os.open(run / "joined", os.O_WRONLY | os.O_CREAT | os.O_EXCL))
        prefix = f"painleve_{os.getuid()}_{run.name}_"
        self._memory_lock = open(f"/dev/shm/{prefix}lock", "r+b", buffering=0)
        lock(self._memory_lock, self.CONTROLLER)

        iox2.set_log_level(iox2.LogLevel.Fatal)
        config = iox2.config.default()
        settings = config.global_cfg
        settings.prefix = iox2.FileName.new(prefix)
        settings.root_path = iox2.Path.new(str(run))
        settings.node.cleanup_dead_nodes_on_creation = False
        settings.node.cleanup_dead_nodes_on_destruction = False
        settings.service.cleanup_dead_nodes_on_open = False
        builder = iox2.NodeBuilder.new().config(config).signal_handling_mode(iox2.SignalHandlingMode.Disabled)
        self._node = builder.create(iox2.ServiceType.Ipc)

        def service(kind, payload):
            path = iox2.ServiceName.new(f"painleve/{name}/{kind}")
            return self._node.service_builder(path).publish_subscribe(payload).open()

        self._session = service("session", SessionMessage).subscriber_builder().create()
        self._sensor = service("sensor", SensorFrame).subscriber_builder().create()
        self._actuator = service("actuator", ActuatorFrame).publisher_builder().create()
        begin = self._wait(self._session)
        if begin.kind != BEGIN:
            raise ConnectionError("the plant has left")
        self.tick_hz = begin.tick_hz
        (run / "answering.new").write_text(controller)
        (run / "answering.new").rename(run / "answering")

    @classmethod
    def _ready_run(cls, folder):
        # A plant that was killed leaves its run as it was.
        runs = folder.iterdir() if is_locked(folder / "lock", cls.PLANT) else ()
        waiting = (run for run in runs if (run / "ready").exists() and not (run / "joined").exists())
        return next(waiting, None)

    def _wait(self, subscriber):
        """Returns the next message; spins, because the plant of a lockstep run waits for the answer."""
        start = time.monotonic()
        while (sample := subscriber.receive()) is None:
            if subscriber is self._sensor and (message := self._session.receive()) is not None:
                if message.payload().contents.kind == END:
                    return None
            if time.monotonic() - start > SILENCE_LIMIT_S:
                raise ConnectionError("the plant is silent")
        return type(sample.payload().contents).from_buffer_copy(sample.payload().contents)

    def __iter__(self):
        while (frame := self._wait(self._sensor)) is not None:
            yield frame

    def send(self, frame):
        """Answers a sensor frame; `frame.tick` is that of the sensor frame."""
        self._actuator.send_copy(frame)
