//! The control law of a scenario, as data: one of a set of laws that the program was built with.
//!
//! Studies, sweeps and runs treat a law like any other setting. The set of available laws is a
//! property of the program, like its version: [`install`] sets it once, at the start; without it,
//! the set is that of the built-in laws. A law is then read, checked, written and run without a
//! type parameter, because a [`LawChoice`] is itself a [`Law`].

use std::any::Any;
use std::fmt::Debug;
use std::sync::{Arc, OnceLock};

use painleve_firmware::Configuration;
use painleve_firmware::law::{Law, LawInput, LawOutput, LawSettings};
use painleve_shared::OutOfRange;
use painleve_shared::settings::{Bounds, Refused, SettingValue, Shape, ShapeSource};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The laws of this program.
static LAWS: OnceLock<LawSet> = OnceLock::new();

/// Constructors of the laws in the program's set.
#[derive(Clone, Copy)]
struct LawSet {
    shape: Shape,
    build: u64,
    default: fn() -> LawChoice,
    read: fn(&mut dyn erased_serde::Deserializer<'_>) -> erased_serde::Result<LawChoice>,
}

/// A set of laws that a scenario may name.
pub trait ScenarioLaws:
    Law<State: Send + Sync + 'static> + Serialize + DeserializeOwned + PartialEq + Send + Sync + 'static
{
}

impl<L> ScenarioLaws for L where
    L: Law<State: Send + Sync + 'static>
        + Serialize
        + DeserializeOwned
        + PartialEq
        + Send
        + Sync
        + 'static
{
}

/// Installs `L` as the set of laws of this program. Call it before the first scenario is read;
/// later calls have no effect.
pub fn install<L: ScenarioLaws>() {
    let _ = LAWS.set(LawSet::of::<L>());
}

/// Returns [`Configuration::BUILD`] with the laws of this program, which a board's must equal.
pub fn build() -> u64 {
    LawSet::installed().build
}

impl LawSet {
    fn of<L: ScenarioLaws>() -> Self {
        Self {
            shape: L::SHAPE,
            build: Configuration::<L>::BUILD,
            default: || LawChoice::new(L::default()),
            read: |source| erased_serde::deserialize::<L>(source).map(LawChoice::new),
        }
    }

    fn installed() -> Self {
        *LAWS.get_or_init(Self::of::<LawSettings>)
    }
}

/// A law of the program's set with its settings.
#[derive(Clone, Debug)]
pub struct LawChoice(Arc<dyn AnyLaw>);

impl LawChoice {
    /// Wraps a law.
    pub fn new<L: ScenarioLaws>(law: L) -> Self {
        Self(Arc::new(law))
    }

    /// Returns the name of the law, as in files.
    pub fn name(&self) -> &'static str {
        self.0.name()
    }

    /// Returns the law as one of the set `L`; `None` if it belongs to another set.
    pub fn of_set<L: ScenarioLaws>(&self) -> Option<&L> {
        self.0.as_any().downcast_ref()
    }
}

/// A [`Law`] as a trait object.
trait AnyLaw: Debug + Send + Sync + erased_serde::Serialize {
    fn as_any(&self) -> &dyn Any;
    fn name(&self) -> &'static str;
    fn is_equal(&self, other: &dyn Any) -> bool;
    fn check(&self, bounds: &Bounds, error: &mut OutOfRange) -> Result<(), Refused>;
    fn is_on(&self) -> bool;
    fn at_speed(&self, factor: f32) -> LawChoice;
    fn initial_state(&self) -> LawChoiceState;
    fn reset(&self, state: &mut LawChoiceState, input: &LawInput<'_>);
    fn tick(&self, state: &mut LawChoiceState, input: &LawInput<'_>) -> LawOutput;
}

impl<L: ScenarioLaws> AnyLaw for L {
    fn as_any(&self) -> &dyn Any {
        self
    }

    fn name(&self) -> &'static str {
        Law::name(self)
    }

    fn is_equal(&self, other: &dyn Any) -> bool {
        other.downcast_ref() == Some(self)
    }

    fn check(&self, bounds: &Bounds, error: &mut OutOfRange) -> Result<(), Refused> {
        SettingValue::check(self, bounds, error)
    }

    fn is_on(&self) -> bool {
        Law::is_on(self)
    }

    fn at_speed(&self, factor: f32) -> LawChoice {
        LawChoice::new(Law::at_speed(self, factor))
    }

    fn initial_state(&self) -> LawChoiceState {
        LawChoiceState(Some(Box::new(Law::initial_state(self))))
    }

    fn reset(&self, state: &mut LawChoiceState, input: &LawInput<'_>) {
        Law::reset(self, state.of::<L>(), input);
    }

    fn tick(&self, state: &mut LawChoiceState, input: &LawInput<'_>) -> LawOutput {
        Law::tick(self, state.of::<L>(), input)
    }
}

/// State of a [`LawChoice`]: the state of its law, allocated by [`Law::initial_state`].
#[derive(Default)]
pub struct LawChoiceState(Option<Box<dyn AnyState>>);

impl LawChoiceState {
    fn of<L: ScenarioLaws>(&mut self) -> &mut L::State {
        let present = self.0.as_deref();
        if !present.is_some_and(|state| state.inner().is::<L::State>()) {
            self.0 = Some(Box::<L::State>::default());
        }
        self.0
            .as_mut()
            .and_then(|state| state.as_mut().inner_mut().downcast_mut())
            .unwrap_or_else(|| unreachable!("made above if it was of another type"))
    }
}

impl Clone for LawChoiceState {
    fn clone(&self) -> Self {
        Self(self.0.as_ref().map(|state| state.as_ref().boxed()))
    }
}

impl Debug for LawChoiceState {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// The state of a law as a trait object.
trait AnyState: Debug + Send + Sync {
    fn inner(&self) -> &dyn Any;
    fn inner_mut(&mut self) -> &mut dyn Any;
    fn boxed(&self) -> Box<dyn AnyState>;
}

impl<S: Clone + Debug + Send + Sync + 'static> AnyState for S {
    fn inner(&self) -> &dyn Any {
        self
    }

