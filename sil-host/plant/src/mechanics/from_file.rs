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

/// What a scenario that names a file may do with it.
enum Access {
    /// Read it.
    Read,
    /// Only keep what has been loaded from it: the files of the scenarios written so far in [`without_files`].
    Keep(Vec<Loaded>),
    /// Nothing: only its path counts.
    PathOnly,
}

thread_local! {
    static ACCESS: RefCell<Access> = const { RefCell::new(Access::Read) };
}

/// Runs `act`, in which no scenario reads a file: one that is written and read again keeps the content of the
/// files that it names, and every other file is refused. For requests from those who may not read what this
/// process may.
pub(crate) fn without_files<T>(act: impl FnOnce() -> T) -> T {
    with_access(Access::Keep(Vec::new()), act)
}

/// Runs `act`, in which a scenario takes the paths of its files as texts and opens none. Such a scenario can be shown
/// and compared, but has nothing to run with.
pub(crate) fn with_paths_only<T>(act: impl FnOnce() -> T) -> T {
    with_access(Access::PathOnly, act)
}

fn with_access<T>(access: Access, act: impl FnOnce() -> T) -> T {
    let outer = ACCESS.replace(access);
    let done = act();
    ACCESS.set(outer);
    done
}

/// Refuses a file if none may be read now.
///
/// # Errors
/// One sentence with the path; it does not tell whether there is such a file.
pub(crate) fn check_permitted(path: &str) -> Result<(), String> {
    match ACCESS.with_borrow(|access| matches!(access, Access::Read)) {
        true => Ok(()),
        false => Err(format!("a viewer cannot name a file, such as '{path}'")),
    }
}

/// What a file contains.
pub trait Content: Clone + std::fmt::Debug + PartialEq + Send + Sync + 'static {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// One sentence with the path and the invalid line.
    fn read(path: &str) -> Result<Self, String>;

    /// Returns what stands for a file of which only the path counts.
    fn unread() -> Self;
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
        let content = match Self::known(path) {
            Some(content) => content,
            None => Arc::new(C::read(path)?),
        };
        Ok(Self {
            path: path.into(),
            content,
        })
    }

    /// Returns what a scenario has loaded from this file, in [`without_files`], or what stands for it, in
    /// [`with_paths_only`].
    fn known(path: &str) -> Option<Arc<C>> {
        ACCESS.with_borrow(|access| match access {
            Access::Read => None,
            Access::Keep(kept) => kept.iter().find_map(|(file, content)| {
                let content = (file == path).then(|| content.clone())?;
                content.downcast().ok()
            }),
            Access::PathOnly => Some(Arc::new(C::unread())),
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
        ACCESS.with_borrow_mut(|access| {
            if let Access::Keep(kept) = access {
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
