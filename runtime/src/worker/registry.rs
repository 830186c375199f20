//! Component types, by name.

use std::path::Path;

use super::hosted::{Host, Hosted};
use super::{Failure, MakeType, Outcome, Worker};
use crate::component::{Component, DynamicComponent};
use crate::declare::{ConfigError, Declaration, Declare, RobotReference};

/// A component type with its name, and the functions that the launcher and the worker call.
#[derive(Debug, Clone, Copy)]
pub struct Kind {
    /// Name of the kind in graph files, `family.name`.
    pub name: &'static str,
    /// One-line description, which is shown in lists of kinds.
    pub summary: &'static str,
    /// True if the kind's configuration has a key `world`, which defaults to the graph's `[world]`.
    pub reads_world: bool,
    /// True if the kind's configuration has a key `gravity`, which defaults to the gravity of the graph's
    /// `[world]`.
    pub reads_gravity: bool,
    declare: DeclareFunction,
    schema: fn(&mut schemars::SchemaGenerator) -> schemars::Schema,
    make: MakeType,
}

type DeclareFunction = fn(serde_json::Value, Declare) -> Result<Declaration, ConfigProblem>;

/// A configuration that was rejected.
#[derive(Debug, Clone, PartialEq)]
pub struct ConfigProblem {
    /// True if the configuration could not be parsed and was therefore not passed to the component.
    pub unread: bool,
    /// Error with the invalid key, the found value and the expected values.
    pub error: ConfigError,
}

impl Kind {
    /// Creates the kind of a component type.
    ///
    /// A library should return its kinds from a function marked `#[inline(never)]`. The steps of its
    /// components are then compiled and optimised with the library. If the function were inlined, the steps
    /// would be compiled with each caller and its optimisation level.
    pub const fn of<C: Component>() -> Self {
        Self {
            name: C::KIND,
            summary: C::SUMMARY,
            reads_world: C::READS_WORLD,
            reads_gravity: C::READS_GRAVITY,
            declare: declare::<C>,
            schema: |generator| generator.subschema_for::<C::Config>(),
            make: super::make::<C>,
        }
    }

    /// Parses a configuration and returns the ports and parameters that the component declares for this
    /// configuration.
    ///
    /// # Errors
    /// The configuration is invalid. The error names the key.
    pub fn declare(
        &self,
        config: serde_json::Value,
        robot: Option<RobotReference>,
    ) -> Result<Declaration, ConfigProblem> {
        self.declare_in(config, Declare::new(robot))
    }

    /// Declares the ports and parameters like [`declare`](Self::declare), in a declaration that already
    /// contains the robots and the placement in the graph.
    ///
    /// # Errors
    /// The configuration is invalid, or a component of this kind supports at most one robot.
    pub fn declare_in(
        &self,
        config: serde_json::Value,
        declare: Declare,
    ) -> Result<Declaration, ConfigProblem> {
        (self.declare)(config, declare)
    }

    /// Runs a component from configuration to its end.
    pub(crate) fn run(&self, worker: Worker) -> Outcome {
        super::run(worker, Box::new(self.make))
    }

    /// Configures a component of a run in the calling thread.
    pub(crate) fn open(&self, host: &Host<'_>, index: usize) -> Result<Box<dyn Hosted>, Failure> {
        super::hosted::open(host, index, Box::new(self.make))
    }

    /// Returns the JSON Schema (draft 7) of the `config` table, and the definitions to which it refers.
    pub fn config_schema(&self) -> (serde_json::Value, serde_json::Value) {
        let mut generator = schemars::generate::SchemaSettings::draft07().for_deserialize().into_generator();
        let schema = self.schema(&mut generator).to_value();
        (schema, serde_json::Value::Object(generator.take_definitions(true)))
    }

    /// Returns the JSON Schema of the `config` table.
    pub fn schema(&self, generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        (self.schema)(generator)
    }
}

fn declare<C: Component>(
    config: serde_json::Value,
    mut declare: Declare,
) -> Result<Declaration, ConfigProblem> {
    let config: C::Config =
        super::config::read(config).map_err(|error| ConfigProblem { unread: true, error })?;
    let declared = C::declare(&config, &mut declare);
    declaration(declare, declared, C::KIND, C::RESETS)
}

/// Declares a component that is only known at run time.
pub(crate) fn declare_dynamic(
    component: &dyn DynamicComponent,
    config: &serde_json::Value,
    mut declare: Declare,
) -> Result<Declaration, ConfigProblem> {
    let declared = component.declare(config, &mut declare);
    let resets = declare.declaration.resets;
    declaration(declare, declared, component.kind(), resets)
}

