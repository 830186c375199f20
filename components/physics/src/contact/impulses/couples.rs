//! Torques against rolling and spinning: one site each, after all contact points.

use nalgebra::{Point3, Vector3};

use super::super::axes::axes;
use super::super::colliders::Owner;
use super::super::objects::FreeBody;
use super::super::point::ContactPoint;
use super::super::site::Site;
use super::Impulses;
use super::turning::add_turning;

/// Key bit of the torques at a contact point; the other bits are the point's key.
const COUPLE: u64 = 1 << 62;

impl Impulses {
    /// Sets up the torques at contact points whose surfaces resist rolling or spinning, in the order of the
    /// points.
    pub(super) fn prepare_couples(
        &mut self,
        points: &[ContactPoint],
        falling: &[FreeBody],
        slopes: impl Fn(Owner, &Point3<f64>, &[Vector3<f64>; 3], f64, &mut [[f64; 4]]),
    ) {
        let n = self.n;
        let mut expected = points.len().min(self.last.len());
        for (place, point) in points.iter().enumerate().filter(|(_, point)| point.law.resists_turning()) {
            let index = self.sites.len();
            let (key, h) = (point.key | COUPLE, point.h);
            let (warm, found) = self.of_last(key, h, expected);
            expected = found.map_or(expected, |found| (found + 1) % self.last.len());
            self.keys.push((key, h));
            self.lambda[3 * index..][..3].copy_from_slice(&warm);
            if point.kept {
                self.sites.push(Site::KEPT);
                continue;
            }
            let mut site = Site::couple(place, point);
            let columns = &mut self.jacobian[index * n..][..n];
            for of in site.articulations() {
                columns[self.parts[of].clone()].fill([0.0; 4]);
            }
            for (owner, sign) in [(point.owners.0, 1.0), (point.owners.1, -1.0)] {
                if let Some(of) = owner.articulation() {
                    let columns = &mut columns[self.parts[of].clone()];
                    add_turning(&slopes, (owner, sign), &point.point, site.axes, columns);
                }
            }
            site.falling = [0, 1, 2].map(|axis| site.speed(axis, falling));
            self.sites.push(site);
        }
    }

    /// Returns the moments against rolling and spinning on the first of the two colliders of their contact
    /// points: the index of the point, and the moment in world axes \[N m s\].
    pub(crate) fn couples<'a>(
        &'a self,
        points: &'a [ContactPoint],
    ) -> impl Iterator<Item = (usize, Vector3<f64>)> + 'a {
        let places = points.iter().enumerate().filter(|(_, point)| point.law.resists_turning());
        places
            .enumerate()
            .map(|(place, (index, point))| (index, self.vector(points.len() + place, &axes(&point.normal))))
    }
}
