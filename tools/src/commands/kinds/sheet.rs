//! Description of a kind.

use std::path::PathBuf;

use motorium::declare::{
    Declaration, Direction, ParameterDeclaration, PortDeclaration, RobotReference, TopicPattern,
};
use serde::Serialize;

use super::example::{self, ExampleConfig};
use super::keys::{self, Key};
use super::source::KindSource;

/// Description of a kind, from its declaration and the schema of its configuration.
#[derive(Debug, Serialize)]
pub(super) struct Sheet {
    pub(super) kind: String,
    pub(super) summary: String,
    /// Other program that hosts the kind.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) program: Option<PathBuf>,
    /// Page of the book.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) page: Option<String>,
    /// Robot with which the kind declared ports and parameters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) robot: Option<String>,
    /// Reason why the kind declares nothing with the example configuration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) refused: Option<String>,
    /// `true` if the kind applies commands to a robot.
    pub(super) actuator: bool,
    /// `true` if the kind can be reset for a new episode.
    pub(super) resets: bool,
    pub(super) ports: Vec<Port>,
    pub(super) parameters: Vec<ParameterDeclaration>,
    pub(super) config: Vec<Key>,
    /// A fragment of a graph.
    pub(super) example: String,
}

/// A port.
#[derive(Debug, Serialize)]
pub(super) struct Port {
    pub(super) name: String,
    pub(super) direction: Direction,
    #[serde(rename = "type")]
    pub(super) message: String,
    pub(super) pattern: TopicPattern,
    pub(super) required: bool,
    pub(super) description: String,
}

impl Sheet {
    /// Describes a kind with this robot, or with a supported one of the catalogue.
    pub(super) fn from_kind(kind: &KindSource<'_>, robot: Option<&str>) -> Self {
        let (schema, definitions) = kind.schema();
        let mut config = example::config(&schema, &definitions);
        let (name, mut declared) = declare(kind, &config, robot);
        if robot.is_some() && declared.is_err() {
            // the example may name links or joints of another robot
            let simplest = example::simplest_config(&schema, &definitions);
            if let (_, Ok(declaration)) = declare(kind, &simplest, robot) {
                (config, declared) = (simplest, Ok(declaration));
            }
        }
        let robot = name;
        let (declaration, refused) = match declared {
            Ok(declaration) => (declaration, None),
            Err(error) => (Declaration::default(), Some(error)),
        };
        Self {
            kind: kind.name().to_string(),
            summary: kind.summary().to_string(),
            program: kind.program().map(PathBuf::from),
            page: kind.page(),
            refused,
            actuator: declaration.actuator,
            resets: declaration.resets,
            example: example::fragment(kind, &declaration, robot.as_deref(), &config),
            robot,
            ports: declaration.ports.iter().map(Port::from_declaration).collect(),
            parameters: declaration.parameters,
            config: keys::collect(&schema, &definitions),
        }
    }
}

impl Port {
    fn from_declaration(port: &PortDeclaration) -> Self {
        Self {
            name: port.name.clone(),
            direction: port.direction,
            message: port.layout.type_name.clone(),
            pattern: port.pattern,
            required: port.required,
            description: port.doc.clone(),
        }
    }
}

/// Returns the declaration of a kind and the robot it was made with.
fn declare(
    kind: &KindSource<'_>,
    config: &ExampleConfig,
    robot: Option<&str>,
) -> (Option<String>, Result<Declaration, String>) {
    let ask = |robot: Option<&str>| kind.declare(config.value.clone(), robot.map(reference));
    if let Some(robot) = robot {
        return (Some(robot.to_string()), ask(Some(robot)));
    }
    let alone = match ask(None) {
        Ok(declaration) => return (None, Ok(declaration)),
        refused => refused,
    };
    let others = motorium_robots::catalogue().iter().map(|entry| entry.name);
    let mut refused = None;
    for robot in std::iter::once(FIRST).chain(others.filter(|name| *name != FIRST)) {
        match ask(Some(robot)) {
            Ok(declaration) => return (Some(robot.to_string()), Ok(declaration)),
            Err(error) => refused = refused.or(Some(error)),
        }
    }
    (None, refused.map_or(alone, Err))
}

/// Robot of most examples, which is tried first.
const FIRST: &str = "panda";

fn reference(robot: &str) -> RobotReference {
    let base = std::env::current_dir().unwrap_or_default();
    RobotReference { name: robot.to_string(), urdf: robot.to_string(), base, ..RobotReference::default() }
}
