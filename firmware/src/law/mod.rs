//! The control laws, and sets from which one is selected.
//!
//! - [`Law`]: the trait of a law, from [`LawInput`] to [`LawOutput`]
//! - [`pid`]: the paper's PID on the joints
//! - [`hybrid`]: the paper's hybrid force/motion law
//! - [`law_set!`](crate::law_set!): declares a set of laws that is itself a law; [`LawSettings`] is
//!   the set built into the controller

pub mod hybrid;
pub mod pid;

use core::fmt::Debug;

use nalgebra::Vector2;
use painleve_shared::settings::SettingValue;
use painleve_shared::{Arm, JointTorque, Posture};

use self::hybrid::HybridSettings;
use self::pid::PidSettings;
use crate::estimate::ContactEstimate;
use crate::estimate::model::Model;
use crate::refer::reference::TipReference;

/// A control law: constant settings that compute torques from the inputs of a tick and a state of
/// their own.
///
/// The settings are declared with [`settings!`](painleve_shared::settings!), which checks them and
/// describes them to the host. [`law_set!`](crate::law_set!) combines a custom law with the
/// built-in ones.
///
/// ```
/// use painleve_firmware::law::{Law, LawInput, LawOutput};
///
/// painleve_shared::settings! {
///     /// Holds each joint where it is with a damper.
///     #[derive(Copy)]
///     pub struct DamperSettings {
///         /// Damping of each joint.
///         damping_nms_rad: f32 = 0.1, 0.0..=10.0, "N·m·s/rad";
///     }
/// }
///
/// impl Law for DamperSettings {
///     type State = ();
///
///     fn tick(&self, _: &mut (), input: &LawInput<'_>) -> LawOutput {
///         LawOutput {
///             torque_nm: input
///                 .model
///                 .theta_dot_rad_s
///                 .to_joints()
///                 .torque_by([-self.damping_nms_rad; 2]),
///             contact_force_n: input.contact.force_n,
///         }
///     }
/// }
/// ```
pub trait Law: Clone + Debug + Default + SettingValue {
    /// State of the law between ticks. The default is the state of a law that has not run yet.
    type State: Clone + Debug + Default;

    /// Returns the name for reports: a set returns the chosen law's, a law its settings' type.
    fn name(&self) -> &'static str {
        core::any::type_name::<Self>()
    }

    /// Whether there is a law: without one the drive never arms.
    fn is_on(&self) -> bool {
        true
    }

    /// Returns the law with motion loops faster by a factor; on elastic gears it is less than 1. A law without such loops
    /// stays as it is.
    #[must_use]
    fn at_speed(&self, factor: f32) -> Self {
        let _ = factor;
        self.clone()
    }

    /// Returns the state before the law's first tick. A law on a PC may allocate it here, once: the ticks must not, nor
    /// may its [`reset`](Self::reset).
    fn initial_state(&self) -> Self::State {
        Self::State::default()
    }

    /// Resets the law's state, by default to that of a law that has not run; called before the law's tick when the drive
    /// is armed and when the tip lands.
    fn reset(&self, state: &mut Self::State, input: &LawInput<'_>) {
        let _ = input;
        *state = Self::State::default();
    }

    /// Computes the torques for one tick. Takes bounded time, does not allocate and does not panic;
    /// a torque or contact force that is not finite latches a fault.
    fn tick(&self, state: &mut Self::State, input: &LawInput<'_>) -> LawOutput;
}

/// Inputs of a law at one tick.
#[derive(Clone, Copy, Debug)]
pub struct LawInput<'a> {
    /// The arm's model.
    pub arm: &'a Arm<f32>,
    /// The model's terms at the estimated state.
    pub model: &'a Model,
    /// Posture in which the drive was armed or the tip landed.
    pub posture: Posture,
    /// The contact's estimate.
    pub contact: &'a ContactEstimate,
    /// Whether the torque of the previous tick was limited.
    pub saturated: bool,
    /// Reference of the tip.
    pub reference: TipReference,
    /// Largest torque on either joint, N·m.
    pub torque_limit_nm: f32,
    /// Control period, s.
    pub tick_s: f32,
}

