//! Gives records to libFuzzer: no file makes their reader panic, abort, or take 200 MB.
//!
//! In this folder, with a C++ compiler and a short record in `corpus/`:
//! `cargo run --release -- corpus -artifact_prefix=corpus/ -rss_limit_mb=200 -max_len=70000 -max_total_time=600`.

#![no_main]

use libfuzzer_sys::fuzz_target;
use painleve_record::export::ticks_to_csv;

fuzz_target!(|record: &[u8]| {
    let _ = ticks_to_csv(record, std::io::sink());
});