/// Returns the collected declaration of a component of this kind.
fn declaration(
    declare: Declare,
    declared: Result<(), ConfigError>,
    kind: &str,
    resets: bool,
) -> Result<Declaration, ConfigProblem> {
    if !declare.robots_fit() {
        let error = ConfigError::key("robots", format!("`{kind}` supports at most one robot"))
            .advise("write `robot = \"NAME\"`, and add a separate component for each further robot");
        return Err(ConfigProblem { unread: false, error });
    }
    declared.map_err(|error| ConfigProblem { unread: false, error })?;
    Ok(Declaration { resets, ..declare.into_declaration() })
}

/// Function that checks that the model and the profile of a robot exist and can be loaded. Returns warnings.
/// An error contains the reason and advice. It names the invalid key, or no key if the invalid key is `urdf`.
pub type RobotCheck = fn(&RobotReference) -> Result<Vec<String>, ConfigError>;

/// Function that reads the gravity \[m/s^2\] from a file named by a graph's `[world]`. The error contains the
/// reason why the file cannot be read.
pub type GravityOfFile = fn(&Path) -> Result<[f64; 3], ConfigError>;

/// Access to the robots that a program can load. The runtime itself provides no robots.
#[derive(Debug, Clone, Copy)]
pub struct RobotSource {
    /// Checks a robot of a graph file.
    pub check: RobotCheck,
}

/// An installed program that hosts kinds of components which the current program lacks.
///
/// The program must be in the folder of the program that checks the graph, or on `PATH`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sibling {
    /// First part of the names of the program's kinds, such as `view` of `view.web`.
    pub family: &'static str,
    /// Name of the program.
    pub program: &'static str,
    /// Command that installs the program from a checkout of motorium; `None` for a program that is not part
    /// of motorium.
    pub install: Option<&'static str>,
}

/// The component kinds and robots that a program provides, and the sibling programs that may host further
/// kinds.
#[derive(Debug, Clone)]
pub struct Registry {
    kinds: Vec<Kind>,
    robots: RobotSource,
    siblings: &'static [Sibling],
    gravity_of_file: Option<GravityOfFile>,
}

impl Registry {
    /// Creates a registry of kinds, which it sorts by name.
    ///
    /// # Panics
    /// If two kinds have the same name, which is an error in the program.
    pub fn new(robots: RobotSource, kinds: impl IntoIterator<Item = Kind>) -> Self {
        let mut kinds: Vec<Kind> = kinds.into_iter().collect();
        kinds.sort_by_key(|kind| kind.name);
        for pair in kinds.windows(2) {
            assert!(pair[0].name != pair[1].name, "two component kinds are named `{}`", pair[0].name);
        }
        Self { kinds, robots, siblings: &[], gravity_of_file: None }
    }

    /// Returns the registry with these sibling programs, which may host further kinds.
    #[must_use]
    pub fn with_siblings(self, siblings: &'static [Sibling]) -> Self {
        Self { siblings, ..self }
    }

    /// Returns the registry with a reader for the gravity in the file of a graph's `[world]`.
    /// `motorium_worlds::gravity_of_file` reads MJCF, URDF and SDF. Without a reader, if gravity is only set
    /// in the world's file, kinds that read gravity use their default, and `motorium check` prints a warning.
    #[must_use]
    pub fn with_gravity_of_file(self, reader: GravityOfFile) -> Self {
        Self { gravity_of_file: Some(reader), ..self }
    }

    /// Returns the reader for the gravity of world files, or `None`.
    pub fn gravity_of_file(&self) -> Option<GravityOfFile> {
        self.gravity_of_file
    }

    /// Returns the sibling program that is registered for the family of this kind, or `None` if no program is
    /// registered.
    pub fn sibling(&self, kind: &str) -> Option<&Sibling> {
        let (family, _) = kind.split_once('.')?;
        self.siblings.iter().find(|sibling| sibling.family == family)
    }

    /// Returns the sibling programs, which may host further kinds.
    pub fn siblings(&self) -> &'static [Sibling] {
        self.siblings
    }

    /// Returns all kinds, sorted by name.
    pub fn kinds(&self) -> &[Kind] {
        &self.kinds
    }

    /// Returns the kind with this name, or `None` if this program does not host it.
    pub fn find(&self, name: &str) -> Option<&Kind> {
        self.kinds.binary_search_by_key(&name, |kind| kind.name).ok().map(|i| &self.kinds[i])
    }

    /// Returns the access to the robots that the program can load.
    pub fn robots(&self) -> RobotSource {
        self.robots
    }
}