/// A law's answer; the default is no torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LawOutput {
    /// Desired joint torques, N·m, before limits.
    pub torque_nm: JointTorque<f32>,
    /// Contact force (f_t, f_n) that the law expects with these torques, N.
    pub contact_force_n: Vector2<f32>,
}

/// Declares a set of laws: an enum of their settings that is itself a [`Law`](crate::law::Law), and
/// a struct of their states. Every set also has the variant `Off` (`"off"`), which never arms.
///
/// ```
/// use painleve_firmware::law::{hybrid::HybridSettings, pid::PidSettings};
///
/// painleve_firmware::law_set! {
///     /// The laws of our arm.
///     pub enum OurLaws = Pid, states OurLawStates {
///         /// The paper's PID.
///         "pid" => Pid(PidSettings),
///         /// The same with other gains by default.
///         "hybrid" => Hybrid(HybridSettings),
///     }
/// }
///
/// assert_eq!(OurLaws::default(), OurLaws::Pid(PidSettings::default()));
/// ```
#[macro_export]
macro_rules! law_set {
    (
        $(#[$attribute:meta])*
        $visibility:vis enum $name:ident = $default:ident, states $states:ident {
            $(
                $(#[doc = $meaning:literal])+
                $key:literal => $law:ident($settings:ty)
            ),* $(,)?
        }
    ) => {
        ::painleve_shared::settings! {
            $(#[$attribute])*
            #[derive(Copy)]
            $visibility enum $name {
                /// No law: the drive never arms, torque is zero.
                "off" => Off,
                $($(#[doc = $meaning])+ $key => $law($settings)),*
            }
        }

        impl ::core::default::Default for $name {
            fn default() -> Self {
                Self::$default(::core::default::Default::default())
            }
        }

        #[doc = concat!("The states of all laws of [`", stringify!($name), "`], each by its law's name.")]
        #[derive(Clone, Debug, Default)]
        #[allow(non_snake_case)]
        $visibility struct $states {
            $($law: <$settings as $crate::law::Law>::State,)*
        }

        impl $crate::law::Law for $name {
            type State = $states;

            fn name(&self) -> &'static str {
                // The choice's own, which names the variant as files do.
                Self::name(self)
            }

            fn is_on(&self) -> bool {
                match self {
                    Self::Off => false,
                    $(Self::$law(law) => $crate::law::Law::is_on(law),)*
                }
            }

            fn at_speed(&self, factor: f32) -> Self {
                match self {
                    Self::Off => Self::Off,
                    $(Self::$law(law) => Self::$law($crate::law::Law::at_speed(law, factor)),)*
                }
            }

            fn initial_state(&self) -> $states {
                let mut states = $states::default();
                match self {
                    Self::Off => {}
                    $(Self::$law(law) => states.$law = $crate::law::Law::initial_state(law),)*
                }
                states
            }

            #[inline(never)]
            fn reset(&self, state: &mut $states, input: &$crate::law::LawInput<'_>) {
                match self {
                    Self::Off => {}
                    $(Self::$law(law) => $crate::law::Law::reset(law, &mut state.$law, input),)*
                }
            }

            #[inline]
            fn tick(
                &self,
                state: &mut $states,
                input: &$crate::law::LawInput<'_>,
            ) -> $crate::law::LawOutput {
                match self {
                    Self::Off => ::core::default::Default::default(),
                    $(Self::$law(law) => $crate::law::Law::tick(law, &mut state.$law, input),)*
                }
            }
        }
    };
}

law_set! {
    /// Choice and settings of the control law.
    pub enum LawSettings = Hybrid, states LawStates {
        /// The paper's PID on the joints (section III-A).
        "pid" => Pid(PidSettings),
        /// The paper's hybrid force/motion law (section III-B).
        "hybrid" => Hybrid(HybridSettings),
    }
}
