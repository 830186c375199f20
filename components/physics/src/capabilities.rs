//! Optional features, which only some engines support.

/// Optional features of a simulation engine. Every engine supports robots with fixed bases, several robots in
/// one model, free and fixed objects, contacts, rays, commands, placement, reset, save and restore.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Capabilities {
    /// Floating bases, and several robots with a floating base in one world.
    pub floating_bases: bool,
    /// Several [articulations](crate::Simulator::articulations). If false,
    /// [`Simulator::place_at`](crate::Simulator::place_at) places all robots together.
    pub several_articulations: bool,
    /// No heap allocation in any step after the first.
    pub allocation_free: bool,
    /// Torsional and rolling friction.
    pub rolling_friction: bool,
    /// Conveyors: surfaces that move tangentially.
    pub conveyors: bool,
    /// Surface textures: soft surfaces and direction-dependent friction.
    pub textures: bool,
    /// Collision with the triangles of [meshes](motorium_worlds::MeshCollision) of objects. Every engine
    /// supports collision with convex parts of meshes.
    pub triangles: bool,
    /// Changes of physical [properties](crate::Properties) during motion, by
    /// [`Simulation::change`](crate::Simulation::change).
    pub changes: bool,
    /// Choice of the [integration method](crate::Integrator).
    pub integrators: bool,
    /// [Connections](crate::Connection) between parts in addition to the joints of robots.
    pub connections: bool,
}
