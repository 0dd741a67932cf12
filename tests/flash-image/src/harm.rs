//! What the arm does between a failure and the stop of the drive.

use painleve_plant::plant::Plant as _;

use crate::bench::Bench;
use crate::board::BoardChip;

/// Motion and force of the arm from a failure until the torque is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harm {
    /// Ticks until the torque is off.
    pub ticks: u32,
    /// Largest angle by which a link has turned, degrees.
    pub turned_deg: f64,
    /// Largest distance of the tip from its place at the failure, mm.
    pub tip_mm: f64,
    /// Normal force at the failure, N.
    pub before_n: f64,
    /// Largest normal force, N.
    pub normal_force_n: f64,
}

impl Harm {
    /// Runs until the torque is off.
    ///
    /// # Panics
    /// If it is still on after `limit` ticks.
    pub fn until_off<C: BoardChip>(bench: &mut Bench<C>, limit: u32) -> Self {
        let start = bench.simulation.plant().snapshot();
        let mut harm = Self {
            ticks: 0,
            turned_deg: 0.0,
            tip_mm: 0.0,
            before_n: start.normal_force_n,
            normal_force_n: start.normal_force_n,
        };
        while !bench.board.torque().is_off() {
            assert!(harm.ticks < limit, "still on: {harm:?}");
            bench.tick();
            harm.ticks += 1;
            let now = bench.simulation.plant().snapshot();
            let turned_rad = (now.theta_rad - start.theta_rad).amax();
            harm.turned_deg = harm.turned_deg.max(turned_rad.to_degrees());
            let tip_m = (now.tip_t_m - start.tip_t_m).hypot(now.gap_m - start.gap_m);
            harm.tip_mm = harm.tip_mm.max(1e3 * tip_m);
            harm.normal_force_n = harm.normal_force_n.max(now.normal_force_n);
        }
        harm
    }
}
