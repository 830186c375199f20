//! `motorium robot hulls`: makes collision meshes convex, for fast and robust contacts.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use motorium_robots::{MimicMode, PackagePath, TriangleMesh};
use nalgebra::Vector3;
use roxmltree::{Document, Node};
use serde_json::json;

use super::source::RobotArgs;
use super::urdf_text::text;
use crate::out::{errln, outln};
use crate::output::{Overwrite, write_file};
use crate::style;

/// Write a copy of a URDF in which each collision mesh is replaced by its convex hull or by several convex
/// parts.
///
/// A link with a visual mesh but no collision shape gets the hull of its visual. The copy and its collision
/// meshes are in one folder and need no packages; visuals are not changed.
///
/// Example: motorium robot hulls ur5.urdf --output ur5-hulls --parts 4
#[derive(Debug, clap::Args)]
pub(super) struct Hulls {
    #[command(flatten)]
    robot: RobotArgs,
    /// Folder to write to
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Maximum number of convex parts per mesh; 1 for its hull
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=256))]
    parts: u32,
    /// Maximum number of corners of a part
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(4..=1024))]
    corners: u32,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// A mesh of the robot's file.
struct Mesh {
    link: String,
    /// Range of the element to replace, or of the visual to insert after.
    place: std::ops::Range<usize>,
    origin: String,
    uri: String,
    scale: Vector3<f64>,
}

/// Result for one mesh.
#[derive(serde::Serialize)]
struct Made {
    link: String,
    mesh: String,
    files: Vec<String>,
    corners: usize,
}

impl Hulls {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let robot = match self.robot.open(MimicMode::Follow) {
            Ok(robot) => robot,
            Err(code) => return Ok(code),
        };
        let urdf = text(&robot)?;
        let document = Document::parse(&urdf).context("reading the file as XML")?;
        anyhow::ensure!(
            document.root_element().has_tag_name("robot"),
            "hulls are only written for URDF files; for MJCF files, MuJoCo and motorium compute the hulls of all meshes"
        );
        let meshes = meshes(&document);
        anyhow::ensure!(!meshes.is_empty(), "no link of robot `{}` has a mesh", robot.model.name());
        let name = robot.path.as_deref().and_then(Path::file_name).map(PathBuf::from);
        let file = self.output.join(name.unwrap_or_else(|| format!("{}.urdf", robot.model.name()).into()));
        anyhow::ensure!(
            robot.path.as_deref().and_then(|own| own.canonicalize().ok()) != file.canonicalize().ok()
                || !file.exists(),
            "{} is the robot itself; name another folder by --output",
            file.display()
        );
        self.overwrite.check(&[], [&file])?;
        let mut files: Vec<(PathBuf, String)> = Vec::new();
        let mut edits: Vec<(std::ops::Range<usize>, String)> = Vec::new();
        let (mut made, mut counts) = (Vec::new(), BTreeMap::<String, usize>::new());
        for mesh in meshes {
            match self.parts_of(&mesh, robot.path.as_deref(), (&mut counts, &mut files)) {
                Ok((elements, one)) => {
                    edits.push((mesh.place, elements));
                    made.push(one);
                }
                Err(error) => {
                    errln!("{}: link \"{}\": {error:#}", style::warning("warning"), mesh.link);
                }
            }
        }
        anyhow::ensure!(!made.is_empty(), "no mesh of the robot could be used");
        let mut copy = urdf.clone();
        edits.sort_by_key(|(place, _)| std::cmp::Reverse(place.start));
        for (place, elements) in edits {
            copy.replace_range(place, &elements);
        }
        files.push((file.clone(), copy));
        self.overwrite.check(&robot.path, files.iter().map(|(path, _)| path))?;
        files.iter().try_for_each(|(path, text)| write_file(path, text))?;
        if self.json {
            outln!(
                "{}",
                serde_json::to_string_pretty(&json!({ "file": file.display().to_string(), "meshes": made }))?
            );
            return Ok(ExitCode::SUCCESS);
        }
        for one in &made {
            let (parts, corners) = (one.files.len(), one.corners);
            let several = if parts == 1 { "" } else { "s" };
            outln!("{}: {}: {parts} part{several}, {corners} corners", style::strong(&one.link), one.mesh);
        }
        outln!("{} {}", style::good("wrote"), file.display());
        Ok(ExitCode::SUCCESS)
    }

    /// Adds the files of the convex parts of a mesh, and returns the elements that replace it.
    fn parts_of(
        &self,
        mesh: &Mesh,
        file: Option<&Path>,
        (counts, contents): (&mut BTreeMap<String, usize>, &mut Vec<(PathBuf, String)>),
    ) -> anyhow::Result<(String, Made)> {
        let environment = PackagePath::from_env();
        let mut packages = PackagePath { folders: self.robot.package_path.clone(), prefixes: Vec::new() };
        packages.folders.extend(environment.folders);
        packages.prefixes.extend(environment.prefixes);
        let path = packages.resolve(&mesh.uri, file).map_err(|_| {
            anyhow::anyhow!("mesh {} was not found; name its folder with --package-path", mesh.uri)
        })?;
        let parts = TriangleMesh::read(&path)?
            .scaled(&mesh.scale)
            .convex_parts(self.parts as usize, self.corners as usize);
        anyhow::ensure!(!parts.is_empty(), "mesh {} is flat, so it has no hull", mesh.uri);
        let (mut elements, mut files, mut corners) = (String::new(), Vec::new(), 0);
        for part in &parts {
            let count = counts.entry(mesh.link.clone()).or_default();
            let kept = |c: char| if c.is_ascii_alphanumeric() || c == '_' || c == '-' { c } else { '_' };
            let name = format!("meshes/{}_{count}.obj", mesh.link.chars().map(kept).collect::<String>());
            *count += 1;
            contents.push((self.output.join(&name), part.to_obj()));
            let _ = write!(
                elements,
                "<collision>{}<geometry><mesh filename=\"{name}\"/></geometry></collision>",
                mesh.origin
            );
            corners += part.points.len();
            files.push(name);
        }
        Ok((elements, Made { link: mesh.link.clone(), mesh: mesh.uri.clone(), files, corners }))
    }
}

