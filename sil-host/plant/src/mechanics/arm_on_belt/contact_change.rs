//! Handling of contact events: the tip lands, is thrown off, or continues in another mode.

use super::super::impact::{self, ImpactKind};
use super::super::probe::ArmProbe;
use super::super::transition::{self, Continuation};
use super::{ArmOnBelt, MotionError};
use crate::plant::{ContactMode, Event};

impl ArmOnBelt {
    /// Handles a landing, or the end of sliding or sticking.
    pub(super) fn handle_event(&mut self, probe: &mut dyn ArmProbe) -> Result<(), MotionError> {
        if self.mode.is_contact() {
            let motion = self.motion();
            let slip = motion.relative_velocity_m_s(self.time_s, &self.state).x;
            if self
                .mode
                .slip()
                .is_some_and(|s| s.sign::<f64>() * slip <= 0.0)
            {
                // Slip has just vanished; the remainder is the resolution of the event's time.
                self.state =
                    motion.onto_stick(self.time_s, motion.tip_t_m(&self.state), &self.state);
            }
            return self.enter_contact(probe);
        }
        let motion = self.motion();
        let state = motion.lowered_onto_belt(&self.state);
        let approach_m_s = motion.relative_velocity_m_s(self.time_s, &state).y;
        self.state = state;
        if approach_m_s < 0.0 {
            let impulse_ns = self.collide(ImpactKind::Collision)?;
            let event = Event::Impact {
                approach_m_s,
                impulse_ns,
            };
            probe.event(self.time_s, event, &self.state);
        }
        let motion = self.motion();
        let rebound = motion.relative_velocity_m_s(self.time_s, &self.state).y;
        if rebound < self.solver.chatter_speed_m_s {
            self.state = motion.onto_belt(&self.state);
            self.enter_contact(probe)?;
        }
        Ok(())
    }

    /// Decides what follows for a tip on the belt without normal velocity.
    pub(super) fn enter_contact(&mut self, probe: &mut dyn ArmProbe) -> Result<(), MotionError> {
        // Each throw that does not lift the tip ends its slip, so only sticking and sliding from
        // rest remain.
        self.evaluation = None;
        for _ in 0..4 {
            let motion = self.motion();
            let next =
                transition::decide(&motion, self.time_s, &self.state, self.solver.indeterminate);
            match next {
                Continuation::Mode(mode) => {
                    if mode == ContactMode::Stick && self.mode != ContactMode::Stick {
                        let tip_t_m = motion.tip_t_m(&self.state);
                        self.state = motion.onto_stick(self.time_s, tip_t_m, &self.state);
                        self.stick_start = (self.time_s, tip_t_m);
                    }
                    self.change_mode(mode, probe);
                    return Ok(());
                }
                Continuation::Thrown => {
                    let impulse_ns = self.collide(ImpactKind::WithoutCollision)?;
                    let event = Event::ImpactWithoutCollision { impulse_ns };
                    probe.event(self.time_s, event, &self.state);
                    let motion = self.motion();
                    let rebound = motion.relative_velocity_m_s(self.time_s, &self.state).y;
                    if rebound >= self.solver.chatter_speed_m_s {
                        self.change_mode(ContactMode::Flight, probe);
                        return Ok(());
                    }
                    self.state = motion.onto_belt(&self.state);
                }
            }
        }
        Err(MotionError::EventsWithoutEnd {
            time_s: self.time_s,
        })
    }

    /// Carries out an impact and returns its impulse on the tip, (P_t, P_n), N·s.
    fn collide(&mut self, kind: ImpactKind) -> Result<[f64; 2], MotionError> {
        let motion = self.motion();
        let after = impact::state_after(&motion, &self.impact, self.time_s, &self.state, kind)
            .map_err(|source| MotionError::EndlessImpact {
                time_s: self.time_s,
                source,
            })?;
        self.state = after.state;
        Ok(after.impulse_ns.into())
    }

    fn change_mode(&mut self, mode: ContactMode, probe: &mut dyn ArmProbe) {
        if mode != self.mode {
            let from = core::mem::replace(&mut self.mode, mode);
            probe.event(
                self.time_s,
                Event::ModeChange { from, to: mode },
                &self.state,
            );
        }
    }
}
