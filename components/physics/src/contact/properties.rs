//! Collider properties that may change between resets: their surfaces, and the heights of the terrain.

use std::sync::Arc;

use motorium_worlds::{Terrain, TerrainError};

use super::colliders::{Collider, Colliders};
use crate::Surface;

impl Colliders {
    /// Applies the heights of another terrain of the same size. Returns `true` if they differ.
    pub(crate) fn set_terrain(&mut self, terrain: Option<&Terrain>) -> Result<bool, TerrainError> {
        let (Some(terrain), Some(field)) = (terrain, &mut self.terrain) else { return Ok(false) };
        if self.described.as_ref() == Some(terrain) {
            return Ok(false);
        }
        *field = Arc::new(terrain.height_field()?);
        self.described = Some(terrain.clone());
        Ok(true)
    }

    /// Returns the surface of each collider.
    pub(crate) fn surfaces(&self) -> Vec<Surface> {
        let surface = |collider: &Collider| Surface {
            name: collider.name.clone(),
            friction: collider.friction,
            restitution: collider.restitution,
        };
        self.colliders.iter().map(surface).collect()
    }

    /// Sets the surface of each collider.
    pub(crate) fn set_surfaces(&mut self, surfaces: &[Surface]) {
        for (collider, surface) in self.colliders.iter_mut().zip(surfaces) {
            // Friction along the grain direction changes by the same factor.
            if let Some(grain) = &mut collider.grain {
                grain.scale(surface.friction);
            }
            (collider.friction, collider.restitution) = (surface.friction, surface.restitution);
        }
    }

    /// Returns `true` if any surface resists rolling or spinning.
    pub(crate) fn resist_turning(&self) -> bool {
        self.colliders.iter().any(|collider| collider.torsional > 0.0 || collider.rolling > 0.0)
    }
}
