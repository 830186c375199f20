//! Colours of links.

use std::collections::BTreeMap;

/// Colour: red, green and blue, 0 to 1 each.
pub type Colour = [f64; 3];

/// Colours of links without a colour in the file: the base, then alternating links.
const PLAIN: [Colour; 3] = [[0.55, 0.57, 0.6], [0.93, 0.93, 0.93], [0.72, 0.77, 0.84]];

/// Colours of the links of a robot, from the visuals of a URDF or the geoms of an MJCF file.
///
/// ```
/// use motorium_robots::LinkColours;
///
/// let urdf = r#"<robot name="r">
///   <material name="red"><color rgba="1 0 0 1"/></material>
///   <link name="a"><visual><geometry><sphere radius="1"/></geometry><material name="red"/></visual></link>
///   <link name="b"/>
/// </robot>"#;
/// let colours = LinkColours::of_urdf(urdf);
/// assert_eq!(colours.of_shape("a", 0, None), [1.0, 0.0, 0.0]);
/// assert_eq!(colours.of_shape("b", 0, Some(0)), [0.93; 3]);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinkColours(BTreeMap<String, Vec<Option<Colour>>>);

impl LinkColours {
    /// Creates the set from the colours of each link's shapes, in order.
    pub(crate) fn of_shapes(links: BTreeMap<String, Vec<Option<Colour>>>) -> Self {
        Self(links)
    }

    /// Returns these colours, completed by another set for links without a colour here.
    #[must_use]
    pub(crate) fn or(mut self, other: Self) -> Self {
        for (link, colours) in other.0 {
            let own = self.0.entry(link).or_default();
            if own.iter().all(Option::is_none) {
                *own = colours;
            }
        }
        self
    }

    /// Returns the colour of the shape with index `place` of `link`. This is the colour that the file
    /// [states](Self::stated). If the file states no colour, it is a default colour that depends on the
    /// moving `body` to which the link belongs (`None` for the base).
    pub fn of_shape(&self, link: &str, place: usize, body: Option<usize>) -> Colour {
        self.stated(link, place).unwrap_or(PLAIN[body.map_or(0, |body| 1 + body % 2)])
    }

    /// Returns the colour that the file states for the visual at index `place` of `link`, or for the last
    /// visual if the link has fewer visuals. Returns `None` if the file states no colour for this visual.
    pub fn stated(&self, link: &str, place: usize) -> Option<Colour> {
        self.0.get(link).and_then(|colours| colours.get(place).or(colours.last())).copied().flatten()
    }
}
