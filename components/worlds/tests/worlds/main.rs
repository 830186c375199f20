//! Tests of worlds: files, terrain, surfaces and rays.

mod height_pictures;
mod mujoco;
mod rays;
mod sdf_random;
mod surfaces;
mod terrain;
mod worlds;

#[path = "../../../../robots/tests/solids/random.rs"]
mod random;
