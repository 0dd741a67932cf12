//! Inside every crate, files import each other without circles, and so do folders: each can be read after those that it
//! builds on.
//!
//! An import is a path that begins with `crate`, `self`, `super` or a child module. A path through a re-export leads to
//! the file that declares the name; a re-export itself is no import. A module and its children may import each other,
//! because it is their folder, and tests may import anything.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// A module's path from the crate's root, or that of a name in it.
type Names = Vec<String>;

/// A file of a crate.
#[derive(Default)]
struct Module {
    /// Paths that it imports.
    imports: Vec<Names>,
    /// Names that it re-exports, and the paths that lead to them; `*` for all of a module's.
    exports: Vec<(String, Names)>,
}

type Crate = BTreeMap<Names, Module>;

/// Collects all files with an ending below a folder, without those of builds and tests.
fn collect(folder: &Path, ending: &str, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let is_test = name == "tests" || name == "tests.rs";
        if path.is_dir() && !is_test && name != "target" && !name.starts_with('.') {
            collect(&path, ending, files);
        } else if path.is_file() && !is_test && name.ends_with(ending) {
            files.push(path);
        }
    }
}

/// Returns the module that a file of `src` holds.
fn module_of(src: &Path, file: &Path) -> Names {
    let relative = file.strip_prefix(src).unwrap().with_extension("");
    let mut names: Names = relative
        .iter()
        .map(|name| name.to_string_lossy().into_owned())
        .collect();
    if matches!(
        names.last().map(String::as_str),
        Some("mod" | "lib" | "main")
    ) {
        names.pop();
    }
    names
}

/// Returns a file's code without comments and without the tests at its end.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap();
    let lines = text.lines().map(|line| line.split("//").next().unwrap());
    lines.collect::<Vec<_>>().join("\n")
}

/// Returns visibility and beginning of a `use` statement.
fn statement(line: &str) -> Option<(&str, &str)> {
    let (visibility, tree) = line.trim().split_once("use ")?;
    let is_visibility =
        visibility.is_empty() || visibility.starts_with("pub") && visibility.ends_with(' ');
    // A line of a text may begin with this word as well.
    let path = tree.split(['{', ';']).next()?;
    let is_path = path.split(" as ").all(|name| !name.trim().contains(' '));
    (is_visibility && is_path).then_some((visibility, tree))
}

/// Expands `a::{b, c as d}` into its paths, each with the name that it introduces.
fn expand(tree: &str, before: &[String], paths: &mut Vec<(String, Names)>) {
    let tree = tree.trim();
    let brace = tree.find('{').unwrap_or(tree.len());
    let (path, renamed) = match tree[..brace].split_once(" as ") {
        Some((path, renamed)) => (path, Some(renamed.trim())),
        None => (&tree[..brace], None),
    };
    let parts = path.split("::").map(str::trim);
    let mut names = before.to_vec();
    names.extend(parts.filter(|part| !part.is_empty()).map(String::from));
    if brace == tree.len() {
        if names.last().is_some_and(|name| name == "self") && names.len() > 1 {
            names.pop();
        }
        let Some(last) = names.last() else { return };
        paths.push((renamed.unwrap_or(last).into(), names));
        return;
    }
    let inner = &tree[brace + 1..tree.rfind('}').unwrap()];
    let (mut depth, mut start) = (0, 0);
    for (index, letter) in inner.char_indices().chain([(inner.len(), ',')]) {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                expand(&inner[start..index], &names, paths);
                start = index + 1;
            }
            _ => {}
        }
    }
}

/// Returns the absolute path of a path in `module`; `None` if it leads out of the crate.
fn absolute(module: &Names, path: &[String], modules: &BTreeSet<Names>) -> Option<Names> {
    let (first, rest) = path.split_first()?;
    let mut base = module.clone();
    match first.as_str() {
        "crate" => base.clear(),
        "self" => {}
        "super" => drop(base.pop()?),
        _ => {
            base.push(first.clone());
            // The path of another crate, unless a child module has this name.
            modules.contains(&base).then_some(())?;
        }
    }
    let mut rest = rest;
    while let Some(("super", after)) = rest.split_first().map(|(name, after)| (&**name, after)) {
        base.pop()?;
        rest = after;
    }
    base.extend_from_slice(rest);
    Some(base)
}

