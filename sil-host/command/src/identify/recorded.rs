//! Slides from files: records of drives and runs, or their tables.

use std::io::{BufReader, Read};
use std::path::PathBuf;
use std::str::FromStr;

use clap::ValueEnum;
use csv::StringRecord;
use painleve_commission::identification::{SlideTick, slide_of};
use painleve_files::input_file;
use painleve_identify::Slide;
use painleve_plant::scenario::Scenario;
use painleve_record::csv_table::TableReader;
use painleve_record::export::read_as_table;
use painleve_record::mcap_log::Source;
use painleve_record::run_table::MOST_TICKS;
use painleve_shared::counts::{EncoderCounts, ForceCounts, TorqueCounts};
use painleve_shared::frame::SensorFrame;
use painleve_study_core::options::PostureOption;

use super::super::CommandError;
use super::super::given_scenario;
use super::super::output_error::InputError;

/// Columns of the table that a slide needs.
const COLUMNS: [&str; 6] = [
    "sensor.joint1_counts",
    "sensor.joint2_counts",
    "sensor.tangential_force_counts",
    "sensor.normal_force_counts",
    "actuator.u1_counts",
    "actuator.u2_counts",
];

/// Keys that say what the counts and ticks of these columns mean.
const SCALES: [&str; 7] = [
    "converters.encoder.bits",
    "converters.encoder.offset_counts",
    "converters.force.bits",
    "converters.force.range_n",
    "converters.torque.bits",
    "converters.torque.range_nm",
    "run.tick_hz",
];

/// Column with the control tick; the rows of a table without it are counted.
const TICK: &str = "sensor.tick";

/// Column with the supervisor's state, and the states in which a slide counts. A table without it counts as a whole.
const STATE: (&str, [&str; 2]) = ("actuator.state", ["tracking", "lift-off"]);

/// A recorded slide.
#[derive(Clone, Debug)]
pub struct Recorded {
    posture: PostureOption,
    path: PathBuf,
}

impl FromStr for Recorded {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (posture, path) = text.split_once('=').ok_or(
            "expected a posture and a file, for example elbow-up=slide.mcap or elbow-down=slide.csv",
        )?;
        Ok(Self {
            posture: PostureOption::from_str(posture, false)
                .map_err(|_| format!("{posture}: a posture is elbow-up or elbow-down"))?,
            path: path.into(),
        })
    }
}

impl Recorded {
    /// Reads the slide.
    ///
    /// # Errors
    /// [`InputError`] if the file cannot be read, has no such columns, or is the record of an arm with other scales.
    pub fn read(&self, scenario: &Scenario) -> Result<Slide, CommandError> {
        let ticks = self.ticks().map_err(|reason| InputError::Slide {
            path: self.path.clone(),
            reason,
        })?;
        if !self.is_table() {
            self.check_scales(scenario)?;
        }
        let whole = ticks.len();
        Ok(slide_of(scenario, self.posture.into(), ticks, whole))
    }

    fn is_table(&self) -> bool {
        self.path.extension().is_some_and(|it| it == "csv")
    }

    /// Returns whether its record says that a simulation has made it; a table does not tell.
    pub fn is_simulated(&self) -> bool {
        !self.is_table()
            && given_scenario::notes_of_record(&self.path).is_ok_and(|notes| {
                notes
                    .get("source")
                    .is_some_and(|source| source == Source::Simulation.name())
            })
    }

    /// Checks that the counts of a record mean what the scenario says; a table does not tell.
    fn check_scales(&self, scenario: &Scenario) -> Result<(), CommandError> {
        let differences = given_scenario::of_record(&self.path)?.differences(scenario);
        let other = differences
            .iter()
            .find(|it| SCALES.contains(&it.key.as_str()));
        other.map_or(Ok(()), |other| {
            let [key, recorded, given] = other.cells();
            Err(InputError::Slide {
                path: self.path.clone(),
                reason: format!("its {key} is {recorded}, that of the scenario {given}"),
            }
            .into())
        })
    }

    fn ticks(&self) -> Result<Vec<SlideTick>, String> {
        let file = input_file::open(&self.path).map_err(|error| error.to_string())?;
        if self.is_table() {
            return of_table(BufReader::new(file));
        }
        let file = BufReader::with_capacity(1 << 20, file);
        read_as_table(file, |_| Ok(()), of_table).map_err(|error| error.to_string())?
    }
}

/// Checks that each slide is given once, whatever its file: one that counts twice would seem to be known better.
///
/// # Errors
/// [`InputError::Slide`] for a slide that is given again.
pub fn check_distinct(given: &[Recorded], slides: &[Slide]) -> Result<(), InputError> {
    for (index, slide) in slides.iter().enumerate() {
        let is_same = |it: &Slide| !it.readings.is_empty() && it.readings == slide.readings;
        if let Some(earlier) = slides[..index].iter().position(is_same) {
            let other = given[earlier].path.display();
            return Err(InputError::Slide {
                path: given[index].path.clone(),
                reason: format!("it is the slide of {other}; give each slide once"),
            });
        }
    }
    Ok(())
}

