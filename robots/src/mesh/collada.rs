//! COLLADA 1.4 and 1.5 files: the geometry of the visual scene, placed by the transformations of its nodes.

use std::collections::HashMap;

use nalgebra::{Matrix4, Point3, Rotation3, Unit, Vector3};
use roxmltree::{Document, Node, ParsingOptions};

use super::ears;
use super::error::{Fault, MeshProblem, number};
use super::triangle_mesh::TriangleMesh;

/// Maximum depth of nodes; a deeper scene instances itself.
const DEEPEST: usize = 64;
/// Maximum number of nodes and geometries of a scene, counting every instance: nodes that instance one
/// another twice double at each level.
const MOST_INSTANCES: usize = 100_000;
/// Maximum offset of an input within a corner. Files need one offset for each of a few inputs.
const LARGEST_OFFSET: usize = 255;
/// Maximum number of triangles and points of a scene before its last instance.
const MOST_TRIANGLES: usize = 4_000_000;

pub(super) fn parse(text: &str) -> Result<TriangleMesh, Fault> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options)
        .map_err(|error| (error.pos().row, MeshProblem::Malformed(error.to_string())))?;
    let ids = document.descendants().filter_map(|node| Some((node.attribute("id")?, node))).collect();
    let mut reader = Reader { document: &document, ids, mesh: TriangleMesh::default(), instances: 0 };
    let root = document.root_element();
    let unit = match child(root, "asset").and_then(|asset| child(asset, "unit")) {
        Some(unit) => match unit.attribute("meter") {
            Some(metres) => {
                let metres = number(metres).map_err(|problem| reader.fault(unit, problem))?;
                if metres.is_nan() || metres <= 0.0 {
                    return Err(reader.malformed(unit, format!("a unit of {metres} m, expected more than 0")));
                }
                metres
            }
            None => 1.0,
        },
        None => 1.0,
    };
    let scene = child(root, "scene").and_then(|scene| child(scene, "instance_visual_scene"));
    let scaled = Matrix4::new_scaling(unit);
    match scene {
        Some(instance) => {
            let scene = reader.target(instance, "url")?;
            for node in children(scene, "node") {
                reader.node(node, &scaled, 0)?;
            }
        }
        // Without a scene, geometries have no transformation.
        None => {
            for geometry in root.descendants().filter(|node| node.has_tag_name("geometry")) {
                reader.geometry(geometry, &scaled)?;
            }
        }
    }
    Ok(reader.mesh)
}

/// Finds children by tag name, ignoring the namespace: COLLADA files have one, and it differs between
/// versions.
fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.tag_name().name() == name)
}

fn children<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |child| child.tag_name().name() == name)
}

/// Returns the text of an element without comments.
fn text(node: Node<'_, '_>) -> String {
    node.children().filter(|child| child.is_text()).filter_map(|child| child.text()).collect()
}

struct Reader<'a, 'i> {
    document: &'a Document<'i>,
    ids: HashMap<&'a str, Node<'a, 'i>>,
    mesh: TriangleMesh,
    /// Number of instances of nodes and geometries so far.
    instances: usize,
}

impl<'a, 'i> Reader<'a, 'i> {
    fn fault(&self, node: Node<'_, '_>, problem: MeshProblem) -> Fault {
        (self.document.text_pos_at(node.range().start).row, problem)
    }

    fn malformed(&self, node: Node<'_, '_>, message: impl Into<String>) -> Fault {
        self.fault(node, MeshProblem::Malformed(message.into()))
    }

    /// Returns the element referenced by an attribute as `#ID`.
    fn target(&self, node: Node<'a, 'i>, attribute: &str) -> Result<Node<'a, 'i>, Fault> {
        let name = node.attribute(attribute).and_then(|url| url.strip_prefix('#'));
        name.and_then(|name| self.ids.get(name).copied()).ok_or_else(|| {
            let element = node.tag_name().name();
            let value = node.attribute(attribute).unwrap_or("");
            self.malformed(
                node,
                format!("{attribute}=\"{value}\" of <{element}> refers to no element of this file"),
            )
        })
    }

