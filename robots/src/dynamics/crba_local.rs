//! The composite rigid body algorithm in the bodies' own frames.
//!
//! Cheaper than base coordinates where limbs are not long: no body has to be placed, and a joint's wrench is a column of
//! its composite's inertia; but each wrench has to be carried down to the base step by step. All wrenches from beyond a
//! body go through the same step, so they are kept by component and carried side by side.

use super::Dynamics;
use crate::algebra::{M3, RigidInertia, S3, Spatial, V3, fused};
use crate::model::program::{Node, Program};

/// Wrenches carried side by side.
const ABREAST: usize = 4;

/// A body in its parent's frame, with the inertia of all it carries in its own.
#[derive(Clone, Debug)]
pub(super) struct Hanging {
    rotation: M3,
    translation: V3,
    inertia: RigidInertia,
}

impl Hanging {
    pub(super) const START: Self =
        Self { rotation: M3::IDENTITY, translation: V3::ZERO, inertia: RigidInertia::ZERO };
}

/// One wrench per body, by component: force x, y, z, moment x, y, z. All about the origin of the body that the recursion
/// has come down to.
#[derive(Clone, Debug)]
pub(super) struct Wrenches([Vec<f64>; 6]);

impl Wrenches {
    pub(super) fn new(bodies: usize) -> Self {
        // Room for a last step that is not full.
        Self(std::array::from_fn(|_| vec![0.0; bodies + ABREAST]))
    }

    /// Carries those of `first..end` to the parent. Beyond `end` there must be wrenches that no one needs, unless `keep`.
    #[inline(always)]
    fn carry<const FUSED: bool>(&mut self, first: usize, end: usize, keep: bool, r: &M3, p: V3) {
        let mut at = first;
        while at + ABREAST <= end || at < end && !keep {
            self.step::<FUSED, ABREAST>(at, r, p);
            at += ABREAST;
        }
        while at < end {
            self.step::<FUSED, 1>(at, r, p);
            at += 1;
        }
    }

    #[inline(always)]
    fn step<const FUSED: bool, const N: usize>(&mut self, at: usize, r: &M3, p: V3) {
        let mut parts = self.0.each_mut().map(|part| part[at..].first_chunk_mut::<N>());
        let [Some(fx), Some(fy), Some(fz), Some(mx), Some(my), Some(mz)] = &mut parts else { return };
        for k in 0..N {
            let force = turn::<FUSED>(r, V3::new(fx[k], fy[k], fz[k]), V3::ZERO);
            let moment = turn::<FUSED>(r, V3::new(mx[k], my[k], mz[k]), p.cross(force));
            (fx[k], fy[k], fz[k]) = (force.x, force.y, force.z);
            (mx[k], my[k], mz[k]) = (moment.x, moment.y, moment.z);
        }
    }

    #[inline(always)]
    fn set(&mut self, index: usize, wrench: Spatial) {
        for (part, entry) in self.0.iter_mut().zip(wrench.array()) {
            part[index] = entry;
        }
    }
}

