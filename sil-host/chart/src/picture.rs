//! Figures as SVG, or converted to PNG or PDF by librsvg's program `rsvg-convert`.
//!
//! The extension of the figure's file selects the format. The program is found at run time, because a
//! renderer with its fonts would cost every build more than all other output formats together.

use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use painleve_process::lifetime::{Signal, end_with_parent};

const CONVERTER: &str = "rsvg-convert";

/// Pixels of a PNG per CSS pixel of the figure.
const PNG_ZOOM: &str = "2";

/// Why a figure cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The extension names another format.
    #[error("figures end with .svg, .png or .pdf, not with .{0}")]
    Extension(String),
    /// The converter is not installed.
    #[error(
        "a .{0} is converted by {CONVERTER}, which does not start: install it (Debian: apt-get install librsvg2-bin), \
         or let the name end with .svg"
    )]
    NoConverter(&'static str),
    /// The converter failed.
    #[error("{CONVERTER} cannot convert the figure: {0}")]
    Failed(String),
}

/// Returns the converter's name of the format, `None` for SVG.
fn format(path: &Path) -> Result<Option<&'static str>, PictureError> {
    let Some(extension) = path.extension() else {
        return Ok(None);
    };
    match extension.to_string_lossy().to_ascii_lowercase().as_str() {
        "svg" => Ok(None),
        "png" => Ok(Some("png")),
        "pdf" => Ok(Some("pdf")),
        _ => Err(PictureError::Extension(extension.display().to_string())),
    }
}

/// Checks the path of a figure: `.svg`, or `.png` or `.pdf` if they can be converted; without an
/// extension it is an SVG file.
///
/// # Errors
/// [`PictureError`] if the extension is another one, or the converter does not start.
pub fn path(path: PathBuf) -> Result<PathBuf, PictureError> {
    if let Some(format) = format(&path)? {
        let mut version = Command::new(CONVERTER);
        let version = version.arg("--version").stdin(Stdio::null());
        version
            .output()
            .map_err(|_| PictureError::NoConverter(format))?;
    }
    Ok(path)
}

/// Returns the content of a figure's file, in the format of its path's extension. The same figure gives the same
/// bytes.
///
/// # Errors
/// [`PictureError`] if it cannot be converted.
pub fn encoded(path: &Path, svg: String) -> Result<Vec<u8>, PictureError> {
    let Some(format) = format(path)? else {
        return Ok(svg.into_bytes());
    };
    let zoom = if format == "png" { PNG_ZOOM } else { "1" };
    let mut converter = Command::new(CONVERTER);
    converter
        .args(["--format", format, "--zoom", zoom])
        // Otherwise a PDF holds the present time.
        .env("SOURCE_DATE_EPOCH", "0")
        // Ctrl-C is for the run: a figure that is being converted at its end becomes whole.
        .process_group(0)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut converter = end_with_parent(&mut converter, Signal::SIGKILL)
        .spawn()
        .map_err(|_| PictureError::NoConverter(format))?;
    // It reads its whole input before it writes. If it ends earlier, its status and message say why.
    if let Some(mut input) = converter.stdin.take() {
        let _ = input.write_all(svg.as_bytes());
    }
    let output = converter
        .wait_with_output()
        .map_err(|error| PictureError::Failed(error.to_string()))?;
    if !output.status.success() {
        let reason = format!("{} ({})", in_one_line(&output.stderr), output.status);
        return Err(PictureError::Failed(reason));
    }
    Ok(output.stdout)
}

/// Returns a program's message of several lines as one.
fn in_one_line(message: &[u8]) -> String {
    let message = String::from_utf8_lossy(message);
    let lines = message.lines().map(str::trim);
    let lines: Vec<&str> = lines.filter(|line| !line.is_empty()).collect();
    lines.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_of_the_converter_is_one_line() {
        let message = "Error reading SVG:\n  XML parse error\r\n\nline 3\n";
        assert_eq!(
            in_one_line(message.as_bytes()),
            "Error reading SVG:; XML parse error; line 3"
        );
    }

    #[test]
    fn the_extension_selects_the_format() {
        for (name, expected) in [
            ("a.svg", None),
            ("a.SVG", None),
            ("a", None),
            ("a.b/c", None),
            ("a.png", Some("png")),
            ("a.PDF", Some("pdf")),
        ] {
            assert_eq!(format(Path::new(name)).unwrap(), expected, "{name}");
        }
        let message = path("a.jpeg".into()).unwrap_err().to_string();
        assert_eq!(
            message,
            "figures end with .svg, .png or .pdf, not with .jpeg"
        );
    }

    #[test]
    fn an_svg_file_holds_the_figure_as_it_is() {
        let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\"/>";
        assert_eq!(
            encoded(Path::new("a.svg"), svg.into()).unwrap(),
            svg.as_bytes()
        );
    }
}