fn read(src: &Path) -> Crate {
    let mut files = Vec::new();
    collect(src, ".rs", &mut files);
    files.retain(|file| !file.starts_with(src.join("bin")));
    let modules: BTreeSet<Names> = files.iter().map(|file| module_of(src, file)).collect();
    let mut found = Crate::new();
    for file in &files {
        let name = module_of(src, file);
        let module = found.entry(name.clone()).or_default();
        let text = code(&fs::read_to_string(file).unwrap());
        let mut other = String::new();
        let mut lines = text.lines();
        while let Some(line) = lines.next() {
            let Some((visibility, tree)) = statement(line) else {
                other.push_str(line);
                other.push('\n');
                continue;
            };
            let mut tree = tree.to_owned();
            while !tree.contains(';') {
                tree.push_str(lines.next().unwrap());
            }
            let mut paths = Vec::new();
            expand(tree.split(';').next().unwrap(), &[], &mut paths);
            for (introduced, path) in paths {
                let Some(path) = absolute(&name, &path, &modules) else {
                    continue;
                };
                if visibility.is_empty() {
                    module.imports.push(path);
                } else {
                    module.exports.push((introduced, path));
                }
            }
        }
        let is_name = |letter: char| letter.is_alphanumeric() || letter == '_' || letter == ':';
        for word in other.split(|letter: char| !is_name(letter) && letter != '$') {
            if ["crate::", "super::", "self::"]
                .iter()
                .any(|it| word.starts_with(it))
            {
                let path: Names = word.split("::").map(String::from).collect();
                module.imports.extend(absolute(&name, &path, &modules));
            }
        }
    }
    found
}

/// Returns the file that declares what a path leads to.
fn declared_in(path: &[String], modules: &Crate) -> Option<Names> {
    let inside = (0..=path.len())
        .rev()
        .find(|length| modules.contains_key(&path[..*length]))?;
    let (module, rest) = path.split_at(inside);
    let Some(name) = rest.first() else {
        return Some(module.to_vec());
    };
    for (introduced, target) in &modules[module].exports {
        if introduced == name {
            return declared_in(target, modules);
        }
    }
    Some(module.to_vec())
}

/// Neighbours in one folder, and those of them that each imports.
type Neighbours = BTreeMap<String, BTreeSet<String>>;

/// Returns the imports between the neighbours of every folder, files and folders alike.
fn folders(modules: &Crate) -> BTreeMap<Names, Neighbours> {
    let mut folders = BTreeMap::<Names, Neighbours>::new();
    for (name, module) in modules {
        for path in &module.imports {
            let Some(target) = declared_in(path, modules) else {
                continue;
            };
            let common = name
                .iter()
                .zip(&target)
                .take_while(|(one, other)| one == other)
                .count();
            if let (Some(one), Some(other)) = (name.get(common), target.get(common)) {
                let neighbours = folders.entry(name[..common].to_vec()).or_default();
                neighbours
                    .entry(one.clone())
                    .or_default()
                    .insert(other.clone());
            }
        }
    }
    folders
}

/// Returns a circle of imports, if there is one.
fn circle(mut left: Neighbours) -> Option<Vec<String>> {
    // Who imports nobody that is left is on no circle.
    loop {
        let importing: BTreeSet<String> = left.keys().cloned().collect();
        left.retain(|_, imports| !imports.is_disjoint(&importing));
        if left.len() == importing.len() {
            break;
        }
    }
    let mut way = vec![left.keys().next()?.clone()];
    loop {
        let next = left[way.last()?].iter().find(|it| left.contains_key(*it))?;
        if let Some(start) = way.iter().position(|name| name == next) {
            return Some(way.split_off(start));
        }
        way.push(next.clone());
    }
}

#[test]
fn files_and_folders_import_each_other_without_circles() {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut manifests = Vec::new();
    collect(&workspace, "Cargo.toml", &mut manifests);
    let mut circles = Vec::new();
    let mut imports = 0;
    for manifest in manifests {
        let src = manifest.parent().unwrap().join("src");
        if !src.is_dir() {
            continue;
        }
        for (folder, neighbours) in folders(&read(&src)) {
            imports += neighbours.values().map(BTreeSet::len).sum::<usize>();
            if let Some(circle) = circle(neighbours) {
                circles.push((src.join(folder.join("/")), circle.join(" → ")));
            }
        }
    }
    assert!(imports > 300, "only {imports} imports found");
    assert!(circles.is_empty(), "circles: {circles:#?}");
}
