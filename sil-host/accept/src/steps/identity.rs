//! Chip and image.

use painleve_board::Port;

use crate::bench::{Bench, StepError};
use crate::chip::{CHIPS, CORTEX_M4, Chip, IDENTIFICATION, PROCESSOR};
use crate::report::Check;

/// Finds out which chip it is. Protocol and build agree already.
///
/// # Errors
/// [`StepError`] if the board does not answer.
pub fn measure<P: Port>(bench: &mut Bench<P>) -> Result<Vec<Check>, StepError> {
    let host = painleve_firmware::SOURCES;
    let sources = bench.board.sources();
    let mut checks = vec![Check::new(
        "sources of the image",
        format_args!("{sources:016x}"),
        format_args!("{host:016x}, those of this program"),
        sources == host,
    )];
    let processor = bench.load(PROCESSOR)?.value;
    checks.push(Check::new(
        "processor",
        format_args!("{processor:#010x}"),
        format_args!("{CORTEX_M4:#010x}, a Cortex-M4 of any revision"),
        processor & !0xf == CORTEX_M4,
    ));
    let identification = bench.load(IDENTIFICATION)?.value;
    bench.chip = Chip::of(identification);
    let known = CHIPS
        .each_ref()
        .map(|it| format!("{:#x} {}", it.device, it.name));
    checks.push(Check::new(
        "device number",
        format_args!("{:#x}", identification & 0xfff),
        known.join(" or "),
        bench.chip.is_some(),
    ));
    checks.push(Check::note(
        "revision, for the errata sheet",
        format_args!("{:#06x}", identification >> 16),
    ));
    let Some(chip) = bench.chip else {
        return Ok(checks);
    };
    let word = bench.load(chip.flash_size_address)?.value;
    let kib = word >> chip.flash_size_shift & 0xffff;
    checks.push(Check::new(
        "flash",
        format_args!("{kib} KiB"),
        format_args!("{} KiB", chip.flash_kib),
        kib == chip.flash_kib,
    ));
    let mut unique = String::new();
    for word in 0..3 {
        unique += &format!("{:08x}", bench.load(chip.unique + 4 * word)?.value);
    }
    checks.push(Check::note("unique number", unique));
    let record = bench.board.black_box()?;
    checks.push(Check::note(
        "last reset",
        format_args!(
            "{:?}, start {} since the power came up",
            record.reset, record.starts
        ),
    ));
    if let Some(crash) = record.crash {
        checks.push(Check::note("last crash", format_args!("{crash:?}")));
    }
    Ok(checks)
}
