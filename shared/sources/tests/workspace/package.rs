//! The crates that are useful without this workspace can be packaged: none of them needs a file outside its folder.

use std::path::Path;
use std::process::Command;

const PUBLISHED: [&str; 4] = [
    "painleve-sources",
    "painleve-shared",
    "painleve-firmware",
    "painleve-drivers",
];

#[test]
fn published_crates_can_be_packaged_and_read_no_siblings() {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let output = Command::new(env!("CARGO"))
        .args(["package", "--no-verify", "--allow-dirty", "--offline"])
        .args(PUBLISHED.map(|name| format!("--package={name}")))
        .current_dir(&workspace)
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    for folder in ["shared", "shared/sources", "firmware", "firmware/drivers"] {
        let script = workspace.join(folder).join("build.rs");
        let script = std::fs::read_to_string(script).unwrap_or_default();
        assert!(
            !script.contains("../"),
            "{folder}/build.rs reads its siblings"
        );
    }
}