impl Dynamics {
    /// Upper triangle of the mass matrix of a model without mimic joints whose bodies stand depth first, the base's own
    /// block apart. Leaves the inertia of the whole in the first slot of `composite`.
    #[inline(always)]
    pub(super) fn mass_in_place<const FUSED: bool>(&mut self, program: &Program, out: &mut [f64], n: usize) {
        self.hanging[0].inertia = program.base;
        for ((node, position), body) in
            program.nodes.iter().zip(self.positions.iter()).zip(&mut self.hanging[1..])
        {
            (body.rotation, body.translation) = node.pose(position);
            body.inertia = node.inertia;
        }
        let count = program.nodes.len();
        for (index, node) in program.nodes.iter().enumerate().rev() {
            let (outer, inner) = self.hanging.split_at_mut(index + 1);
            let body = &inner[0];
            let end = program.ends[index];
            self.wrenches.set(index, unit_wrench(node, &body.inertia));
            let along = &self.wrenches.0[if node.prismatic { 2 } else { 5 }][index..end];
            // Without mimic joints columns stand in the order of the bodies.
            let columns = out[node.column * n..].chunks_mut(n);
            for (column, entry) in columns.zip(along) {
                column[node.column] = *entry;
            }
            if node.parent != 0 || program.floating {
                outer[node.parent].inertia += moved::<FUSED>(&body.inertia, &body.rotation, body.translation);
                self.wrenches.carry::<FUSED>(index, end, end < count, &body.rotation, body.translation);
            }
        }
        if program.floating {
            let rows = &self.wrenches.0;
            for (index, node) in program.nodes.iter().enumerate() {
                let column = &mut out[node.column * n..][..6];
                column.iter_mut().zip(rows).for_each(|(entry, row)| *entry = row[index]);
            }
        }
        self.composite[0].inertia = self.hanging[0].inertia;
    }
}

/// `r v + sum`
#[inline(always)]
fn turn<const FUSED: bool>(r: &M3, v: V3, sum: V3) -> V3 {
    add::<FUSED>(r.z, v.z, add::<FUSED>(r.y, v.y, add::<FUSED>(r.x, v.x, sum)))
}

/// `v scale + sum`
#[inline(always)]
fn add<const FUSED: bool>(v: V3, scale: f64, sum: V3) -> V3 {
    V3::new(
        fused::<FUSED>(v.x, scale, sum.x),
        fused::<FUSED>(v.y, scale, sum.y),
        fused::<FUSED>(v.z, scale, sum.z),
    )
}

/// [`RigidInertia::moved`]
#[inline(always)]
fn moved<const FUSED: bool>(inertia: &RigidInertia, r: &M3, p: V3) -> RigidInertia {
    let s = &inertia.rotational;
    let column = |x, y, z| add::<FUSED>(r.z, z, add::<FUSED>(r.y, y, r.x * x));
    // r s, then the upper triangle of its product with r'
    let (a, b, c) = (column(s.xx, s.xy, s.xz), column(s.xy, s.yy, s.yz), column(s.xz, s.yz, s.zz));
    let entry =
        |a: f64, b: f64, c: f64, x: f64, y: f64, z: f64| fused::<FUSED>(c, z, fused::<FUSED>(b, y, a * x));
    let moment = column(inertia.moment.x, inertia.moment.y, inertia.moment.z);
    let half = add::<FUSED>(p, 0.5 * inertia.mass, moment);
    let rotational = S3 {
        xx: entry(a.x, b.x, c.x, r.x.x, r.y.x, r.z.x),
        xy: entry(a.x, b.x, c.x, r.x.y, r.y.y, r.z.y),
        xz: entry(a.x, b.x, c.x, r.x.z, r.y.z, r.z.z),
        yy: entry(a.y, b.y, c.y, r.x.y, r.y.y, r.z.y),
        yz: entry(a.y, b.y, c.y, r.x.z, r.y.z, r.z.z),
        zz: entry(a.z, b.z, c.z, r.x.z, r.y.z, r.z.z),
    };
    RigidInertia {
        mass: inertia.mass,
        moment: add::<FUSED>(p, inertia.mass, moment),
        rotational: rotational + S3::between(p, half),
    }
}

/// The wrench that accelerates `inertia` by one unit of the joint's motion: about z, or along it.
#[inline(always)]
fn unit_wrench(node: &Node, inertia: &RigidInertia) -> Spatial {
    let (h, i) = (inertia.moment, &inertia.rotational);
    if node.prismatic {
        Spatial::new(V3::new(0.0, 0.0, inertia.mass), V3::new(h.y, -h.x, 0.0))
    } else {
        Spatial::new(V3::new(-h.y, h.x, 0.0), V3::new(i.xz, i.yz, i.zz))
    }
}