/// Reads the ticks of a table.
fn of_table(table: impl Read) -> Result<Vec<SlideTick>, String> {
    let mut reader = TableReader::new(table);
    let header = reader.header().map_err(|error| error.to_string())?;
    let place = |name: &str| header.iter().position(|column| column == name);
    let mut places = [0; COLUMNS.len()];
    for (at, name) in places.iter_mut().zip(COLUMNS) {
        *at = place(name).ok_or_else(|| format!("it has no column {name}"))?;
    }
    let (state, counted) = STATE;
    let (state, tick) = (place(state), place(TICK));
    let (mut ticks, mut row) = (Vec::new(), StringRecord::new());
    for number in 0_u32.. {
        if !reader.read(&mut row).map_err(|error| error.to_string())? {
            break;
        }
        if state.is_some_and(|at| row.get(at).is_none_or(|it| !counted.contains(&it))) {
            continue;
        }
        let tick = match tick.and_then(|at| row.get(at)) {
            Some(text) => text
                .parse()
                .map_err(|_| format!("{TICK} = {text:?} is not a whole number"))?,
            None => number,
        };
        let before = ticks.last().map(|it: &SlideTick| it.sensor.tick);
        if before.is_some_and(|before| tick.wrapping_sub(before).wrapping_sub(1) > u32::MAX / 2) {
            return Err(format!(
                "{TICK} = {tick} does not come after the tick before it"
            ));
        }
        let mut counts = [0_i64; COLUMNS.len()];
        for (value, (at, name)) in counts.iter_mut().zip(places.into_iter().zip(COLUMNS)) {
            let text = row.get(at).unwrap_or_default();
            *value = text
                .parse()
                .map_err(|_| format!("{name} = {text:?} is not a whole number"))?;
        }
        let [joint_1, joint_2, tangential, normal, torque_1, torque_2] = counts;
        // Whatever does not fit is out of every converter's range, too.
        let joint = |counts| EncoderCounts(u32::try_from(counts).unwrap_or(u32::MAX));
        let force = |counts| ForceCounts(i32::try_from(counts).unwrap_or(i32::MAX));
        let torque = |counts| TorqueCounts(i32::try_from(counts).unwrap_or(i32::MAX));
        if ticks.len() >= MOST_TICKS {
            return Err(format!("it has more than {MOST_TICKS} ticks of a slide"));
        }
        ticks.push(SlideTick {
            sensor: SensorFrame {
                tick,
                joints: [joint(joint_1), joint(joint_2)],
                tangential_force: force(tangential),
                normal_force: force(normal),
                ..SensorFrame::default()
            },
            torques: [torque(torque_1), torque(torque_2)],
        });
    }
    Ok(ticks)
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::Posture;

    #[test]
    fn a_table_gives_the_frames_of_the_ticks_that_track_or_have_lost_the_belt() {
        let table = "time_s,sensor.joint1_counts,sensor.joint2_counts,sensor.tangential_force_counts,sensor.normal_force_counts,\
                     actuator.u1_counts,actuator.u2_counts,actuator.state,sensor.tick\n0,1,2,3,7,1,1,armed,70\n\
                     0.001,4,5,8,-6,9,-3,tracking,71\n0.003,6,5,0,0,9,-3,lift-off,73\n";
        let ticks = of_table(table.as_bytes()).unwrap();
        let [SlideTick { sensor, torques }, lost] = ticks[..] else {
            panic!("{ticks:?}");
        };
        assert_eq!([sensor.tick, lost.sensor.tick], [71, 73]);
        assert_eq!(sensor.joints, [EncoderCounts(4), EncoderCounts(5)]);
        assert_eq!(sensor.tangential_force, ForceCounts(8));
        assert_eq!(sensor.normal_force, ForceCounts(-6));
        assert_eq!(torques, [TorqueCounts(9), TorqueCounts(-3)]);
    }

    #[test]
    fn what_is_missing_or_no_number_is_named() {
        let missing = of_table("time_s,sensor.joint1_counts\n0,1\n".as_bytes());
        assert_eq!(
            missing.unwrap_err(),
            "it has no column sensor.joint2_counts"
        );
        let backwards = format!(
            "{},{TICK}\n1,2,3,4,5,6,8\n1,2,3,4,5,6,7\n",
            COLUMNS.join(",")
        );
        assert_eq!(
            of_table(backwards.as_bytes()).unwrap_err(),
            "sensor.tick = 7 does not come after the tick before it"
        );
        let endless = of_table(std::io::repeat(b'1').take(1 << 20));
        assert_eq!(endless.unwrap_err(), "a row has more than 65536 bytes");
        let header = COLUMNS.join(",");
        let wrong = of_table(format!("{header}\n1,x,3,4,5,6\n").as_bytes());
        assert_eq!(
            wrong.unwrap_err(),
            "sensor.joint2_counts = \"x\" is not a whole number"
        );
    }

    #[test]
    fn a_slide_that_is_given_again_is_refused_whatever_its_file() {
        let of = |counts: u32| {
            let table = format!("{}\n{counts},2,3,7,1,1\n", COLUMNS.join(","));
            let ticks = of_table(table.as_bytes()).unwrap();
            slide_of(&Scenario::default(), Posture::ElbowDown, ticks, 1)
        };
        let given = ["elbow-down=a.mcap", "elbow-up=b.csv"].map(|it| it.parse().unwrap());
        let refused = |slides: [Slide; 2]| check_distinct(&given, &slides).err();
        assert!(refused([of(1), of(4)]).is_none());
        let same = refused([of(1), of(1)]).unwrap().to_string();
        assert!(same.contains("b.csv: it is the slide of a.mcap"), "{same}");
    }

    #[test]
    fn a_slide_is_a_posture_and_a_file() {
        assert!("elbow-up=a.mcap".parse::<Recorded>().is_ok());
        assert!("a.mcap".parse::<Recorded>().is_err());
        let wrong = "elbow-left=a.mcap".parse::<Recorded>().unwrap_err();
        assert_eq!(wrong, "elbow-left: a posture is elbow-up or elbow-down");
    }
}
