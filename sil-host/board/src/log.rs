//! Decodes the defmt log of an image.

use std::io::Read;
use std::path::Path;

use defmt_decoder::DecodeError;
use painleve_files::input_file;
use painleve_process::terminal::warn;

use super::BoardError;

/// Why an image gives no table of messages.
#[derive(Debug, thiserror::Error)]
pub enum LogTableError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] std::io::Error),
    /// The table cannot be decoded.
    #[error(transparent)]
    Damaged(Box<dyn std::error::Error + Send + Sync>),
    /// The image has no table.
    #[error("no defmt table in it")]
    Missing,
}

/// The table of an image's messages. The image sends numbers; the text is in the table.
pub struct LogTable(defmt_decoder::Table);

impl LogTable {
    /// Reads the table from an image.
    ///
    /// # Errors
    /// [`BoardError::Image`] if the image has no table.
    pub fn of_image(image: &Path) -> Result<Self, BoardError> {
        Self::read(image).map_err(|source| BoardError::Image {
            path: image.into(),
            source,
        })
    }

    fn read(image: &Path) -> Result<Self, LogTableError> {
        let bytes = input_file::bytes(image, input_file::MOST_IMAGE_BYTES)?;
        defmt_decoder::Table::parse(&bytes)
            .map_err(|error| LogTableError::Damaged(error.into()))?
            .map(Self)
            .ok_or(LogTableError::Missing)
    }

    /// Prints the log in `output` on stderr until it ends, in its own thread.
    pub fn print_from(self, mut output: impl Read + Send + 'static) {
        std::thread::spawn(move || {
            let mut decoder = self.0.new_stream_decoder();
            let mut bytes = [0; 1024];
            while let Ok(length @ 1..) = output.read(&mut bytes) {
                decoder.received(&bytes[..length]);
                loop {
                    match decoder.decode() {
                        Ok(frame) => warn(format_args!("board: {}", frame.display(false))),
                        // The stream resynchronises at the next frame.
                        Err(DecodeError::Malformed) => {}
                        Err(DecodeError::UnexpectedEof) => break,
                    }
                }
            }
        });
    }
}
