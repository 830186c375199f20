//! Layout of a force vector by degrees of freedom.

use serde::{Deserialize, Serialize};

/// Degrees of freedom (DoF) of a library, whose forces are stacked one DoF after the other.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Layout {
    names: Vec<String>,
}

/// A named part of a body, consisting of some of its DoFs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Name of the part.
    pub name: String,
    /// Indices of the DoFs, ascending.
    pub dofs: Vec<usize>,
}

/// Error returned when the names of degrees of freedom or of body parts are invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayoutError {
    /// There are no DoFs.
    #[error("no degree of freedom, expected at least one")]
    Empty,
    /// Two DoFs have the same name.
    #[error("two degrees of freedom are called `{0}`: give each a unique name")]
    Twice(String),
    /// A pattern matches no DoF.
    #[error("part `{part}`: no degree of freedom matches `{pattern}`; known: {known}")]
    NoMatch {
        /// Name of the part.
        part: String,
        /// Pattern without a match.
        pattern: String,
        /// All known names.
        known: String,
    },
    /// The text does not have the form `name=pattern,...`.
    #[error("`{0}` is not a part: expected NAME=PATTERN[,PATTERN...], such as arms=l_arm*,r_arm*")]
    Syntax(String),
}

impl Layout {
    /// Creates a layout of DoFs with these names, in this order.
    ///
    /// # Errors
    /// [`LayoutError`] if there are no names, or a name occurs twice.
    pub fn new(names: Vec<String>) -> Result<Self, LayoutError> {
        if names.is_empty() {
            return Err(LayoutError::Empty);
        }
        for (k, name) in names.iter().enumerate() {
            if names[..k].contains(name) {
                return Err(LayoutError::Twice(name.clone()));
            }
        }
        Ok(Self { names })
    }

    /// Returns the names.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns the number of DoFs.
    pub fn dofs(&self) -> usize {
        self.names.len()
    }

    /// Parses a part written as `name=pattern,pattern`. A pattern is a name, or a prefix followed by `*`.
    ///
    /// # Errors
    /// [`LayoutError`] if the text does not have this form, or a pattern matches no DoF.
    pub fn part(&self, text: &str) -> Result<Part, LayoutError> {
        let (name, patterns) = text.split_once('=').ok_or_else(|| LayoutError::Syntax(text.to_string()))?;
        let mut dofs = Vec::new();
        for pattern in patterns.split(',').map(str::trim) {
            let matches = |name: &str| match pattern.strip_suffix('*') {
                Some(beginning) => name.starts_with(beginning),
                None => name == pattern,
            };
            let found: Vec<usize> = (0..self.names.len()).filter(|k| matches(&self.names[*k])).collect();
            if found.is_empty() {
                let known = self.names.join(", ");
                let (part, pattern) = (name.to_string(), pattern.to_string());
                return Err(LayoutError::NoMatch { part, pattern, known });
            }
            dofs.extend(found);
        }
        dofs.sort_unstable();
        dofs.dedup();
        Ok(Part { name: name.trim().to_string(), dofs })
    }

    /// Returns the layout of some of the DoFs.
    pub(super) fn select(&self, dofs: &[usize]) -> Self {
        Self { names: dofs.iter().map(|k| self.names[*k].clone()).collect() }
    }
}
