//! A setting that names a file, whose content is loaded together with the scenario.

use std::ops::Deref;
use std::sync::Arc;

use painleve_shared::OutOfRange;
use painleve_shared::settings::{Bounds, Refused, SettingValue, Shape};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// What a file contains.
pub trait Content: Clone + std::fmt::Debug + PartialEq {
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
        Ok(Self {
            path: path.into(),
            content: Arc::new(C::read(path)?),
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

impl<C> Serialize for FromFile<C> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.path)
    }
}

impl<'de, C: Content> Deserialize<'de> for FromFile<C> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let path = String::deserialize(deserializer)?;
        Self::read(&path).map_err(serde::de::Error::custom)
    }
}
