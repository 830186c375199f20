//! Mesh files and their substitutes in a collision model.

use std::path::{Path, PathBuf};

use approx::assert_relative_eq;
use motorium_robots::{
    CollisionModel, CollisionOptions, Collisions, Geometry, Kinematics, LoadOptions, MeshMode, Proximity,
    SolidKind, TriangleMesh, load_with,
};
use nalgebra::{Isometry3, Vector3};

/// Corners and faces of a cube of side 2 about the origin, as quadrilaterals.
const CORNERS: [[i32; 3]; 8] =
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]];
const FACES: [[usize; 4]; 6] =
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];

fn triangles() -> Vec<[usize; 3]> {
    FACES.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
}

fn write(folder: &Path, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, content).unwrap();
    path
}

fn stl_text() -> String {
    let facets = triangles().into_iter().map(|triangle| {
        let corners = triangle.map(|corner| {
            let [x, y, z] = CORNERS[corner];
            format!("vertex {x} {y}.0e0 {z}\n")
        });
        format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", corners.concat())
    });
    format!("solid cube\n{}endsolid cube\n", facets.collect::<String>())
}

fn stl_binary(header: &[u8]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, 0);
    bytes.extend((triangles().len() as u32).to_le_bytes());
    for triangle in triangles() {
        bytes.extend([0; 12]);
        for x in triangle.iter().flat_map(|&corner| CORNERS[corner]) {
            bytes.extend((x as f32).to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

fn obj() -> String {
    let corners = CORNERS.map(|[x, y, z]| format!("v {x} {y} {z}\n")).concat();
    // every way to reference a corner, and a fan of four
    let faces = FACES.map(|[a, b, c, d]| format!("f {} {}/1 {}//1 {}\n", a + 1, b + 1, c + 1, d as i32 - 8));
    format!("# a cube\nmtllib x.mtl\no cube\n{corners}vn 0 0 1\nvt 0 0\n{}", faces.concat())
}

/// The cube in centimetres, with normal and corner indices alternating, moved and rotated by two nodes.
fn dae() -> String {
    let corners: String = CORNERS.iter().flatten().map(|x| format!("{} ", x * 100)).collect();
    let indices: String = FACES.iter().flatten().map(|corner| format!("0 {corner} ")).collect();
    format!(
        "<?xml version=\"1.0\"?>\n<COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">\
         <asset><unit meter=\"0.01\" name=\"centimeter\"/><up_axis>Y_UP</up_axis></asset>\
         <library_geometries><geometry id=\"g\"><mesh>\
         <source id=\"s\"><float_array id=\"f\" count=\"24\">{corners}</float_array></source>\
         <vertices id=\"v\"><input semantic=\"POSITION\" source=\"#s\"/></vertices>\
         <polylist count=\"6\"><input semantic=\"NORMAL\" source=\"#s\" offset=\"0\"/>\
         <input semantic=\"VERTEX\" source=\"#v\" offset=\"1\"/><vcount>4 4 4 4 4 4</vcount><p>{indices}</p></polylist>\
         </mesh></geometry></library_geometries>\
         <library_visual_scenes><visual_scene id=\"scene\"><node><translate>300 0 0</translate>\
         <node><rotate>0 0 1 90</rotate><scale>2 1 1</scale><instance_geometry url=\"#g\"/></node>\
         <node><translate>0 0 1000</translate><instance_geometry url=\"#g\"/></node>\
         </node></visual_scene></library_visual_scenes>\
         <scene><instance_visual_scene url=\"#scene\"/></scene></COLLADA>"
    )
}

fn extent(mesh: &TriangleMesh) -> (Vector3<f64>, Vector3<f64>) {
    let first = mesh.points[0];
    mesh.points.iter().fold((first, first), |(low, high), point| (low.inf(point), high.sup(point)))
}

/// Volume by the divergence theorem, which is correct only if all triangles face outwards.
fn volume(mesh: &TriangleMesh) -> f64 {
    let corner = |index: u32| mesh.points[index as usize];
    mesh.triangles.iter().map(|&[a, b, c]| corner(a).cross(&corner(b)).dot(&corner(c)) / 6.0).sum()
}

#[test]
fn stl_and_obj_give_the_same_cube() {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in [
        ("text.stl", stl_text().into_bytes()),
        ("binary.stl", stl_binary(b"made by a test")),
        // some programs start binary files like text
        ("liar.STL", stl_binary(b"solid cube")),
        ("cube.obj", obj().into_bytes()),
    ] {
        let mesh = TriangleMesh::read(&write(folder.path(), name, content)).unwrap();
        assert_eq!((mesh.points.len(), mesh.triangles.len()), (8, 12), "{name}");
        assert_eq!(extent(&mesh), (Vector3::repeat(-1.0), Vector3::repeat(1.0)), "{name}");
        assert_relative_eq!(volume(&mesh), 8.0, epsilon = 1e-12);
        let mirrored = mesh.scaled(&Vector3::new(-0.5, 1.0, 2.0));
        assert_relative_eq!(volume(&mirrored), 8.0, epsilon = 1e-12);
    }
}

/// Corners of an L with thickness 1 and area 3, and its faces, each with the notch where a fan would cover
/// it.
const L: [[i32; 2]; 6] = [[0, 0], [2, 0], [2, 2], [1, 2], [1, 1], [0, 1]];

fn l_faces() -> Vec<Vec<usize>> {
    let sides = (0..6).map(|i| vec![i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6]);
    [vec![5, 4, 3, 2, 1, 0], vec![8, 9, 10, 11, 6, 7]].into_iter().chain(sides).collect()
}

/// Area of the triangles in the plane `z`.
fn area(mesh: &TriangleMesh, z: f64) -> f64 {
    let corner = |index: u32| mesh.points[index as usize];
    let inside = |triangle: &&[u32; 3]| triangle.iter().all(|index| corner(*index).z == z);
    let area = |&[a, b, c]: &[u32; 3]| 0.5 * (corner(b) - corner(a)).cross(&(corner(c) - corner(a))).norm();
    mesh.triangles.iter().filter(inside).map(area).sum()
}

#[test]
fn concave_polygons_keep_their_notches() {
    let folder = tempfile::tempdir().unwrap();
    let corners = || [0, 1].into_iter().flat_map(|z| L.map(|[x, y]| [x, y, z]));
    for turn in 0..6 {
        let mut faces = l_faces();
        faces[..2].iter_mut().for_each(|face| face.rotate_left(turn));
        let mut obj: String = corners().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
        for face in &faces {
            let indices: Vec<String> = face.iter().map(|corner| (corner + 1).to_string()).collect();
            obj += &format!("f {}\n", indices.join(" "));
        }
        let numbers: String = corners().flatten().map(|x| format!("{x} ")).collect();
        let counts: String = faces.iter().map(|face| format!("{} ", face.len())).collect();
        let indices: String = faces.iter().flatten().map(|corner| format!("{corner} ")).collect();
        let dae = format!(
            "<COLLADA><library_geometries><geometry id=\"g\"><mesh><source id=\"s\"><float_array>{numbers}</float_array>\
             </source><vertices id=\"v\"><input semantic=\"POSITION\" source=\"#s\"/></vertices><polylist>\
             <input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><vcount>{counts}</vcount><p>{indices}</p></polylist>\
             </mesh></geometry></library_geometries></COLLADA>"
        );
        for (name, text) in [("l.obj", obj), ("l.dae", dae)] {
            let mesh = TriangleMesh::read(&write(folder.path(), name, text)).unwrap();
            assert_eq!(mesh.triangles.len(), 20, "{name}, {turn}");
            assert_relative_eq!(volume(&mesh), 3.0, epsilon = 1e-12);
            assert_relative_eq!(area(&mesh, 0.0), 3.0, epsilon = 1e-12);
            assert_relative_eq!(area(&mesh, 1.0), 3.0, epsilon = 1e-12);
        }
    }
}

#[test]
fn unsupported_collada_faces_are_rejected() {
    let folder = tempfile::tempdir().unwrap();
    for (element, expected) in [("tristrips", "<tristrips> is not supported"), ("trifans", "<trifans>")] {
        let text = dae().replace("polylist", element);
        let error = TriangleMesh::read(&write(folder.path(), "strip.dae", text)).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    let holed = dae().replace("polylist", "polygons").replace("<p>", "<ph><p>").replace("</p>", "</p></ph>");
    let error = TriangleMesh::read(&write(folder.path(), "hole.dae", holed)).unwrap_err().to_string();
    assert!(error.contains("polygons with holes are not supported"), "{error}");
    let far = dae().replace("offset=\"1\"", "offset=\"18446744073709551615\"");
    let error = TriangleMesh::read(&write(folder.path(), "far.dae", far)).unwrap_err().to_string();
    assert!(error.contains("an input has the offset 18446744073709551615, expected at most 255"), "{error}");
}

#[test]
fn collada_honours_units_nodes_and_repeated_instances() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = TriangleMesh::read(&write(folder.path(), "cube.dae", dae())).unwrap();
    assert_eq!(mesh.triangles.len(), 24);
    assert_relative_eq!(volume(&mesh), 24.0, epsilon = 1e-9);
    let (low, high) = extent(&mesh);
    // The first instance is stretched along its own x, which then points along y.
    assert_relative_eq!(low, Vector3::new(2.0, -2.0, -1.0), epsilon = 1e-9);
    assert_relative_eq!(high, Vector3::new(4.0, 2.0, 11.0), epsilon = 1e-9);
}

/// Returns the cube with sides of 2 m in a scene of these nodes, and the nodes of a library.
fn scene(unit: &str, nodes: &str, library: &str) -> String {
    let whole = dae().replace("<unit meter=\"0.01\" name=\"centimeter\"/>", unit);
    let start = whole.find("<library_visual_scenes>").unwrap();
    let end = whole.find("</library_visual_scenes>").unwrap();
    format!(
        "{}<library_nodes>{library}</library_nodes><library_visual_scenes>\
         <visual_scene id=\"scene\">{nodes}</visual_scene>{}",
        &whole[..start],
        &whole[end..]
    )
}

#[test]
fn collada_nodes_place_the_mesh_outermost_first() {
    let folder = tempfile::tempdir().unwrap();
    let cube = "<instance_geometry url=\"#g\"/>";
    let centre = |unit: &str, nodes: &str, library: &str| {
        let path = write(folder.path(), "scene.dae", scene(unit, nodes, library));
        let (low, high) = extent(&TriangleMesh::read(&path).unwrap());
        (low + high) / 2.0
    };
    let unit = "<unit meter=\"0.01\"/>";
    let nested = format!(
        "<node><translate>300 0 0</translate>\
         <node><rotate>0 0 1 90</rotate><translate>500 0 0</translate>{cube}</node></node>"
    );
    assert_relative_eq!(centre(unit, &nested, ""), Vector3::new(3.0, 5.0, 0.0), epsilon = 1e-12);
    // translations of nodes have the unit of the file, and small translations are applied too
    let moved = format!("<node><translate>0.9 0 0</translate>{cube}</node>");
    assert_relative_eq!(centre(unit, &moved, ""), Vector3::new(0.009, 0.0, 0.0), epsilon = 1e-12);
    let matrix = format!("<node><matrix>0 -1 0 100 1 0 0 200 0 0 1 300 0 0 0 1</matrix>{cube}</node>");
    assert_relative_eq!(centre(unit, &matrix, ""), Vector3::new(1.0, 2.0, 3.0), epsilon = 1e-12);
    let from_library = "<node><translate>400 0 0</translate><instance_node url=\"#n\"/></node>";
    let library = format!("<node id=\"n\"><translate>0 100 0</translate>{cube}</node>");
    assert_relative_eq!(centre(unit, from_library, &library), Vector3::new(4.0, 1.0, 0.0), epsilon = 1e-12);
    assert_relative_eq!(centre("", &moved, ""), Vector3::new(0.9, 0.0, 0.0), epsilon = 1e-12);
}

#[test]
fn faulty_mesh_is_rejected_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let refusal = |name: &str, content: &[u8]| {
        let error = TriangleMesh::read(&write(folder.path(), name, content)).unwrap_err().to_string();
        error.replace(&format!("{}/", folder.path().display()), "")
    };
    assert_eq!(refusal("a.obj", b"v 0 0 0\nf 1 2 3\n"), "a.obj:2: a face names corner 2, expected 1 to 1");
    assert_eq!(refusal("b.obj", b"v 0 0 zero\n"), "b.obj:1: found \"zero\", expected a number");
    assert_eq!(
        refusal("c.stl", &stl_binary(b"")[..200]),
        "c.stl: ends after 200 bytes where its header states 684"
    );
    assert_eq!(refusal("d.stl", b"solid x\nfacet\nvertex 1 2\n"), "d.stl:3: found \"\", expected a number");
    assert_eq!(refusal("e.stl", b"solid x\nendsolid\n"), "e.stl: has no triangles");
    assert_eq!(
        refusal("f.dae", b"<COLLADA>\n<scene></COLLADA>"),
        "f.dae:2: expected 'scene' tag, not 'COLLADA' at 2:8"
    );
    let lost = dae().replace("#scene\"/>", "#nothing\"/>");
    assert!(
        refusal("g.dae", lost.as_bytes())
            .ends_with("url=\"#nothing\" of <instance_visual_scene> refers to no element of this file")
    );
    let unturned = dae().replace("0 0 1 90", "0 0 0 90");
    assert!(
        refusal("i.dae", unturned.as_bytes())
            .ends_with("the axis of <rotate> is zero; give it a direction, such as 0 0 1")
    );
    assert!(refusal("h.ply", b"ply").contains("convert it to .stl, .obj or .dae"));
}

/// A cube of side 2 m as a mesh, a ball of 0.5 m from its middle at `(x, 0, 0)`, and the distance between.
fn mesh_and_ball(mode: MeshMode, x: f64) -> (SolidKind, Proximity) {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "cube.obj", obj());
    let urdf = write(
        folder.path(),
        "r.urdf",
        "<robot name=\"r\"><link name=\"base\"/><link name=\"body\"><collision><origin xyz=\"0 0 5\"/><geometry>\
         <mesh filename=\"cube.obj\" scale=\"1 1 0.5\"/></geometry></collision></link>\
         <joint name=\"j\" type=\"continuous\"><parent link=\"base\"/><child link=\"body\"/><axis xyz=\"1 0 0\"/></joint>\
         </robot>",
    );
    let model = load_with(urdf.to_str().unwrap(), Path::new("."), &LoadOptions::default()).unwrap().model;
    let mut solids =
        CollisionModel::new(&model, &CollisionOptions { meshes: mode, ..CollisionOptions::default() })
            .unwrap();
    let ball = Geometry::Sphere { radius: 0.5 };
    solids.add_obstacle("ball", Isometry3::translation(x, -5.0, 0.0), ball, MeshMode::default()).unwrap();
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &[std::f64::consts::FRAC_PI_2]);
    let mut collisions = Collisions::new(&solids);
    collisions.update(&solids, &kinematics);
    (solids.kind(0), collisions.distance(&solids, 0))
}