    fn inner_mut(&mut self) -> &mut dyn Any {
        self
    }

    fn boxed(&self) -> Box<dyn AnyState> {
        Box::new(self.clone())
    }
}

impl Law for LawChoice {
    type State = LawChoiceState;

    fn name(&self) -> &'static str {
        self.0.name()
    }

    fn is_on(&self) -> bool {
        self.0.is_on()
    }

    fn at_speed(&self, factor: f32) -> Self {
        self.0.at_speed(factor)
    }

    fn initial_state(&self) -> LawChoiceState {
        self.0.initial_state()
    }

    fn reset(&self, state: &mut LawChoiceState, input: &LawInput<'_>) {
        self.0.reset(state, input);
    }

    fn tick(&self, state: &mut LawChoiceState, input: &LawInput<'_>) -> LawOutput {
        self.0.tick(state, input)
    }
}

impl Default for LawChoice {
    /// Returns the default law of the program's set.
    fn default() -> Self {
        (LawSet::installed().default)()
    }
}

impl PartialEq for LawChoice {
    fn eq(&self, other: &Self) -> bool {
        self.0.is_equal(other.0.as_any())
    }
}

impl SettingValue for LawChoice {
    const SHAPE: Shape = Shape::AtRunTime(ShapeSource(|| LawSet::installed().shape));

    fn check(&self, bounds: &Bounds, error: &mut OutOfRange) -> Result<(), Refused> {
        self.0.check(bounds, error)
    }
}

impl Serialize for LawChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        erased_serde::serialize(self.0.as_ref(), serializer)
    }
}

impl<'de> Deserialize<'de> for LawChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut deserializer = <dyn erased_serde::Deserializer<'_>>::erase(deserializer);
        (LawSet::installed().read)(&mut deserializer).map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::{Scenario, built_in};
    use painleve_firmware::law::hybrid::HybridSettings;

    fn hybrid(normal_force_n: f32) -> LawSettings {
        LawSettings::Hybrid(HybridSettings {
            normal_force_n,
            ..Default::default()
        })
    }

    #[test]
    fn a_choice_behaves_as_its_law() {
        let choice = LawChoice::new(hybrid(8.0));
        assert_eq!(choice.of_set(), Some(&hybrid(8.0)));
        assert_eq!(choice, LawChoice::new(hybrid(8.0)));
        assert_ne!(choice, LawChoice::new(hybrid(9.0)));
        assert_ne!(choice, LawChoice::new(HybridSettings::default()));
        assert_eq!(choice.name(), "hybrid");
        let faster = LawChoice::new(Law::at_speed(&hybrid(8.0), 2.0));
        assert_eq!(Law::at_speed(&choice, 2.0), faster);
        assert_ne!(faster, choice);
        assert_eq!(LawChoice::default().of_set(), Some(&LawSettings::default()));
    }

    #[test]
    fn it_is_serialised_like_its_law_and_read_back() {
        for name in built_in::names() {
            let law = Scenario::load(name, &[]).unwrap().controller.law;
            let typed: &LawSettings = law.of_set().unwrap();
            let text = serde_json::to_string(&law).unwrap();
            assert_eq!(text, serde_json::to_string(typed).unwrap());
            assert_eq!(serde_json::from_str::<LawChoice>(&text).unwrap(), law);
        }
    }

    #[test]
    fn a_setting_out_of_range_is_named_with_its_full_key() {
        let set = "controller.law.hybrid.normal_force_n=-1".to_owned();
        let error = Scenario::load(built_in::DEFAULT, &[set]).unwrap_err();
        let message = error.to_string();
        let key = "controller.law.hybrid.normal_force_n = -1";
        assert!(message.contains(key), "{message}");
    }
}
