//! Option bytes.

use painleve_board::Port;

use crate::bench::{Bench, StepError};
use crate::report::Check;

/// Compares the fields of the option bytes.
///
/// # Errors
/// [`StepError`] if the board does not answer.
pub fn measure<P: Port>(bench: &mut Bench<P>) -> Result<Vec<Check>, StepError> {
    let chip = bench.chip()?;
    let found = bench.load(chip.option_register)?.value;
    let fields = chip.options.iter().map(|field| {
        let shift = field.mask.trailing_zeros();
        let value = found & field.mask;
        Check::new(
            field.name,
            format_args!("{:#x}", value >> shift),
            format_args!("{:#x}", field.expected >> shift),
            value == field.expected,
        )
    });
    let mut checks: Vec<Check> = fields.collect();
    checks.push(Check::note("option bytes", format_args!("{found:#010x}")));
    Ok(checks)
}
