use super::*;
use crate::mcap_log::tests::{record, scenario};
use proptest::prelude::*;
use proptest::sample::Index;
use std::sync::LazyLock;

/// A recorded run and its table.
struct Run {
    record: Vec<u8>,
    table: String,
}

fn run(duration_s: f64) -> Run {
    let folder = tempfile::tempdir().unwrap();
    let duration = format!("run.duration_s={duration_s}");
    let (record, table) = record(folder.path(), &scenario("edge", &[&duration]));
    Run { record, table }
}

/// Three ticks: one chunk.
static SMALL: LazyLock<Run> = LazyLock::new(|| run(0.003));
/// More than one chunk.
static LARGE: LazyLock<Run> = LazyLock::new(|| run(0.6));

/// What became of a damaged record.
#[derive(Debug, Default, PartialEq, Eq, Clone, Copy)]
struct Fates {
    same: usize,
    recovered: usize,
    refused: usize,
}

impl Fates {
    /// Exports bytes made from a run's record. Whatever is written must be the beginning of the true table, and all of
    /// it unless the damage is reported. Returns what was exported, if anything.
    fn export(&mut self, bytes: &[u8], run: &Run) -> Option<Exported> {
        let mut table = Vec::new();
        match ticks_to_csv(bytes, &mut table) {
            Ok(exported) => {
                let table = std::str::from_utf8(&table).unwrap();
                assert!(run.table.starts_with(table), "{:?}", exported.damage);
                assert_eq!(table.lines().count() as u64, exported.rows + 1);
                assert!(exported.whole_bytes <= bytes.len() as u64);
                if exported.damage.is_some() {
                    self.recovered += 1;
                } else {
                    assert_eq!(table, run.table);
                    self.same += 1;
                }
                Some(exported)
            }
            Err(ExportError::Incomplete(_) | ExportError::NoTicks) => {
                self.refused += 1;
                None
            }
            Err(error) => panic!("{error}"),
        }
    }

    /// Exports a run's record with one bit flipped.
    fn flip(&mut self, bit: usize, run: &Run) {
        let mut bytes = run.record.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        self.export(&bytes, run);
    }
}

/// Flips every `step`th bit of a run's record. A prime step visits all places of a byte.
fn flip_bits(run: &Run, step: usize) {
    let mut fates = Fates::default();
    let bits = (0..8 * run.record.len()).step_by(step);
    let count = bits.len();
    bits.for_each(|bit| fates.flip(bit, run));
    println!("{count} bits: {fates:?}");
    // Every bit is under some checksum.
    assert_eq!((fates.same, fates.recovered + fates.refused), (0, count));
    assert!(fates.recovered > 0 && fates.refused > 0);
}

#[test]
fn no_bit_of_a_record_changes_its_table_unnoticed() {
    flip_bits(&SMALL, 839);
    flip_bits(&LARGE, 40_009);
}

#[test]
#[ignore = "takes minutes; for changes of the reader"]
fn every_bit_of_a_record_is_checked() {
    flip_bits(&SMALL, 1);
    flip_bits(&LARGE, 5003);
}

#[test]
fn the_ticks_before_a_cut_are_kept() {
    let whole = LARGE.record.len();
    let mut rows = Vec::new();
    for length in (0..whole).step_by(4_999).chain(whole - 20..whole) {
        let mut fates = Fates::default();
        let exported = fates.export(&LARGE.record[..length], &LARGE);
        assert_eq!(fates.same, 0, "{length}");
        if let Some(exported) = exported {
            assert!(exported.whole_bytes as usize <= length);
            rows.push(exported.rows);
        }
    }
    assert!(rows.is_sorted());
    let all = LARGE.table.lines().count() as u64 - 1;
    assert_eq!(rows.last(), Some(&all));
    // The last tick of a chunk goes on in the next one.
    assert!(rows.iter().any(|&rows| rows < all) && rows[0] > 0);
}

/// Returns a record with this opcode and length before its bytes.
fn file(opcode: u8, length: u64, bytes: &[u8]) -> Vec<u8> {
    let head = [mcap::MAGIC, &[opcode]].concat();
    [&head[..], &length.to_le_bytes(), bytes].concat()
}

