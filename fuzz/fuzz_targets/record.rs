//! `cargo +nightly fuzz run record -- -rss_limit_mb=200`: no file makes the reader of records panic, abort, or take
//! more memory. Give it a short record as its first input: copy one into `fuzz/corpus/record/`.

#![no_main]

use libfuzzer_sys::fuzz_target;
use painleve_record::export::ticks_to_csv;

fuzz_target!(|record: &[u8]| {
    let _ = ticks_to_csv(record, std::io::sink());
});
