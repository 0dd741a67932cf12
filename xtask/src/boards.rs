//! The boards for which images are built: one folder each in `firmware/boards`, described by the
//! section `[package.metadata.board]` of its `Cargo.toml`.

use std::path::Path;

use serde_json::Value;

use crate::command::{ChoreError, answer, cargo, workspace};

/// A board, as its `Cargo.toml` describes it.
pub struct BoardPackage {
    /// Name of its crate.
    pub package: String,
    /// Names of its images, which are the crate's programs.
    pub images: Vec<String>,
    /// The chip, as probe-rs names it; `None` for a board that cannot be flashed.
    pub chip: Option<String>,
}

/// Returns all boards, sorted by folder name.
///
/// # Errors
/// If cargo cannot read the workspace.
pub fn all() -> Result<Vec<BoardPackage>, ChoreError> {
    let packages = packages(&workspace().join("Cargo.toml"))?;
    let mut boards: Vec<_> = packages
        .iter()
        .filter(|package| package["metadata"]["board"].is_object())
        .collect();
    boards.sort_by_key(|package| package["manifest_path"].as_str());
    Ok(boards.into_iter().map(board).collect())
}

/// Returns the packages of the workspace with this manifest, as described by `cargo metadata`.
///
/// # Errors
/// If cargo cannot read the workspace.
pub fn packages(manifest: &Path) -> Result<Vec<Value>, ChoreError> {
    let manifest = manifest.to_string_lossy();
    let of = ["--manifest-path", &manifest];
    let metadata = ["metadata", "--no-deps", "--format-version", "1"];
    let metadata = answer(&cargo(), &[&metadata[..], &of].concat())?;
    let mut metadata: Value = serde_json::from_str(&metadata)
        .map_err(|cause| ChoreError(format!("`cargo metadata`: {cause}")))?;
    match metadata["packages"].take() {
        Value::Array(packages) => Ok(packages),
        _ => Err(ChoreError("`cargo metadata` lists no packages".into())),
    }
}

fn board(package: &Value) -> BoardPackage {
    let is_image = |target: &&Value| target["kind"] == serde_json::json!(["bin"]);
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    BoardPackage {
        package: text(&package["name"]),
        images: package["targets"]
            .as_array()
            .into_iter()
            .flatten()
            .filter(is_image)
            .map(|target| text(&target["name"]))
            .collect(),
        chip: package["metadata"]["board"]["chip"]
            .as_str()
            .map(str::to_owned),
    }
}
