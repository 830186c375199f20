//! URDF text without meshes, for viewers that cannot request files.

use roxmltree::{Document, Node};

use super::write::DrawnRobot;

impl DrawnRobot {
    /// Returns the URDF text without meshes. Visuals that show one of the [meshes](Self::meshes) are replaced
    /// by the collision shapes of their link, in the colours of the visuals. Links without collision shapes
    /// are unchanged.
    ///
    /// ```
    /// let panda = motorium_robots::load("panda", std::path::Path::new("."))?.drawn()?.unwrap();
    /// assert!(panda.text.contains("<mesh") && !panda.without_meshes().contains("<mesh"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn without_meshes(&self) -> String {
        self.simplified().unwrap_or_else(|| self.text.clone())
    }

    /// Implements [`without_meshes`](Self::without_meshes); `None` for text that is not XML.
    fn simplified(&self) -> Option<String> {
        let document = Document::parse(&self.text).ok()?;
        let (mut simple, mut copied) = (String::with_capacity(self.text.len()), 0);
        for link in document.root_element().children().filter(|node| node.has_tag_name("link")) {
            let (visuals, collisions) = (all(link, "visual"), all(link, "collision"));
            if collisions.is_empty() || !visuals.iter().any(|visual| self.shows(*visual)) {
                continue;
            }
            for (place, visual) in visuals.iter().enumerate() {
                simple += &self.text[copied..visual.range().start];
                copied = visual.range().end;
                if place > 0 {
                    continue;
                }
                for (place, collision) in collisions.iter().enumerate() {
                    let seen = visuals.get(place).or(visuals.last()).map(|visual| all(*visual, "material"));
                    let parts =
                        collision.children().filter(Node::is_element).chain(seen.into_iter().flatten());
                    let parts: String = parts.map(|part| &self.text[part.range()]).collect();
                    simple += &format!("<visual>{parts}</visual>");
                }
            }
        }
        Some(simple + &self.text[copied..])
    }

    /// Returns `true` if a visual shows one of the meshes.
    fn shows(&self, visual: Node<'_, '_>) -> bool {
        let mut shown = visual.descendants().filter_map(|node| node.attribute("filename"));
        shown.any(|name| self.meshes.iter().any(|(known, _)| known == name))
    }
}

fn all<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Vec<Node<'a, 'i>> {
    node.children().filter(|child| child.has_tag_name(name)).collect()
}
