//! Worlds for motorium: the surroundings of robots, shared by physics, sensors, collision constraints and
//! views. This crate does not depend on the runtime.
//!
//! A [`World`] is read from TOML, or from an MJCF, URDF or SDF file. [`Terrain`] describes uneven ground and
//! becomes a [`HeightField`]. A [`RayScene`] casts rays against robots and worlds.
//!
//! ```
//! use motorium_worlds::{ObjectShape, World};
//!
//! let text = r#"
//! ground = { friction = 0.8 }
//! [[objects]]
//! name     = "crate"
//! shape    = { box = { size = [0.4, 0.4, 0.4] } }
//! position = [2.0, 0.0, 0.2]
//! mass     = 3.0
//! "#;
//! let world: World = toml::from_str(text).unwrap();
//! world.check(std::iter::empty()).unwrap();
//! assert!(matches!(world.objects[0].shape, ObjectShape::Box { .. }));
//! ```
//!
//! Units are SI, angles in radians. Poses are in the world frame, z up.
//!
//! # Modules
//!
//! Each module uses only modules above it:
//!
//! | module | contents |
//! |---|---|
//! | `surface`, `appearance` | friction, softness and grain; colours and light |
//! | `terrain` | height fields and their descriptions |
//! | `world` | objects, ground, connections, and readers of files |
//! | `rays` | ray casting |

mod appearance;
mod rays;
mod surface;
mod terrain;
mod world;

pub use appearance::{Appearance, Checker, Light};
pub use rays::{Ray, RayHit, RayScene, RayShape};
pub use surface::{FrictionCombine, Grain, Softness};
pub use terrain::{HeightField, NearTriangle, Terrain, TerrainError, TerrainLayer};
pub use world::{
    CompoundPart, Connection, ConnectionKind, Conveyor, Copies, Ground, MeshBody, MeshCollision, MeshShape,
    MjcfWorld, Object, ObjectMass, ObjectShape, World, WorldError, WorldFileError, gravity_of_file,
    parse_mjcf_world,
};
