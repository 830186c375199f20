//! Formats of robot files.

/// Accepted formats of a robot file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FileFormat {
    /// URDF, or MJCF if the root element is `<mujoco>`. If a folder contains files of both formats, the URDF
    /// is used.
    #[default]
    Any,
    /// MJCF only. Names of robots in the catalogue are not accepted.
    Mjcf,
}

/// Returns `true` if the root element of an XML text is `<mujoco>`. Declarations and comments before the root
/// element are skipped.
pub fn is_mjcf(text: &str) -> bool {
    let mut rest = text;
    while let Some(start) = rest.find('<') {
        rest = &rest[start + 1..];
        let end = match rest.strip_prefix("!--") {
            Some(comment) => comment.find("-->").map(|end| end + 6),
            None if rest.starts_with(['?', '!']) => rest.find('>').map(|end| end + 1),
            None => {
                return rest
                    .strip_prefix("mujoco")
                    .is_some_and(|rest| !rest.starts_with(char::is_alphanumeric));
            }
        };
        let Some(end) = end else { return false };
        rest = &rest[end..];
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn root_element_determines_the_format() {
        for text in
            ["<mujoco/>", "<?xml version=\"1.0\"?>\n<!-- <robot> -->\n<mujoco model=\"a\">", "<mujoco>"]
        {
            assert!(is_mjcf(text), "{text}");
        }
        for text in
            ["<robot name=\"mujoco\"/>", "<!-- <mujoco> --><robot/>", "<mujocoinclude/>", "", "<!-- <mujoco>"]
        {
            assert!(!is_mjcf(text), "{text}");
        }
    }
}