#[test]
fn mesh_distances_use_a_hull_a_surface_or_a_capsule() {
    let (kind, found) = mesh_and_ball(MeshMode::default(), 3.0);
    assert_eq!(kind, SolidKind::Hull { corners: 8 });
    assert_relative_eq!(found.distance, 1.5, epsilon = 1e-9);
    assert_relative_eq!(found.points[0].x, 1.0, epsilon = 1e-9);
    // The centre of the ball inside: out through the thin side.
    let (_, found) = mesh_and_ball(MeshMode::default(), 0.2);
    assert_relative_eq!(found.distance, -1.0, epsilon = 1e-9);
    assert_relative_eq!(found.normal.y.abs(), 1.0, epsilon = 1e-9);

    let (kind, found) = mesh_and_ball(MeshMode::Surface, 3.0);
    assert_eq!(kind, SolidKind::Surface { triangles: 12 });
    assert_relative_eq!(found.distance, 1.5, epsilon = 1e-9);
    let (_, found) = mesh_and_ball(MeshMode::Surface, 1.2);
    assert_relative_eq!(found.distance, -0.3, epsilon = 1e-9);

    // more corners than allowed: a capsule around all of them, hence closer
    for mode in [MeshMode::Hull { most_corners: 7 }, MeshMode::Capsule] {
        let (kind, found) = mesh_and_ball(mode, 3.0);
        assert_eq!(kind, SolidKind::Fitted);
        assert!((0.3..1.5).contains(&found.distance), "{}", found.distance);
    }
}
