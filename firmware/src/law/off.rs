//! No law.

use super::{Law, LawInput, LawOutput};

painleve_shared::settings! {
    /// No law: the drive never arms, torque is zero.
    #[derive(Copy)]
    pub struct Off {}
}

impl Law for Off {
    type State = ();

    fn is_on(&self) -> bool {
        false
    }

    fn tick(&self, _: &mut (), _: &LawInput<'_>) -> LawOutput {
        LawOutput::default()
    }
}
