"""The arm as a Gymnasium environment: torques in, angles and tip out; the reward follows the reference.

Needs `pip install painleve[gym]`.
"""

import gymnasium
import numpy

from . import Plant


class ArmOnBelt(gymnasium.Env):
    """The tip shall stay on the belt and go to `target_m`.

    Action: torques u1, u2 in N·m. Observation: θ1, θ2 (rad), their rates (rad/s), tip position (m), gap (m).
    Reward: minus the distance to the target in mm, minus 10 while the tip is in the air.
    """

    def __init__(self, scenario="hybrid-elbow-down", target_m=0.05, duration_s=3.0, torque_limit_nm=5.0):
        self.scenario, self.target_m, self.duration_s = scenario, target_m, duration_s
        self.action_space = gymnasium.spaces.Box(-torque_limit_nm, torque_limit_nm, (2,), numpy.float64)
        self.observation_space = gymnasium.spaces.Box(-numpy.inf, numpy.inf, (6,), numpy.float64)

    def _observation(self):
        now = self.plant.state()
        names = ("theta1_rad", "theta2_rad", "theta1_dot_rad_s", "theta2_dot_rad_s", "tip_t_m", "gap_m")
        return numpy.array([now[name] for name in names]), now

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.plant = Plant(self.scenario)
        return self._observation()

    def step(self, action):
        self.plant.step(float(action[0]), float(action[1]))
        observation, now = self._observation()
        reward = -1e3 * abs(now["tip_t_m"] - self.target_m) - (10.0 if now["mode"] == "flight" else 0.0)
        return observation, reward, False, now["time_s"] >= self.duration_s, now
