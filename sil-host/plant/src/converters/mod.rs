//! Converters between the plant's physical quantities and the controller's integers.
//!
//! - [`noise`]: seeded noise, one stream per channel
//! - [`encoder`]: joint encoders with resolution, offset, noise and latency
//! - [`force_cell`]: f_n and f_t with resolution, range and noise
//! - [`torque_stage`]: torque with resolution, saturation, lag and transport delay; [`torque_error`]: gain, ripple, cogging, pulses
//! - [`link_loss`]: frames lost in transit
//! - [`fault`]: timed faults of single channels
//!
//! All data on the link are exact integers. The controller knows the scalings
//! ([`ConverterSettings::scales`]) but not the noise.

pub mod encoder;
pub mod fault;
pub mod force_cell;
pub mod link_loss;
pub mod noise;
pub mod torque_error;
pub mod torque_stage;

use painleve_firmware::configuration::Converters;
use painleve_shared::counts::{EncoderCounts, EncoderScale, LinearScale};
use painleve_shared::mounting::Mounting;
use painleve_shared::settings;
use painleve_shared::stages::StageSettings;
use painleve_shared::winding::WindingSettings;

use encoder::EncoderSettings;
use fault::ChannelFaults;
use force_cell::ForceCellSettings;
use link_loss::LinkSettings;
use torque_stage::TorqueStageSettings;

settings! {
    /// Settings of all converters.
    #[derive(Copy)]
    pub struct ConverterSettings {
        /// Both joint encoders.
        encoder: EncoderSettings = EncoderSettings::default();
        /// Both axes of the force cell.
        force: ForceCellSettings = ForceCellSettings::default();
        /// Both torque stages.
        torque: TorqueStageSettings = TorqueStageSettings::default();
        /// The link to the controller and back.
        link: LinkSettings = LinkSettings::default();
        /// Timed faults of single channels.
        faults: ChannelFaults = ChannelFaults::default();
        /// Directions and zeros of the parts of a real arm; the simulated arm has none of them.
        mounting: Mounting = Mounting::default();
        /// Motors and gears of a real arm's torque stages; the simulated stages act on the joints.
        stages: StageSettings = StageSettings::default();
        /// Protection of a real arm's windings; the simulated stages stay cold.
        winding: WindingSettings = WindingSettings::default();
    }
}

impl ConverterSettings {
    /// Returns the scalings that the controller receives.
    pub fn scales(&self) -> Converters {
        Converters {
            encoders: self.encoder.scales(),
            force: LinearScale {
                bits: self.force.bits,
                range: self.force.range_n as f32,
            },
            torque: LinearScale {
                bits: self.torque.bits,
                range: self.torque.range_nm as f32,
            },
            mounting: self.mounting,
            stages: self.stages,
            winding: self.winding,
        }
    }
}

impl EncoderSettings {
    /// Returns the scalings of both encoders.
    fn scales(&self) -> [EncoderScale; 2] {
        self.offset_counts.map(|offset| EncoderScale {
            bits: self.bits,
            offset: EncoderCounts(offset),
        })
    }
}
