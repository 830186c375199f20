//! Families of latencies and their colours, for light and dark backgrounds.

use std::fmt::Write as _;

/// The systems that a family of curves was measured on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Group {
    Floors,
    Motorium,
    Peers,
}

/// A family of curves: each has its own dashes and colours.
pub(super) struct Family {
    pub(super) group: Group,
    pub(super) dashes: &'static str,
    /// First letter of the CSS classes of its colours.
    pub(super) class: char,
    pub(super) colours: &'static [&'static str],
    /// The same number of colours, for a dark background.
    on_dark: &'static [&'static str],
    pub(super) is_member: fn(&str) -> bool,
}

/// Colours that are distinct on white, also with colour blindness (P. Tol's "bright" and "muted").
pub(super) const FAMILIES: [Family; 3] = [
    Family {
        group: Group::Floors,
        dashes: " stroke-dasharray=\"2 3\"",
        class: 'm',
        colours: &["#000000", "#777777", "#b08000", "#5a4fa0", "#0077bb"],
        on_dark: &["#ffffff", "#9aa4ae", "#e3b341", "#b3a6f5", "#58a6ff"],
        is_member: is_floor,
    },
    Family {
        group: Group::Motorium,
        dashes: "",
        class: 'o',
        colours: &[
            "#4477aa", "#ee6677", "#228833", "#aa3377", "#66ccee", "#ddaa33", "#332288", "#117733",
            "#882255", "#999933",
        ],
        on_dark: &[
            "#79c0ff", "#ff7b72", "#56d364", "#f778ba", "#66ccee", "#e3b341", "#a5a0ff", "#2ea88a",
            "#d67ab1", "#c9c95c",
        ],
        is_member: |name| !is_floor(name) && !is_peer(name),
    },
    Family {
        group: Group::Peers,
        dashes: " stroke-dasharray=\"8 3\"",
        class: 'p',
        colours: &[
            "#cc3311", "#ee7733", "#0077bb", "#009988", "#ee3377", "#664400", "#444444", "#6699cc",
            "#aa4499", "#000000",
        ],
        on_dark: &[
            "#ff6d4d", "#ffa657", "#3fa9f5", "#2fc4b2", "#ff70a6", "#c99f57", "#b6bec7", "#8ab6e6",
            "#d68fe0", "#ffffff",
        ],
        is_member: is_peer,
    },
];

/// The machine itself; cyclictest measures it too.
fn is_floor(name: &str) -> bool {
    name.starts_with("floor.") || name == "peer.cyclictest"
}

pub(super) fn is_peer(name: &str) -> bool {
    !is_floor(name) && (name.starts_with("peer.") || name.starts_with("iceoryx2."))
}

/// Returns `true` for a measurement of motorium with a counterpart in other systems: blocking hand-overs
/// and the caterpillar of 17 processes.
pub(super) fn has_counterpart(name: &str) -> bool {
    name.starts_with("hop.blocking.") || name == "chain.17"
}

/// The CSS rules of all colours on a dark background.
pub(super) fn on_dark() -> String {
    let mut rules = String::new();
    for family in &FAMILIES {
        for (i, colour) in family.on_dark.iter().enumerate() {
            let _ = write!(rules, ".{}{i}{{stroke:{colour}}}", family.class);
        }
    }
    rules
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::theme;

    /// Relative luminance of a colour `#rrggbb`, by WCAG 2.2.
    fn luminance(colour: &str) -> f64 {
        let channel = |at: usize| {
            let value = f64::from(u8::from_str_radix(&colour[at..at + 2], 16).unwrap()) / 255.0;
            if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5)
    }

    #[test]
    fn curve_colours_differ_and_show_on_dark() {
        let rules = on_dark();
        for family in &FAMILIES {
            assert_eq!(family.on_dark.len(), family.colours.len(), "{:?}", family.group);
            for (i, colour) in family.on_dark.iter().enumerate() {
                // the minimum that WCAG requires for small text
                let contrast = (luminance(colour) + 0.05) / (luminance(theme::DARK) + 0.05);
                assert!(contrast > 4.5, "{colour}: {contrast}");
                assert!(!family.on_dark[..i].contains(colour), "{colour} twice");
                assert!(rules.contains(&format!(".{}{i}{{stroke:{colour}}}", family.class)), "{rules}");
            }
        }
    }
}
