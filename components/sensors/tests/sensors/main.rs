//! Tests of the sensor models, of their components in graphs, and of the state estimation.

mod allocations;
mod camera;
mod channel;
mod component;
mod contact;
mod crowded;
mod encoder;
mod estimator;
mod impacts;
mod imu;
mod invariant;
mod loads;
mod payload;
mod pictures;
mod place;
mod randomised;
mod rays;
mod shaped_terrain;
mod vocabulary;

motorium::count_allocations!();
