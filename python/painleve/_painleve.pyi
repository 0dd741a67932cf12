"""The compiled part of the package."""

from os import PathLike
from typing import Any, TypedDict

class State(TypedDict, total=False):
    """The plant at one time; a number that is unknown is absent."""

    time_s: float
    """Simulated time, s."""
    theta1_rad: float
    """Angle of the first link from the belt's inward normal, rad."""
    theta2_rad: float
    """Angle of the second link, rad."""
    theta1_dot_rad_s: float
    """Rate of the first angle, rad/s."""
    theta2_dot_rad_s: float
    """Rate of the second angle, rad/s."""
    tip_t_m: float
    """Position of the tip along the belt, m."""
    reference_tip_t_m: float
    """Reference that the controller follows, m."""
    gap_m: float
    """Height of the tip over the belt, m."""
    slip_velocity_m_s: float
    """Velocity of the tip relative to the belt, m/s."""
    belt_speed_m_s: float
    """Velocity of the belt, m/s."""
    normal_force_n: float
    """Normal force on the tip, N."""
    tangential_force_n: float
    """Tangential force on the tip, N."""
    b_m_s2: float
    """Free normal acceleration b, m/s²."""
    p_per_kg: float
    """Contact coefficient p, 1/kg."""
    u1_nm: float
    """Torque on the first joint, N·m."""
    u2_nm: float
    """Torque on the second joint, N·m."""
    mode: str
    """Contact mode: flight, slide-positive, slide-negative or stick."""
    mode_number: int
    """Contact mode as a number, in this order from 0."""

class Telemetry(TypedDict, total=False):
    """The controller's estimates; a number that is unknown is absent."""

    theta1_rad: float
    """Estimated angle of the first link, rad."""
    theta2_rad: float
    """Estimated angle of the second link, rad."""
    theta1_dot_rad_s: float
    """Estimated rate of the first angle, rad/s."""
    theta2_dot_rad_s: float
    """Estimated rate of the second angle, rad/s."""
    tip_t_m: float
    """Estimated position of the tip along the belt, m."""
    reference_m: float
    """Reference after the edge governor, m."""
    requested_m: float
    """Reference before it, m."""
    normal_force_n: float
    """Measured normal force, N."""
    tangential_force_n: float
    """Measured tangential force, N."""
    u1_nm: float
    """Torque on the first joint as output, N·m."""
    u2_nm: float
    """Torque on the second joint as output, N·m."""
    contact: bool
    """Whether the tip touches the belt, as the controller decides."""
    contact_confidence: float
    """Certainty of that decision, 0 to 1."""
    friction: float
    """Estimated friction coefficient."""
    friction_deviation: float
    """Its standard deviation."""
    slip_sign: int
    """Direction of slip, 1 or -1."""
    sticks: bool
    """Whether the tip is estimated to stick to the belt."""
    lower_edge_m: float
    """Lower edge of the admissible stretch of the belt, m."""
    upper_edge_m: float
    """Upper edge, m."""
    at_edge: bool
    """Whether an edge holds the reference back."""
    recovering: bool
    """Whether the tip is being returned to the belt."""
    saturated: bool
    """Whether the torque was limited."""
    saturated_ticks: int
    """Ticks since the start with limited torque."""

__version__: str

# The name of a built-in one, a path that ends in `.toml`, an object with a path, or TOML text.
Scenario = str | PathLike[str]
Overrides = dict[str, Any]
Sensor = tuple[int, int, int, int, int, int, int]
Actuator = tuple[int, int, int, int, int, int, int, int, int]

class Plant:
    def __init__(self, scenario: Scenario = "hybrid-elbow-down", overrides: Overrides | None = None) -> None: ...
    @property
    def tick_hz(self) -> int: ...
    def step(self, u1_nm: float, u2_nm: float) -> State: ...
    def state(self) -> State: ...

class Simulation:
    def __init__(self, scenario: Scenario = "hybrid-elbow-down", overrides: Overrides | None = None) -> None: ...
    def sample(self) -> tuple[Sensor, bool]: ...
    # An answer to another tick, or with an unknown state or fault, raises ValueError.
    def advance(self, answer: Actuator | None) -> None: ...
    def state(self) -> State: ...

class Controller:
    def __init__(self, scenario: Scenario = "hybrid-elbow-down", overrides: Overrides | None = None) -> None: ...
    def tick(self, sensor: Sensor) -> Actuator: ...
    def telemetry(self) -> Telemetry: ...

def run(scenario: Scenario = "hybrid-elbow-down", overrides: Overrides | None = None) -> dict[str, list[Any]]: ...
def study(name: str, **options: Any) -> dict[str, Any]: ...