    fn floats(&self, node: Node<'_, '_>) -> Result<Vec<f64>, Fault> {
        let numbers = text(node).split_whitespace().map(number).collect::<Result<_, _>>();
        numbers.map_err(|problem| self.fault(node, problem))
    }

    fn counts(&self, node: Node<'_, '_>) -> Result<Vec<usize>, Fault> {
        let whole = |word: &str| word.parse().map_err(|_| MeshProblem::Number(word.to_owned()));
        let counts = text(node).split_whitespace().map(whole).collect::<Result<_, _>>();
        counts.map_err(|problem| self.fault(node, problem))
    }

    fn node(&mut self, node: Node<'a, 'i>, parent: &Matrix4<f64>, depth: usize) -> Result<(), Fault> {
        if depth > DEEPEST {
            return Err(self.malformed(node, "nodes reference each other in a cycle"));
        }
        self.count(node)?;
        let mut pose = *parent;
        for element in node.children().filter(Node::is_element) {
            match element.tag_name().name() {
                "matrix" | "translate" | "rotate" | "scale" => pose *= self.transformation(element)?,
                "lookat" | "skew" => {
                    let name = element.tag_name().name();
                    return Err(
                        self.malformed(element, format!("<{name}> is not supported; bake it into the mesh"))
                    );
                }
                "instance_geometry" => {
                    let geometry = self.target(element, "url")?;
                    self.geometry(geometry, &pose)?;
                }
                "instance_node" => {
                    let target = self.target(element, "url")?;
                    self.node(target, &pose, depth + 1)?;
                }
                "node" => self.node(element, &pose, depth + 1)?,
                "instance_controller" => {
                    let message = "<instance_controller>, a skin, is not supported; export plain geometry";
                    return Err(self.malformed(element, message));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Counts an instance of a node or a geometry.
    fn count(&mut self, node: Node<'_, '_>) -> Result<(), Fault> {
        self.instances += 1;
        let size = self.mesh.triangles.len().max(self.mesh.points.len());
        if self.instances > MOST_INSTANCES || size > MOST_TRIANGLES {
            let most = format!(
                "the scene has more than {MOST_INSTANCES} instances, or more than {MOST_TRIANGLES} triangles or points; \
                 instance fewer nodes"
            );
            return Err(self.malformed(node, most));
        }
        Ok(())
    }

    fn transformation(&self, element: Node<'_, '_>) -> Result<Matrix4<f64>, Fault> {
        let values = self.floats(element)?;
        match (element.tag_name().name(), &values[..]) {
            ("matrix", values) if values.len() == 16 => Ok(Matrix4::from_row_slice(values)),
            ("translate", &[x, y, z]) => Ok(Matrix4::new_translation(&Vector3::new(x, y, z))),
            ("scale", &[x, y, z]) => Ok(Matrix4::new_nonuniform_scaling(&Vector3::new(x, y, z))),
            ("rotate", &[x, y, z, degrees]) => {
                let axis = Unit::try_new(Vector3::new(x, y, z), 1e-12).ok_or_else(|| {
                    self.malformed(
                        element,
                        "the axis of <rotate> is zero; give it a direction, such as 0 0 1",
                    )
                })?;
                Ok(Rotation3::from_axis_angle(&axis, degrees.to_radians()).to_homogeneous())
            }
            (name, values) => Err(self
                .malformed(element, format!("<{name}> has an invalid number of values: {}", values.len()))),
        }
    }

    fn geometry(&mut self, geometry: Node<'a, 'i>, pose: &Matrix4<f64>) -> Result<(), Fault> {
        self.count(geometry)?;
        let Some(mesh) = child(geometry, "mesh") else {
            let others = ["convex_mesh", "spline", "brep"];
            let other = geometry.children().find(|part| others.contains(&part.tag_name().name()));
            return other.map_or(Ok(()), |part| {
                let name = part.tag_name().name();
                Err(self.malformed(part, format!("<{name}> is not supported; export triangles")))
            });
        };
        let first = self.mesh.triangles.len();
        for part in mesh.children().filter(Node::is_element) {
            match part.tag_name().name() {
                "triangles" | "polylist" | "polygons" => self.part(part, pose)?,
                name @ ("trifans" | "tristrips") => {
                    let message = format!("<{name}> is not supported; export triangles");
                    return Err(self.malformed(part, message));
                }
                _ => {}
            }
        }
        if pose.fixed_view::<3, 3>(0, 0).determinant() < 0.0 {
            // a mirror flips the orientation of the triangles
            self.mesh.triangles[first..].iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        Ok(())
    }

    fn part(&mut self, part: Node<'a, 'i>, pose: &Matrix4<f64>) -> Result<(), Fault> {
        // Each corner has one index per offset; one of them is the position.
        let (mut stride, mut positions) = (0, None);
        for input in children(part, "input") {
            let offset: usize = match input.attribute("offset") {
                Some(offset) => offset
                    .trim()
                    .parse()
                    .map_err(|_| self.fault(input, MeshProblem::Number(offset.to_owned())))?,
                None => 0,
            };
            if offset > LARGEST_OFFSET {
                let message = format!("an input has the offset {offset}, expected at most {LARGEST_OFFSET}");
                return Err(self.malformed(input, message));
            }
            stride = stride.max(offset + 1);
            if input.attribute("semantic") == Some("VERTEX") {
                positions = Some((offset, self.positions(input)?));
            }
        }
        let Some((offset, positions)) = positions else {
            return Err(self.malformed(part, "a list of faces names no VERTEX input"));
        };
        if let Some(holed) = child(part, "ph") {
            return Err(self.malformed(holed, "polygons with holes are not supported; export triangles"));
        }
        let first = self.mesh.points.len();
        let count = positions.len();
        self.mesh.points.extend(positions.into_iter().map(|point| pose.transform_point(&point).coords));
        let sizes = match child(part, "vcount") {
            Some(sizes) => self.counts(sizes)?,
            None if part.tag_name().name() == "polylist" => {
                return Err(self.malformed(part, "a <polylist> has no <vcount>"));
            }
            None => Vec::new(),
        };
        for list in children(part, "p") {
            let indices = self.counts(list)?;
            if indices.len() % stride != 0 {
                let message = format!("{} indices, expected a multiple of {stride}", indices.len());
                return Err(self.malformed(list, message));
            }
            let corners: Vec<usize> = indices.chunks_exact(stride).map(|corner| corner[offset]).collect();
            if let Some(&index) = corners.iter().find(|&&index| index >= count) {
                return Err(self.fault(list, MeshProblem::Index { index: index as i64, first: 0, count }));
            }
            let mut rest = &corners[..];
            let whole = [corners.len()];
            let sizes = match part.tag_name().name() {
                "polylist" => &sizes[..],
                "polygons" => &whole[..],
                _ => &[],
            };
            let triangles = sizes.is_empty().then_some(3).into_iter().cycle().take(corners.len() / 3);
            for size in sizes.iter().copied().chain(triangles) {
                let Some((face, after)) = rest.split_at_checked(size) else {
                    return Err(self.malformed(list, "fewer corners than its faces require"));
                };
                rest = after;
                let face: Vec<u32> = face.iter().map(|corner| (first + corner) as u32).collect();
                if !face.is_empty() {
                    ears::triangulate(&self.mesh.points, &face, &mut self.mesh.triangles);
                }
            }
            if !rest.is_empty() {
                return Err(
                    self.malformed(list, format!("{} corners are left over by its faces", rest.len()))
                );
            }
        }
        Ok(())
    }

    /// Returns the points of the POSITION source of an input of vertices.
    fn positions(&self, input: Node<'a, 'i>) -> Result<Vec<Point3<f64>>, Fault> {
        let vertices = self.target(input, "source")?;
        let position =
            children(vertices, "input").find(|input| input.attribute("semantic") == Some("POSITION"));
        let Some(position) = position else {
            return Err(self.malformed(vertices, "<vertices> without a POSITION input"));
        };
        let source = self.target(position, "source")?;
        let accessor = child(source, "technique_common").and_then(|common| child(common, "accessor"));
        let named = accessor.filter(|accessor| accessor.has_attribute("source"));
        let named = named.map(|accessor| self.target(accessor, "source")).transpose()?;
        let Some(array) = named.or_else(|| child(source, "float_array")) else {
            return Err(self.malformed(source, "<source> has no <float_array>"));
        };
        let (numbers, layout) = (self.floats(array)?, self.layout(accessor)?);
        let points = match layout.count {
            Some(count) => count,
            None => numbers.len().saturating_sub(layout.offset) / layout.stride,
        };
        let last = layout.offset.saturating_add(points.saturating_sub(1).saturating_mul(layout.stride));
        let end = last.saturating_add(layout.axes.into_iter().max().unwrap_or(0));
        if points > 0 && end >= numbers.len() {
            let message = format!("its <accessor> reads number {end} of {}, counted from 0", numbers.len());
            return Err(self.malformed(accessor.unwrap_or(source), message));
        }
        let at = |point: usize, axis: usize| numbers[layout.offset + point * layout.stride + axis];
        Ok((0..points).map(|point| Point3::from(layout.axes.map(|axis| at(point, axis)))).collect())
    }

    /// Returns the layout described by an accessor: the named parameters are x, y and z; unnamed ones are
    /// skipped.
    fn layout(&self, accessor: Option<Node<'_, '_>>) -> Result<Layout, Fault> {
        let Some(accessor) = accessor else {
            return Ok(Layout { offset: 0, stride: 3, count: None, axes: [0, 1, 2] });
        };
        let whole = |name: &str| -> Result<Option<usize>, Fault> {
            let Some(value) = accessor.attribute(name) else { return Ok(None) };
            let count = value.trim().parse().map_err(|_| MeshProblem::Number(value.to_owned()));
            count.map(Some).map_err(|problem| self.fault(accessor, problem))
        };
        let (offset, stride) = (whole("offset")?.unwrap_or(0), whole("stride")?);
        let all: Vec<bool> = children(accessor, "param").map(|param| param.has_attribute("name")).collect();
        let named: Vec<usize> = (0..all.len()).filter(|index| all[*index]).collect();
        // some programs omit the parameters
        let axes = match named[..] {
            [] => [0, 1, 2],
            [x, y, z] => [x, y, z],
            _ => {
                let message = format!("positions with {} named <param>, expected 3", named.len());
                return Err(self.malformed(accessor, message));
            }
        };
        let stride = stride.unwrap_or(all.len().max(3));
        if axes.iter().any(|axis| *axis >= stride) {
            let message = format!("an <accessor> with stride=\"{stride}\", expected at least 3");
            return Err(self.malformed(accessor, message));
        }
        Ok(Layout { offset, stride, count: whole("count")?, axes })
    }
}

/// Positions of the points in an array of numbers.
struct Layout {
    /// Number of values before the first point, and from one point to the next.
    offset: usize,
    stride: usize,
    /// Number of points; `None` for all that fit.
    count: Option<usize>,
    /// Positions of x, y and z within a point.
    axes: [usize; 3],
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parses a tetrahedron with this array of positions, accessor and list of faces, under this node.
    fn tetrahedron(array: &str, accessor: &str, faces: &str, node: &str) -> Result<TriangleMesh, Fault> {
        parse(&format!(
            "<COLLADA><library_geometries><geometry id=\"g\"><mesh><source id=\"p\"><float_array id=\"a\">{array}\
             </float_array><technique_common>{accessor}</technique_common></source><vertices id=\"v\">\
             <input semantic=\"POSITION\" source=\"#p\"/></vertices>{faces}</mesh></geometry></library_geometries>\
             <library_visual_scenes><visual_scene id=\"s\"><node>{node}</node></visual_scene></library_visual_scenes>\
             <scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>"
        ))
    }

    const PLAIN: &str = "0 0 0 1 0 0 0 1 0 0 0 1";
    const ACCESSOR: &str = "<accessor source=\"#a\" count=\"4\" stride=\"3\"><param name=\"X\"/><param name=\"Y\"/>\
                            <param name=\"Z\"/></accessor>";
    const FACES: &str = "<triangles count=\"4\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>\
                         <p>0 2 1 0 1 3 1 2 3 0 3 2</p></triangles>";
    const INSTANCE: &str = "<instance_geometry url=\"#g\"/>";

    #[test]
    fn accessors_define_the_layout_of_positions() {
        let plain = tetrahedron(PLAIN, ACCESSOR, FACES, INSTANCE).unwrap();
        assert_eq!((plain.points.len(), plain.triangles.len()), (4, 4));
        assert!((plain.volume() - 1.0 / 6.0).abs() < 1e-15);
        let normals = "9 0 0 0 7 7 7 1 0 0 7 7 7 0 1 0 7 7 7 0 0 1 7 7 7";
        let interleaved = ACCESSOR.replace("stride=\"3\"", "offset=\"1\" stride=\"6\"");
        let unnamed = "<accessor source=\"#a\" count=\"4\" stride=\"4\"><param/><param name=\"X\"/><param name=\"Y\"/>\
                       <param name=\"Z\"/></accessor>";
        for (array, accessor) in [
            ("<!-- metres -->0 0 0 1 0 0 <!-- y -->0 1 0 0 0 1", ACCESSOR),
            ("0 0 0 1 0 0 0 1 0 0 0 1", "<accessor source=\"#a\" stride=\"3\"/>"),
            (normals, interleaved.as_str()),
            ("7 0 0 0 7 1 0 0 7 0 1 0 7 0 0 1", unnamed),
        ] {
            assert_eq!(tetrahedron(array, accessor, FACES, INSTANCE).unwrap(), plain, "{accessor}");
        }
        let count = ACCESSOR.replace("count=\"4\"", "count=\"5\"");
        let (_, problem) = tetrahedron(PLAIN, &count, FACES, INSTANCE).unwrap_err();
        assert!(problem.to_string().contains("reads number 14 of 12"), "{problem}");
        let two = ACCESSOR.replace("<param name=\"Z\"/>", "");
        assert!(tetrahedron(PLAIN, &two, FACES, INSTANCE).is_err());
    }

    #[test]
    fn mirrored_nodes_keep_their_triangles_outward() {
        let mirror = format!("<scale>1 -1 1</scale>{INSTANCE}");
        let mesh = tetrahedron(PLAIN, ACCESSOR, FACES, &mirror).unwrap();
        assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-15);
        assert_eq!(mesh.points[2], -Vector3::y());
    }

    #[test]
    fn unsupported_geometry_is_rejected() {
        for (faces, node, expected) in [
            (FACES, "<instance_controller url=\"#g\"/>", "<instance_controller>, a skin"),
            (FACES.replace("0 3 2<", "0 3 2 1<").as_str(), INSTANCE, "1 corners are left over"),
            (
                FACES.replace("triangles", "polylist").replace("<p>", "<vcount>3 3 3</vcount><p>").as_str(),
                INSTANCE,
                "3 corners are left over",
            ),
            (FACES.replace("offset=\"0\"", "offset=\"4\"").as_str(), INSTANCE, "expected a multiple of 5"),
        ] {
            let (_, problem) = tetrahedron(PLAIN, ACCESSOR, faces, node).unwrap_err();
            assert!(problem.to_string().contains(expected), "{problem}");
        }
        let text =
            "<COLLADA><library_geometries><geometry><convex_mesh/></geometry></library_geometries></COLLADA>";
        assert!(parse(text).unwrap_err().1.to_string().contains("<convex_mesh> is not supported"));
    }

    #[test]
    fn exponentially_instanced_nodes_are_rejected() {
        let scene = |levels: usize| {
            let double = |k: usize| {
                let instance = format!("<instance_node url=\"#n{}\"/>", k - 1);
                format!("<node id=\"n{k}\">{instance}{instance}</node>")
            };
            let nodes: String = (1..levels).map(double).collect();
            format!(
                "<COLLADA><library_geometries><geometry id=\"g\"><mesh/></geometry></library_geometries><library_nodes>\
                 <node id=\"n0\"><instance_geometry url=\"#g\"/></node>{nodes}</library_nodes><library_visual_scenes>\
                 <visual_scene id=\"s\"><node><instance_node url=\"#n{}\"/></node></visual_scene></library_visual_scenes>\
                 <scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>",
                levels - 1
            )
        };
        assert!(parse(&scene(10)).is_ok());
        let (_, problem) = parse(&scene(28)).unwrap_err();
        assert!(problem.to_string().contains("more than 100000 instances"), "{problem}");
    }
}
