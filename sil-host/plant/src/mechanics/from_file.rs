//! A setting that names a file, whose content is loaded together with the scenario.

use std::any::Any;
use std::cell::RefCell;
use std::ops::Deref;
use std::sync::Arc;

use painleve_shared::OutOfRange;
use painleve_shared::settings::{Bounds, Refused, SettingValue, Shape};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A file that a scenario has loaded.
type Loaded = (String, Arc<dyn Any + Send + Sync>);

thread_local! {
    /// The files of the scenarios written so far in [`without_files`]; `None` outside.
    static KEPT: RefCell<Option<Vec<Loaded>>> = const { RefCell::new(None) };
}

/// Runs `act`, in which no scenario reads a file: one that is written and read again keeps the content of the
/// files that it names, and every other file is refused. For requests from those who may not read what this
/// process may.
pub(crate) fn without_files<T>(act: impl FnOnce() -> T) -> T {
    let outer = KEPT.replace(Some(Vec::new()));
    let done = act();
    KEPT.set(outer);
    done
}

/// Refuses a file if none may be read now.
///
/// # Errors
/// One sentence with the path; it does not tell whether there is such a file.
pub(crate) fn check_permitted(path: &str) -> Result<(), String> {
    if KEPT.with_borrow(Option::is_some) {
        return Err(format!("a viewer cannot name a file, such as '{path}'"));
    }
    Ok(())
}

/// What a file contains.
pub trait Content: Clone + std::fmt::Debug + PartialEq + Send + Sync + 'static {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// One sentence with the path and the invalid line.
    fn read(path: &str) -> Result<Self, String>;
}

/// The content of a file. Scenarios contain the file's path.
#[derive(Clone, Debug, PartialEq)]
pub struct FromFile<C> {
    path: String,
    content: Arc<C>,
}

impl<C: Content> FromFile<C> {
    /// Reads a file.
    ///
    /// # Errors
    /// One sentence with the path and the invalid line.
    pub fn read(path: &str) -> Result<Self, String> {
        let content = match Self::kept(path) {
            Some(content) => content,
            None => Arc::new(C::read(path)?),
        };
        Ok(Self {
            path: path.into(),
            content,
        })
    }

    /// Returns what a scenario has loaded from this file, in [`without_files`].
    fn kept(path: &str) -> Option<Arc<C>> {
        KEPT.with_borrow(|kept| {
            let mut known = kept.iter().flatten();
            known.find_map(|(file, content)| {
                let content = (file == path).then(|| content.clone())?;
                content.downcast().ok()
            })
        })
    }
}

impl<C> Deref for FromFile<C> {
    type Target = C;

    fn deref(&self) -> &C {
        &self.content
    }
}

impl<C: Content> SettingValue for FromFile<C> {
    const SHAPE: Shape = Shape::Text;

    /// The file was checked when it was read.
    fn check(&self, _: &Bounds, _: &mut OutOfRange) -> Result<(), Refused> {
        Ok(())
    }
}

impl<C: Content> Serialize for FromFile<C> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        KEPT.with_borrow_mut(|kept| {
            if let Some(kept) = kept {
                kept.push((self.path.clone(), self.content.clone()));
            }
        });
        serializer.serialize_str(&self.path)
    }
}

impl<'de, C: Content> Deserialize<'de> for FromFile<C> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let path = String::deserialize(deserializer)?;
        Self::read(&path).map_err(serde::de::Error::custom)
    }
}
