//! Checks that relative links of the pages in the root and in `docs/` lead to existing files and headings, that paths in these
//! pages exist, that the names of settings and tests occur in the source, and that the pages stay short.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .canonicalize()
        .unwrap()
}

/// Returns the pages of the documentation and those beside the README.
fn pages() -> Vec<PathBuf> {
    let mut pages = Vec::new();
    for folder in [workspace(), workspace().join("docs")] {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "md") {
                pages.push(path);
            }
        }
    }
    pages
}

/// Returns the pages of the lab book, which keeps what was tried.
fn lab_book() -> Vec<PathBuf> {
    let folder = fs::read_dir(workspace().join("docs/lab-book")).unwrap();
    folder.map(|entry| entry.unwrap().path()).collect()
}

/// Returns the text of a page without its code blocks.
fn prose(page: &Path) -> String {
    let text = fs::read_to_string(page).unwrap();
    text.split("```").step_by(2).collect()
}

/// Returns the anchors of a page's headings, as GitHub makes them.
fn anchors(page: &Path) -> BTreeSet<String> {
    prose(page)
        .lines()
        .filter_map(|line| {
            line.trim_start_matches('#')
                .strip_prefix(' ')
                .filter(|_| line.starts_with('#'))
        })
        .map(|heading| {
            let kept = heading.trim().to_lowercase();
            kept.chars()
                .filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'))
                .map(|c| if c == ' ' { '-' } else { c })
                .collect()
        })
        .collect()
}

#[test]
fn relative_links_lead_to_existing_files_and_headings() {
    let mut broken = Vec::new();
    for page in pages().into_iter().chain(lab_book()) {
        let text = prose(&page);
        for part in text.split("](").skip(1) {
            let target = part.split(')').next().unwrap();
            if target.contains("://") {
                continue;
            }
            let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
            let file = if path.is_empty() {
                page.clone()
            } else {
                page.parent().unwrap().join(path)
            };
            let is_found = file.exists()
                && (anchor.is_empty()
                    || !path.ends_with(".md") && !path.is_empty()
                    || anchors(&file).contains(anchor));
            if !is_found {
                broken.push(format!("{}: {target}", page.display()));
            }
        }
    }
    assert!(broken.is_empty(), "broken links: {broken:#?}");
}

/// Collects the paths of all files and folders below a folder, without those that a build or a run makes.
fn collect_paths(folder: &Path, paths: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if ["target", "out", ".git"].contains(&name.as_str()) {
            continue;
        }
        if path.is_dir() {
            collect_paths(&path, paths);
        }
        paths.push(path);
    }
}

/// A path is a word with a slash in backticks, such as `firmware/src/lib.rs`, or the name of a Rust file. It may begin in
/// any folder. Paths of the system, of the output and of what somebody is told to add are left out.
#[test]
fn paths_in_the_pages_exist() {
    let mut paths = Vec::new();
    collect_paths(&workspace(), &mut paths);
    let mut missing = Vec::new();
    for page in pages() {
        for name in prose(&page).split('`').skip(1).step_by(2) {
            let is_path = (name.contains('/') || name.ends_with(".rs"))
                && !["/", "out/", "target/"]
                    .iter()
                    .any(|it| name.starts_with(it))
                && !name.contains([' ', '<', ':'])
                && !["NAME", "FAMILY"].iter().any(|it| name.contains(it));
            if is_path && !paths.iter().any(|path| path.ends_with(name)) {
                missing.push(format!("{}: {name}", page.display()));
            }
        }
    }
    assert!(missing.is_empty(), "these paths do not exist: {missing:#?}");
}

/// Collects the text of all source files below a folder.
fn source(folder: &Path, text: &mut String) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            if name != "target" && !name.starts_with('.') {
                source(&path, text);
            }
        } else if [".rs", ".toml", ".json", ".py", ".c", ".sh"]
            .iter()
            .any(|extension| name.ends_with(extension))
        {
            text.push_str(&fs::read_to_string(&path).unwrap_or_default());
        }
    }
}