#[test]
fn lengths_beyond_all_bounds_are_refused_without_memory_for_them() {
    for opcode in 0..=0xff {
        for length in [u64::MAX, 1 << 63, u64::MAX - 8, 1 << 40, 9 << 20] {
            assert!(ticks_to_csv(&file(opcode, length, &[0; 64])[..], std::io::sink()).is_err());
        }
    }
    // A chunk that claims to hold more.
    let chunk = |uncompressed: u64, packed: u64, name: u32| {
        let head = [0_u64, 0, uncompressed].map(u64::to_le_bytes).concat();
        let tail = [
            &[0; 4][..],
            &name.to_le_bytes(),
            b"zstd",
            &packed.to_le_bytes(),
        ]
        .concat();
        file(6, 44, &[head, tail].concat())
    };
    for bytes in [
        chunk(u64::MAX, 0, 4),
        chunk(0, u64::MAX, 4),
        chunk(1, 0, u32::MAX),
    ] {
        assert!(ticks_to_csv(&bytes[..], std::io::sink()).is_err());
    }
}

/// One of the kinds of damage that files suffer.
#[derive(Clone, Debug)]
enum Edit {
    Set(Index, u8),
    Long(Index, u64),
    Remove(Index, u16),
    Insert(Index, Vec<u8>),
    Repeat(Index, u16),
    Cut(Index),
}

impl Edit {
    fn apply(&self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let length = bytes.len();
        let range = |at: &Index, count: u16| {
            let at = at.index(length);
            at..(at + usize::from(count)).min(length)
        };
        match self {
            Self::Set(at, value) => bytes[at.index(length)] = *value,
            Self::Long(at, value) => {
                let place = range(at, 8);
                let count = place.len();
                bytes[place].copy_from_slice(&value.to_le_bytes()[..count]);
            }
            Self::Remove(at, count) => drop(bytes.drain(range(at, *count))),
            Self::Insert(at, more) => {
                let at = at.index(length);
                bytes.splice(at..at, more.iter().copied());
            }
            Self::Repeat(at, count) => {
                let again = bytes[range(at, *count)].to_vec();
                bytes.splice(at.index(length)..at.index(length), again);
            }
            Self::Cut(at) => bytes.truncate(at.index(length)),
        }
    }
}

fn edit() -> impl Strategy<Value = Edit> {
    let at = any::<Index>;
    let long = prop_oneof![
        Just(u64::MAX),
        any::<u64>(),
        (0..64_u32).prop_map(|bit| 1 << bit)
    ];
    prop_oneof![
        4 => (at(), any::<u8>()).prop_map(|(at, value)| Edit::Set(at, value)),
        2 => (at(), long).prop_map(|(at, value)| Edit::Long(at, value)),
        1 => (at(), any::<u16>()).prop_map(|(at, count)| Edit::Remove(at, count % 300)),
        1 => (at(), prop::collection::vec(any::<u8>(), 0..40)).prop_map(|(at, it)| Edit::Insert(at, it)),
        1 => (at(), any::<u16>()).prop_map(|(at, count)| Edit::Repeat(at, count % 300)),
        1 => at().prop_map(Edit::Cut),
    ]
}

/// Returns a record without checksums, so that damage reaches the reader behind them, and unpacked.
fn unchecked(record: &[u8]) -> Vec<u8> {
    let options = mcap::WriteOptions::new()
        .calculate_chunk_crcs(false)
        .calculate_data_section_crc(false)
        .calculate_summary_section_crc(false)
        .compression(None);
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = options.create(&mut bytes).unwrap();
    for message in mcap::MessageStream::new(record).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

static UNCHECKED: LazyLock<Vec<u8>> = LazyLock::new(|| unchecked(&SMALL.record));

proptest! {
    #[test]
    fn damaged_records_are_refused_or_give_whole_ticks(edits in prop::collection::vec(edit(), 1..4)) {
        let mut bytes = SMALL.record.clone();
        edits.iter().for_each(|edit| edit.apply(&mut bytes));
        Fates::default().export(&bytes, &SMALL);
        let mut bytes = UNCHECKED.clone();
        edits.iter().for_each(|edit| edit.apply(&mut bytes));
        let _ = ticks_to_csv(&bytes[..], std::io::sink());
    }
}
