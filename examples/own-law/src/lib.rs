//! A user-defined control law: an impedance controller. The tip behaves as if a spring and a damper
//! tied it to its reference along the belt, and presses on the belt with a constant force.

#![no_std]

use nalgebra::Vector2;
use painleve_firmware::law::hybrid::HybridSettings;
use painleve_firmware::law::pid::PidSettings;
use painleve_firmware::law::{Law, LawInput, LawOutput};
use painleve_shared::LinkMotion;

painleve_shared::settings! {
    /// Settings of the impedance controller.
    #[derive(Copy)]
    pub struct ImpedanceSettings {
        /// Stiffness along the belt.
        stiffness_n_m: f32 = 1500.0, 0.0..=1e5, "N/m";
        /// Damping along the belt.
        damping_ns_m: f32 = 60.0, 0.0..=1e4, "N·s/m";
        /// Normal force on the belt.
        normal_force_n: f32 = 10.0, 0.0..=1e3, "N";
    }
}

impl Law for ImpedanceSettings {
    type State = ();

    fn tick(&self, _: &mut (), input: &LawInput<'_>) -> LawOutput {
        let reference = &input.reference;
        let spring_n = self.stiffness_n_m * (reference.position_m - input.model.tip_m.x);
        let damper_n =
            self.damping_ns_m * (reference.velocity_m_s - input.model.tip_velocity_m_s.x);
        let friction = &input.contact.friction;
        let friction_n = if friction.slip_seen {
            -friction.coefficient * friction.slip.sign::<f32>() * self.normal_force_n
        } else {
            0.0
        };
        let contact_force_n = Vector2::new(friction_n, self.normal_force_n);
        // Terms that hold the arm still, press on the belt, and pull the tip along it.
        let wanted_n = contact_force_n - Vector2::new(spring_n + damper_n, 0.0);
        LawOutput {
            torque_nm: input
                .model
                .inverse_dynamics_nm(&LinkMotion::default(), &wanted_n),
            contact_force_n,
        }
    }
}

painleve_firmware::law_set! {
    /// The built-in laws and our own.
    pub enum OurLaws = Hybrid, states OurLawStates {
        /// The paper's PID on the joints.
        "pid" => Pid(PidSettings),
        /// The paper's hybrid force/motion law.
        "hybrid" => Hybrid(HybridSettings),
        /// Spring and damper along the belt, constant normal force.
        "impedance" => Impedance(ImpedanceSettings),
    }
}
