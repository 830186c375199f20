//! Colours in a URDF, which a model does not contain.

use std::collections::BTreeMap;

use roxmltree::{Document, Node};

use crate::LinkColours;

fn elements<'a, 'b>(node: Node<'a, 'b>, name: &'static str) -> impl Iterator<Item = Node<'a, 'b>> {
    node.children().filter(move |child| child.has_tag_name(name))
}

impl LinkColours {
    /// Reads the colours in a URDF text. The result is empty for any other text.
    pub fn of_urdf(text: &str) -> Self {
        Self::of_shapes(visual_colours(text))
    }
}

/// Returns the colours of each link's visuals, in order, as red, green and blue from 0 to 1. Empty for text
/// that is not XML.
fn visual_colours(text: &str) -> BTreeMap<String, Vec<Option<[f64; 3]>>> {
    let Ok(document) = Document::parse(text) else { return BTreeMap::new() };
    let robot = document.root_element();
    let own = |material: Node| {
        let rgba = elements(material, "color").next()?.attribute("rgba")?.to_string();
        let values = rgba.split_whitespace().filter_map(|value| value.parse::<f64>().ok());
        let values: Vec<f64> = values.map(|value| value.clamp(0.0, 1.0)).collect();
        Some([*values.first()?, *values.get(1)?, *values.get(2)?])
    };
    let named: BTreeMap<&str, [f64; 3]> = elements(robot, "material")
        .filter_map(|material| Some((material.attribute("name")?, own(material)?)))
        .collect();
    let of_visual = |visual: Node| {
        let material = elements(visual, "material").next()?;
        own(material).or_else(|| named.get(material.attribute("name")?).copied())
    };
    elements(robot, "link")
        .filter_map(|link| {
            Some((link.attribute("name")?.to_string(), elements(link, "visual").map(of_visual).collect()))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TREE: &str = r#"<robot name="r">
      <material name="red"><color rgba="1 0 0 1"/></material>
      <link name="a"><visual><material name="red"/></visual><visual><material name="x"><color rgba="0 0.5 1 1"/></material></visual></link>
      <link name="b"><visual/></link>
      <joint name="z" type="fixed"><parent link="a"/><child link="b"/></joint>
    </robot>"#;

    #[test]
    fn colours_are_found_by_name_and_in_place() {
        let colours = visual_colours(TREE);
        assert_eq!(colours["a"], [Some([1.0, 0.0, 0.0]), Some([0.0, 0.5, 1.0])]);
        assert_eq!(colours["b"], [None]);
        assert!(visual_colours("no XML").is_empty());
    }
}