/// A name is a word of at least three parts in backticks, such as `lift_off_limit_s`; a table may
/// shorten the name of a test with an ellipsis.
#[test]
fn names_in_the_pages_occur_in_the_source() {
    let mut text = String::new();
    for folder in [
        "shared", "firmware", "sil-host", "tests", "tools", "xtask", "examples",
    ] {
        source(&workspace().join(folder), &mut text);
    }
    let words: BTreeSet<&str> = text
        .split(|c: char| !c.is_ascii_alphanumeric() && c != '_')
        .collect();
    let mut unknown = Vec::new();
    // The changelog also names what is gone.
    let present = |page: &PathBuf| !page.ends_with("CHANGELOG.md");
    for page in pages().into_iter().filter(present) {
        for name in prose(&page).split('`').skip(1).step_by(2) {
            let start = name.trim_end_matches('…').trim_end_matches('_');
            let is_name = start.matches('_').count() >= 2
                && start
                    .chars()
                    .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
            let is_known = if name.ends_with('…') {
                words.iter().any(|word| word.starts_with(start))
            } else {
                words.contains(start)
            };
            if is_name && !is_known {
                unknown.push(format!("{}: {name}", page.display()));
            }
        }
    }
    assert!(unknown.is_empty(), "not in the source: {unknown:#?}");
}

/// The book keeps the source of a formula for copying, where Markdown would read `'_P … }_\mathrm` as emphasis, and hide
/// the text between two formulas.
#[test]
fn no_formula_begins_an_emphasis() {
    let mut wrong = Vec::new();
    for page in pages() {
        let words: String = prose(&page).split('`').step_by(2).collect();
        for formula in words.split('$').skip(1).step_by(2) {
            let letters: Vec<char> = formula.chars().collect();
            let opens = |three: &[char]| {
                let [before, '_', after] = three else {
                    return false;
                };
                !before.is_alphanumeric() && !after.is_whitespace()
            };
            if letters.windows(3).any(opens) {
                wrong.push(format!("{}: {formula}", page.display()));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "write a space after these underscores:\n{}",
        wrong.join("\n")
    );
}

/// The number of words that `docs/` may have, without the lab book.
const MOST_WORDS: usize = 25_000;

/// Returns the number of words of a page, counted as `wc -w` does: formulas, code and the marks of tables are words, too.
fn words(page: &Path) -> usize {
    fs::read_to_string(page).unwrap().split_whitespace().count()
}

/// A reader who has to find something among more words does not. History belongs to the lab book.
#[test]
fn the_pages_stay_short() {
    let docs = workspace().join("docs");
    let in_docs = |page: &PathBuf| page.starts_with(&docs);
    let sum: usize = pages()
        .iter()
        .filter(|page| in_docs(page))
        .map(|page| words(page))
        .sum();
    assert!(
        sum <= MOST_WORDS,
        "{sum} words in docs/, more than {MOST_WORDS}"
    );
    // One screen.
    let readme = words(&workspace().join("README.md"));
    assert!(readme <= 700, "{readme} words in README.md");
    for name in ["studies.md", "beyond-the-paper.md"] {
        let words = words(&docs.join(name));
        assert!(words <= 3_500, "{words} words in docs/{name}");
    }
}

/// A range takes an en dash, "99.2–99.5 %", or "to" beside a sign.
#[test]
fn no_ellipsis_stands_between_two_numbers() {
    let mut wrong = Vec::new();
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for (at, _) in text.match_indices(" … ") {
            let before = text[..at]
                .split_whitespace()
                .next_back()
                .unwrap_or_default();
            let after = text[at + " … ".len()..].trim_start_matches(['−', '-', '±']);
            let is_number = |text: &str| text.contains(|c: char| c.is_ascii_digit());
            if is_number(before) && after.starts_with(|c: char| c.is_ascii_digit()) {
                let line = text[..at].matches('\n').count() + 1;
                wrong.push(format!("{}:{line}: {before} …", page.display()));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "write a range with an en dash: {wrong:#?}"
    );
}
