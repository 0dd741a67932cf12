//! Motors and gears between the torque stages and the joints of a real arm.

use crate::settings;

settings! {
    /// Motor and gear of each torque stage. A board scales the controller's joint torques to them; the torque
    /// stages of the simulated arm act on the joints directly.
    #[derive(Copy)]
    pub struct StageSettings {
        /// Turns of each motor per turn of its joint; 1 without a gear.
        gear_ratio: [f32; 2] = [1.0; 2], 0.01..=1000.0, "";
        /// Torque at the joint, divided by gear ratio times motor torque.
        gear_efficiency: [f32; 2] = [1.0; 2], 0.3..=1.0, "";
        /// Torque of each motor at the largest output of the board's converter; `converters.torque.range_nm` if absent.
        motor_range_nm: Option<[f32; 2]> = None, 1e-4..=1e6, "N·m";
    }
}

impl StageSettings {
    /// Returns the torque at each joint per motor torque.
    pub fn joint_per_motor(&self) -> [f32; 2] {
        let [ratio_1, ratio_2] = self.gear_ratio;
        let [efficiency_1, efficiency_2] = self.gear_efficiency;
        [ratio_1 * efficiency_1, ratio_2 * efficiency_2]
    }

    /// Returns the largest torque of each motor, N·m, for joint torques of this range.
    pub fn motor_range_nm(&self, range_nm: f32) -> [f32; 2] {
        self.motor_range_nm.unwrap_or([range_nm; 2])
    }

    /// Returns the largest torque that each stage can give at its joint, N·m, for joint torques of this range.
    pub fn joint_range_nm(&self, range_nm: f32) -> [f32; 2] {
        let [motor_1, motor_2] = self.motor_range_nm(range_nm);
        let [gear_1, gear_2] = self.joint_per_motor();
        [motor_1 * gear_1, motor_2 * gear_2]
    }
}
