//! What the arm does between a failure and the stop of the drive.

use painleve_plant::plant::Plant as _;

use crate::bench::Bench;
use crate::board::BoardChip;

/// Motion and force of the arm from a failure until the torque is off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
        Self::until_off_counting(bench, limit, |_| false).0
    }

    /// Returns the larger of each figure.
    #[must_use]
    pub fn or_worse(&self, other: &Self) -> Self {
        Self {
            ticks: self.ticks.max(other.ticks),
            turned_deg: self.turned_deg.max(other.turned_deg),
            tip_mm: self.tip_mm.max(other.tip_mm),
            before_n: self.before_n.max(other.before_n),
            normal_force_n: self.normal_force_n.max(other.normal_force_n),
        }
    }

    /// Runs until the torque is off; returns also the number of ticks with the torque on after which `is_wrong`
    /// is true: how long a failure that has become visible lasts.
    ///
    /// # Panics
    /// If the torque is still on after `limit` ticks.
    pub fn until_off_counting<C: BoardChip>(
        bench: &mut Bench<C>,
        limit: u32,
        is_wrong: impl Fn(&Bench<C>) -> bool,
    ) -> (Self, u32) {
        let mut wrong_ticks = u32::from(is_wrong(bench));
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
            wrong_ticks += u32::from(!bench.board.torque().is_off() && is_wrong(bench));
        }
        (harm, wrong_ticks)
    }
}
