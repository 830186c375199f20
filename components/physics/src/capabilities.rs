//! Abilities that only some engines have.

/// The abilities of a simulator that only some engines have. Every engine supports robots with fixed bases,
/// several of them as one model, free and fixed objects, contacts, rays, commands, placement, reset, save and
/// restore.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Capabilities {
    /// Robots with a floating base, and several of them in one world.
    pub floating_bases: bool,
    /// Several [articulations](crate::Simulator::articulations). Without it,
    /// [`Simulator::place_at`](crate::Simulator::place_at) places all robots together.
    pub several_articulations: bool,
    /// Steps after the first do not allocate.
    pub allocation_free: bool,
    /// Torsional and rolling friction.
    pub rolling_friction: bool,
    /// Conveyors: surfaces that move tangentially.
    pub conveyors: bool,
    /// Compliant surfaces and direction-dependent friction.
    pub textures: bool,
    /// Contacts with the triangles of [meshes](motorium_worlds::MeshCollision) of objects. Every engine
    /// supports contacts with their convex parts.
    pub triangles: bool,
    /// Changes of physical [properties](crate::Properties) [during motion](crate::Simulation::change).
    pub changes: bool,
    /// A choice of integration methods.
    pub integrators: bool,
    /// [Connections](crate::Connection) between parts in addition to the joints of robots.
    pub connections: bool,
}