/// Returns the collision meshes: collision shapes, or visuals of links without any.
fn meshes(document: &Document<'_>) -> Vec<Mesh> {
    let links = document.root_element().children().filter(|node| node.has_tag_name("link"));
    let of_link = |link: Node<'_, '_>| -> Vec<Mesh> {
        let name = link.attribute("name").unwrap_or_default();
        let shapes = |kind: &'static str| link.children().filter(move |node| node.has_tag_name(kind));
        let visual = shapes("collision").next().is_none();
        let chosen = shapes(if visual { "visual" } else { "collision" });
        chosen.filter_map(|shape| mesh(shape, name, visual)).collect()
    };
    links.flat_map(of_link).collect()
}

fn mesh(shape: Node<'_, '_>, link: &str, visual: bool) -> Option<Mesh> {
    let child = |node: Node<'_, '_>, name: &str| {
        node.children().find(|child| child.has_tag_name(name)).map(|n| n.id())
    };
    let document = shape.document();
    let find = |node, name: &str| child(node, name).and_then(|id| document.get_node(id));
    let mesh = find(find(shape, "geometry")?, "mesh")?;
    let scale: Vec<f64> = mesh
        .attribute("scale")
        .unwrap_or("1 1 1")
        .split_whitespace()
        .filter_map(|x| x.parse().ok())
        .collect();
    let range = shape.range();
    let origin = find(shape, "origin").map(|origin| document.input_text()[origin.range()].to_string());
    Some(Mesh {
        link: link.to_string(),
        // after a visual, instead of a collision shape
        place: if visual { range.end..range.end } else { range },
        origin: origin.unwrap_or_default(),
        uri: mesh.attribute("filename")?.to_string(),
        scale: Vector3::from_iterator(scale.into_iter().chain([1.0; 3]).take(3)),
    })
}
