//! The target position of the tip.
//!
//! - [`reference`](mod@reference): the segments of the program, tick by tick
//! - [`governor`]: keeps the reference inside the admissible stretch of the belt

pub mod governor;
pub mod reference;

use painleve_shared::Posture;
use painleve_shared::status::SupervisorState;

use self::governor::{EdgeGovernor, Stretch};
use self::reference::{ReferenceGenerator, TipReference};
use crate::estimate::Estimators;
use crate::supervise::supervisor::Phase;

/// The target of the tip at one tick, and its limits.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Reference of the tip.
    pub reference: TipReference,
    /// Position that the program requests, before an edge holds it back, m.
    pub requested_m: f32,
    /// Posture in which the tip should be there.
    pub posture: Posture,
    /// The admissible stretch of the belt.
    pub stretch: Stretch,
    /// Whether the edges have been found for the landing of a tip that must be returned to the belt.
    pub edges_for_landing: bool,
    /// Whether an edge holds the reference back.
    pub at_edge: bool,
    /// Whether the tip must be returned to the belt before it can follow.
    pub recovering: bool,
}

/// Follows the program within the edges.
// In this order: see the fields of the controller.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct References {
    governor: EdgeGovernor,
    /// Least p as a fraction of Q22 at which a recovered tip may land.
    landing_p_ratio: f32,
    /// Posture in which the drive was armed or the tip landed or, of a thrown one, that in which it is to land.
    posture: Posture,
    /// Whether the edges depend on where a thrown tip may land.
    pub asks_for_landing: bool,
    /// Whether the program waits for contact and the edges: if it began before, it would have to catch up, and could overtake a
    /// slow belt.
    waits: bool,
    pub(crate) generator: ReferenceGenerator,
}

impl References {
    /// Makes the references of an arm. `landing_p_ratio` is the least p, as a fraction of Q22, at which a recovered tip
    /// may land.
    pub fn new(
        governor: EdgeGovernor,
        generator: ReferenceGenerator,
        landing_p_ratio: f32,
    ) -> Self {
        Self {
            posture: Posture::ElbowDown,
            asks_for_landing: false,
            governor,
            landing_p_ratio,
            waits: false,
            generator,
        }
    }

    /// Returns the target of a tick. `landing` is the posture in which a thrown tip is being returned to the belt.
    #[inline]
    pub fn tick(
        &mut self,
        estimates: &Estimators,
        phase: &Phase,
        landing: Option<Posture>,
    ) -> Target {
        let (model, contact) = (&estimates.model, &estimates.contact);
        // The descent continues, and presses the tip gently, until contact is certain. The law's
        // whole force while in doubt would be evidence that comes and goes with the law.
        let descends = estimates.detector.is_in_flight() || landing.is_some();
        let drives = phase.state.drives();
        let recovering = drives && phase.recovers && !contact.touches && descends;
        self.asks_for_landing = recovering || landing.is_some();
        let tip_t_m = model.tip_m.x;
        // While the drive is off, the edges are searched for the posture in which it would be armed. A thrown arm may land in
        // another posture than it was to land in. A tip that stays on the belt may be dragged past the straight arm and back.
        if phase.arms || contact.lands || !drives {
            self.posture = Posture::of(&model.theta_rad);
        } else if let (false, Some(posture)) = (contact.touches, landing) {
            self.posture = posture;
        }
        if phase.arms || (contact.lands && phase.state == SupervisorState::Armed) {
            self.generator.restart(tip_t_m);
        }
        if phase.starts_tracking {
            // The belt has dragged the tip while friction was unknown, and the estimated tip
            // position has changed with the links' length.
            self.generator.start_from(tip_t_m);
        }
        let wanted = match phase.state {
            SupervisorState::Idle | SupervisorState::Fault => TipReference::at_rest(tip_t_m),
            SupervisorState::Armed => self.generator.start(),
            // The reference waits for a tip that is being returned to the belt.
            SupervisorState::LiftOff if recovering => {
                // Only told as what the program requests: the reference stays where the governor last had it.
                TipReference::at_rest(self.generator.next.position_m)
            }
            _ if phase.starts_tracking || self.waits => self.generator.start(),
            SupervisorState::Tracking | SupervisorState::LiftOff => self.generator.next_tick(),
        };
        // The belt may drag a tip that has landed. Led back to where it touched, it could pass an edge that is not known yet.
        let settles = contact.touches && self.asks_for_landing;
        if phase.arms || contact.lands || phase.starts_tracking || settles {
            self.governor.restart(tip_t_m);
        }
        Target {
            reference: if recovering {
                // It stays where the tip left it, and starts again from where the tip lands.
                TipReference::at_rest(self.governor.last.position_m)
            } else if drives {
                self.governor.govern(&wanted)
            } else {
                wanted
            },
            requested_m: wanted.position_m,
            posture: self.posture,
            stretch: self.governor.stretch,
            edges_for_landing: recovering
                && self
                    .governor
                    .has_edges_for(self.posture, self.landing_p_ratio),
            at_edge: drives && !recovering && self.governor.at_edge,
            recovering,
        }
    }

    /// Continues the search for the edges of the admissible stretch around the tip.
    #[inline(never)]
    pub fn search(&mut self, estimates: &Estimators) {
        // The least p, as a fraction of Q22, that is asked for beyond the governor's own.
        let asked_p_ratio = if self.asks_for_landing {
            self.landing_p_ratio
        } else {
            0.0
        };
        self.governor.search(
            &estimates.arm,
            self.posture,
            estimates.model.tip_m.x,
            &estimates.contact.friction,
            asked_p_ratio,
        );
    }

    /// Prepares the program's reference for the next tick of a drive in this state.
    #[inline]
    pub fn prepare(&mut self, drive: SupervisorState) {
        self.waits = !self.generator.has_begun()
            && (drive != SupervisorState::Tracking || !self.governor.knows_edges(self.posture));
        let follows = matches!(drive, SupervisorState::Tracking | SupervisorState::LiftOff);
        // While it waits, not even a segment of no duration ends.
        if follows && !self.waits {
            self.generator.prepare();
        }
    }
}
