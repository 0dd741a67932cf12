//! From the bytes of a configuration to a controller.
//!
//! Nothing in the image takes more stack. Each step is out of line, so that their needs do not
//! add up, and leaves its result in static memory.

use painleve_firmware::{Configuration, Controller};

/// Decodes a configuration; leaves none if the bytes are none.
#[inline(never)]
pub fn decode(configuration: &mut Option<Configuration>, bytes: &[u8]) {
    *configuration = None;
    if let Ok(decoded) = postcard::from_bytes(bytes) {
        *configuration = Some(decoded);
    }
}

/// Makes a controller; leaves none if the configuration is out of range.
#[inline(never)]
pub fn make(controller: &mut Option<Controller>, configuration: &Configuration) {
    *controller = None;
    if let Ok(made) = Controller::new(configuration) {
        *controller = Some(made);
    }
}
