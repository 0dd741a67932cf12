//! The image's code and its source locations.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use object::{Object, ObjectSection, ObjectSymbol, SectionKind};

use crate::cycles::Chip;
use crate::{BoundError, ImageError};

/// The code of an ELF file.
pub struct Image {
    /// For messages; empty for code without an ELF file.
    pub(crate) path: PathBuf,
    /// The chip that executes it.
    pub chip: &'static Chip,
    sections: Vec<(u32, Vec<u8>)>,
    functions: BTreeMap<u32, String>,
    /// Addresses by name: the linker gives functions with equal code one address.
    addresses: BTreeMap<String, u32>,
    /// Addresses at which code and data alternate: true for code.
    marks: BTreeMap<u32, bool>,
    /// `None` for code without an ELF file.
    lines: Option<addr2line::Loader>,
}

/// The source function of an instruction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Name of the function.
    pub function: String,
    /// File of the function.
    pub file: String,
    /// Line in the file, from 1; 0 if the compiler merged several lines.
    pub line: u32,
}

impl Image {
    /// Parses the ELF file `elf`, which was read from `path`.
    ///
    /// # Errors
    /// [`BoundError::Image`] naming the file.
    pub fn of(path: &Path, elf: &[u8]) -> Result<Self, BoundError> {
        Self::parse(path, elf).map_err(|source| BoundError::Image {
            path: path.to_owned(),
            source,
        })
    }

    fn parse(path: &Path, elf: &[u8]) -> Result<Self, ImageError> {
        let file = object::File::parse(elf)?;
        let mut sections = Vec::new();
        for section in file.sections().filter(|section| {
            matches!(
                section.kind(),
                SectionKind::Text | SectionKind::ReadOnlyData
            ) && section.address() != 0
        }) {
            let data = section.data()?;
            sections.push((section.address() as u32, data.to_vec()));
        }
        let (mut functions, mut marks) = (BTreeMap::new(), BTreeMap::new());
        let mut addresses = BTreeMap::new();
        for symbol in file.symbols() {
            let name = symbol.name().unwrap_or_default();
            let address = symbol.address() as u32;
            match name.get(..2) {
                Some("$t") => drop(marks.insert(address, true)),
                Some("$d") => drop(marks.insert(address, false)),
                _ if symbol.kind() == object::SymbolKind::Text => {
                    let name = format!("{:#}", rustc_demangle::demangle(name));
                    addresses.insert(name.clone(), address & !1);
                    functions.insert(address & !1, name);
                }
                _ => {}
            }
        }
        let lines = addr2line::Loader::new(path).map_err(ImageError::Lines)?;
        let first = sections.iter().map(|(address, _)| *address).min();
        let chip = first.and_then(Chip::of_program);
        Ok(Self {
            path: path.to_owned(),
            chip: chip.ok_or(ImageError::UnknownChip)?,
            sections,
            functions,
            addresses,
            marks,
            lines: Some(lines),
        })
    }

    /// Returns the functions: where each begins and ends, and its name.
    pub fn functions(&self) -> impl Iterator<Item = (u32, u32, &str)> {
        /// No function is longer.
        const LONGEST: u32 = 1 << 16;
        let next = self.functions.keys().skip(1).copied().chain([u32::MAX]);
        let functions = self.functions.iter().zip(next);
        functions.map(|((start, name), next)| (*start, next.min(start + LONGEST), name.as_str()))
    }

    /// Creates an image of one function's code, without an ELF file.
    #[cfg(test)]
    pub(crate) fn of_code(address: u32, code: &[u8], function: &str) -> Self {
        Self {
            path: PathBuf::new(),
            chip: Chip::of_program(address).unwrap(),
            sections: vec![(address, code.to_vec())],
            functions: BTreeMap::from([(address, function.to_owned())]),
            addresses: BTreeMap::from([(function.to_owned(), address)]),
            marks: BTreeMap::new(),
            lines: None,
        }
    }

    /// Adds a function that begins at an address.
    #[cfg(test)]
    pub(crate) fn begin_function(&mut self, address: u32, name: &str) {
        self.functions.insert(address, name.to_owned());
    }

    /// Marks the start of code or of data at an address.
    #[cfg(test)]
    pub(crate) fn mark(&mut self, address: u32, is_code: bool) {
        self.marks.insert(address, is_code);
    }

    /// Returns the bytes from an address on, if it is code or constant data.
    pub fn bytes(&self, address: u32) -> Option<&[u8]> {
        self.sections.iter().find_map(|(start, bytes)| {
            let offset = address.checked_sub(*start)? as usize;
            bytes.get(offset..).filter(|rest| !rest.is_empty())
        })
    }

    /// Returns the end of the data that starts at `address`.
    pub fn end_of_data(&self, address: u32) -> Option<u32> {
        let is_data = self.marks.range(..=address).next_back()?.1;
        if *is_data {
            return None;
        }
        let mut later = self.marks.range(address + 1..);
        later.find(|(_, is_code)| **is_code).map(|(at, _)| *at)
    }

    /// Returns the address of a function.
    pub fn function(&self, name: &str) -> Option<u32> {
        self.addresses.get(name).copied()
    }

    /// Returns the address of the only function whose name contains `part`; `None` if there are several, or if
    /// the linker gives another function the same address because their code is equal.
    pub fn only_function(&self, part: &str) -> Option<u32> {
        let mut named = self.addresses.iter().filter(|(it, _)| it.contains(part));
        let (_, address) = named.next()?;
        let mut there = self.addresses.values().filter(|it| *it == address);
        (named.next().is_none() && there.nth(1).is_none()).then_some(*address)
    }

    /// Returns the name of the function that contains an address.
    pub fn name(&self, address: u32) -> &str {
        let before = self.functions.range(..=address).next_back();
        before.map_or("?", |(_, name)| name)
    }

    /// Returns the source functions of an instruction, the innermost inlined one first; without
    /// line information, the function that contains it.
    pub fn frames(&self, address: u32) -> Vec<Frame> {
        let mut all = Vec::new();
        let Some(lines) = &self.lines else {
            return vec![Frame {
                function: self.name(address).to_owned(),
                file: String::new(),
                line: 0,
            }];
        };
        let Ok(mut frames) = lines.find_frames(u64::from(address)) else {
            return all;
        };
        while let Ok(Some(frame)) = frames.next() {
            let function = frame.function.and_then(|name| {
                let name = name.demangle().ok()?;
                Some(name.into_owned())
            });
            let (file, line) = frame
                .location
                .map_or((None, None), |location| (location.file, location.line));
            all.push(Frame {
                function: function.unwrap_or_default(),
                file: short(file.unwrap_or_default()),
                line: line.unwrap_or_default(),
            });
        }
        all
    }
}

/// Returns a path without the folders of the machine that built the image.
fn short(path: &str) -> String {
    for (marker, keep) in [("/firmware/", 1), ("/shared/", 1), ("/library/", 1)] {
        if let Some(at) = path.rfind(marker) {
            return path[at + keep..].to_owned();
        }
    }
    let mut parts: Vec<&str> = path.rsplit('/').take(4).collect();
    parts.reverse();
    parts.join("/")
}
