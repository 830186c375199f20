//! Links and joints as a tree.

use std::collections::HashMap;

use urdf_rs::Robot;

use super::error::{UrdfError, UrdfProblem};
use super::source::Survey;
use crate::Position;
use crate::nearest::nearest;

/// The tree of one robot; indices into the links and joints of the file.
pub(crate) struct Structure {
    /// The link without a parent.
    pub(crate) root: usize,
    /// Joints, parents before children, depth first, siblings in file order.
    pub(crate) joints: Vec<Edge>,
}

pub(crate) struct Edge {
    pub(crate) joint: usize,
    pub(crate) parent: usize,
    pub(crate) child: usize,
}

/// Orders the joints and rejects anything other than a single tree.
pub(crate) fn structure(robot: &Robot, survey: &Survey) -> Result<Structure, UrdfError> {
    let links = unique("link", robot.links.iter().map(|link| &*link.name), &survey.links)?;
    let places: Vec<_> = survey.joints.iter().map(|joint| joint.at).collect();
    unique("joint", robot.joints.iter().map(|joint| &*joint.name), &places)?;

    let mut above: Vec<Option<usize>> = vec![None; robot.links.len()];
    let mut below: Vec<Vec<Edge>> = robot.links.iter().map(|_| Vec::new()).collect();
    for (index, joint) in robot.joints.iter().enumerate() {
        let find = |role: &'static str, name: &str| {
            links.get(name).copied().ok_or_else(|| {
                let nearest = nearest(name, links.keys().copied()).map(str::to_owned);
                let (joint, link) = (joint.name.clone(), name.to_owned());
                UrdfError::new(places[index], UrdfProblem::UnknownLink { joint, role, link, nearest })
            })
        };
        let parent = find("parent", &joint.parent.link)?;
        let child = find("child", &joint.child.link)?;
        if let Some(first) = above[child].replace(index) {
            let (first, second) = (robot.joints[first].name.clone(), joint.name.clone());
            let link = robot.links[child].name.clone();
            return Err(UrdfError::new(places[index], UrdfProblem::TwoParents { link, first, second }));
        }
        below[parent].push(Edge { joint: index, parent, child });
    }

    let roots: Vec<_> = (0..robot.links.len()).filter(|&link| above[link].is_none()).collect();
    if let [_, second, ..] = roots[..] {
        let names = roots.iter().map(|&link| robot.links[link].name.clone()).collect();
        return Err(UrdfError::new(survey.links[second], UrdfProblem::SeveralRoots(names)));
    }
    let mut joints = Vec::with_capacity(robot.joints.len());
    let mut reached = vec![false; robot.links.len()];
    let mut stack = Vec::new();
    if let Some(&root) = roots.first() {
        reached[root] = true;
        stack.extend(below[root].drain(..).rev());
    }
    while let Some(edge) = stack.pop() {
        reached[edge.child] = true;
        stack.extend(below[edge.child].drain(..).rev());
        joints.push(edge);
    }
    match (roots.first(), reached.iter().position(|reached| !reached)) {
        (Some(&root), None) => Ok(Structure { root, joints }),
        (_, lost) => Err(find_loop(robot, survey, &above, lost.unwrap_or(0), &links)),
    }
}

/// Returns the loop that separates `lost` from the root.
fn find_loop(
    robot: &Robot,
    survey: &Survey,
    above: &[Option<usize>],
    lost: usize,
    links: &HashMap<&str, usize>,
) -> UrdfError {
    let mut path: Vec<usize> = Vec::new();
    let mut link = lost;
    while !path.contains(&link) {
        path.push(link);
        // Every unreached link has a parent joint, otherwise it would be a root.
        if let Some(joint) = above[link] {
            link = links[&*robot.joints[joint].parent.link];
        }
    }
    path.drain(..path.iter().position(|&seen| seen == link).unwrap_or(0));
    path.push(link);
    let names = path.iter().rev().map(|&link| robot.links[link].name.clone()).collect();
    UrdfError::new(survey.links[link], UrdfProblem::Loop(names))
}

/// Returns the indices by name; a duplicate name is an error.
fn unique<'a>(
    what: &'static str,
    names: impl Iterator<Item = &'a str>,
    places: &[Position],
) -> Result<HashMap<&'a str, usize>, UrdfError> {
    let mut seen = HashMap::new();
    for (index, name) in names.enumerate() {
        if let Some(first) = seen.insert(name, index) {
            let (name, first) = (name.to_owned(), places[first].line);
            return Err(UrdfError::new(places[index], UrdfProblem::DuplicateName { what, name, first }));
        }
    }
    Ok(seen)
}
