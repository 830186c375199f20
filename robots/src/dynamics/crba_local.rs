//! The composite rigid body algorithm in frames on the joints' axes.
//!
//! No body pose is needed, a joint's wrench is a column of its composite's inertia, and a step to the parent
//! consists of two screws about coordinate axes. In return, each wrench has to be propagated to the base step
//! by step. All wrenches from beyond a body share these steps, so they are propagated side by side, in blocks
//! that fill the registers.

use crate::math::{LANES, M3, RigidInertia, Spatial, Turn, V3, fused, sin_cos_abreast};
use crate::model::dh_frames::{DhBody, JointZeros, LinkTransform};
use crate::model::flat::FlatModel;

/// Wrenches side by side, by component: force x, y, z, moment x, y, z, all about the origin of the current
/// frame of the recursion.
#[derive(Clone, Debug)]
#[repr(align(32))]
struct Block([[f64; LANES]; 6]);

/// Index of a body's wrench in its block, and range of the wrenches of the bodies it carries.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Block of the body.
    block: usize,
    lane: usize,
    /// The block after the last.
    end: usize,
}

/// Joint positions in the layout of the steps.
#[derive(Clone, Debug)]
#[repr(align(32))]
struct Posture {
    sin: [f64; LANES],
    cos: [f64; LANES],
    sin2: [f64; LANES],
    cos2: [f64; LANES],
    lift: [f64; LANES],
}

/// Workspace of the algorithm.
#[derive(Clone, Debug)]
pub(super) struct CrbaWorkspace {
    postures: Vec<Posture>,
    places: Vec<Place>,
    blocks: Vec<Block>,
    /// Composite inertia of the branches other than the last, by slot.
    gathered: Vec<RigidInertia>,
}

impl CrbaWorkspace {
    pub(super) fn new(flat: &FlatModel) -> Self {
        const POSTURE: Posture = Posture {
            sin: [0.0; LANES],
            cos: [1.0; LANES],
            sin2: [0.0; LANES],
            cos2: [1.0; LANES],
            lift: [0.0; LANES],
        };
        let places = places(flat);
        let blocks = places.iter().map(|place| place.end).max().unwrap_or(0);
        Self {
            postures: vec![POSTURE; flat.nodes.len().div_ceil(LANES)],
            blocks: vec![Block([[0.0; LANES]; 6]); blocks],
            gathered: vec![RigidInertia::ZERO; flat.nodes.len() + 1],
            places,
        }
    }

    /// Computes the mass matrix of a model without mimic joints whose bodies are ordered depth first, except
    /// for the base's own block: the upper triangle, and the lower one if `BOTH`. Returns the inertia of the
    /// whole robot.
    #[inline(always)]
    pub(super) fn mass<const FUSED: bool, const BOTH: bool>(
        &mut self,
        flat: &FlatModel,
        q: &[f64],
        out: &mut [f64],
        n: usize,
    ) -> RigidInertia {
        let CrbaWorkspace { postures, places, blocks, gathered } = self;
        let (q, first_column) = if flat.floating { (&q[7..], 6) } else { (q, 0) };
        let frames = &flat.dh_frames;
        for ((posture, zero), q) in postures.iter_mut().zip(&frames.zeros).zip(q.chunks(LANES)) {
            posture.take::<FUSED>(zero, q);
        }
        gathered[0] = flat.base;
        // Composite inertia from the body above.
        let mut carried = RigidInertia::ZERO;
        let bodies = frames.bodies.iter().zip(&*places).zip(&flat.ends).enumerate();
        for (index, ((body, place), &end)) in bodies.rev() {
            let mut inertia = body.inertia;
            inertia += carried;
            if body.forks {
                inertia += std::mem::replace(&mut gathered[index + 1], RigidInertia::ZERO);
            }
            let blocks = &mut blocks[place.block..place.end];
            let Some(own) = blocks.first_mut() else { return gathered[0] };
            own.set(place.lane, unit_wrench(body, &inertia));
            // without mimic joints, columns have the order of the bodies
            let component = if body.prismatic { 2 } else { 5 };
            let column = first_column + index;
            let mut at = column * n + column;
            for other in &places[index..end] {
                out[at] = blocks[other.block - place.block].0[component][other.lane];
                at += n;
            }
            if BOTH {
                let mirrored = &mut out[column * n + column..][..end - index];
                for (other, entry) in places[index..end].iter().zip(mirrored) {
                    *entry = blocks[other.block - place.block].0[component][other.lane];
                }
            }
            if body.parent == 0 && !flat.floating {
                carried = RigidInertia::ZERO;
                continue;
            }
            let posture = &postures[index / LANES];
            let (turn, lift) = posture.lane(index % LANES);
            let screwed = inertia.screwed_z::<FUSED>(&turn, lift);
            let handed = match &body.transform {
                LinkTransform::CommonNormal { turn: twist, shift } => {
                    blocks.iter_mut().for_each(|block| {
                        block.screw_z::<FUSED>(&turn, lift);
                        block.screw_x::<FUSED>(twist, *shift);
                    });
                    screwed.screwed_x::<FUSED>(twist, *shift)
                }
                LinkTransform::General { rotation, translation } => {
                    blocks.iter_mut().for_each(|block| {
                        block.screw_z::<FUSED>(&turn, lift);
                        block.set_placement::<FUSED>(rotation, *translation);
                    });
                    screwed.moved(rotation, *translation)
                }
            };
            if body.parent == index && index != 0 {
                carried = handed;
            } else {
                gathered[body.parent] += handed;
                carried = RigidInertia::ZERO;
            }
        }
        if flat.floating {
            for (index, place) in places.iter().enumerate() {
                let column = first_column + index;
                for (row, component) in blocks[place.block].0.iter().enumerate() {
                    out[column * n + row] = component[place.lane];
                    if BOTH {
                        out[row * n + column] = component[place.lane];
                    }
                }
            }
        }
        gathered[0]
    }
}

/// Assigns lanes to the bodies in order. A branch next to another starts a new block, so that a step
/// processes all lanes of its blocks.
fn places(flat: &FlatModel) -> Vec<Place> {
    let mut places: Vec<Place> = Vec::with_capacity(flat.ends.len());
    let mut next: usize = 0;
    for (index, node) in flat.nodes.iter().enumerate().take(flat.ends.len()) {
        if node.parent != index {
            next = next.next_multiple_of(LANES);
        }
        places.push(Place { block: next / LANES, lane: next % LANES, end: 0 });
        next += 1;
    }
    for (index, &end) in flat.ends.iter().enumerate() {
        places[index].end = places[end - 1].block + 1;
    }
    places
}

impl Posture {
    /// Loads `q`: all joints, up to [`LANES`].
    #[inline(always)]
    fn take<const FUSED: bool>(&mut self, zero: &JointZeros, q: &[f64]) {
        let mut positions = [0.0; LANES];
        match q.first_chunk() {
            Some(all) => positions = *all,
            None => positions.iter_mut().zip(q).for_each(|(position, q)| *position = *q),
        }
        let mut angles = positions;
        angles.iter_mut().zip(&zero.turning).for_each(|(angle, turning)| *angle *= turning);
        let (mut sin, mut cos) = ([0.0; LANES], [0.0; LANES]);
        sin_cos_abreast::<FUSED>(&angles, &mut sin, &mut cos);
        for i in 0..LANES {
            let s = fused::<FUSED>(sin[i], zero.cos[i], cos[i] * zero.sin[i]);
            let c = fused::<FUSED>(cos[i], zero.cos[i], -(sin[i] * zero.sin[i]));
            (self.sin[i], self.cos[i]) = (s, c);
            self.sin2[i] = 2.0 * s * c;
            self.cos2[i] = fused::<FUSED>(c, c, -(s * s));
            self.lift[i] = fused::<FUSED>(positions[i], zero.sliding[i], zero.lift[i]);
        }
    }

    #[inline(always)]
    fn lane(&self, lane: usize) -> (Turn, f64) {
        let turn =
            Turn { sin: self.sin[lane], cos: self.cos[lane], sin2: self.sin2[lane], cos2: self.cos2[lane] };
        (turn, self.lift[lane])
    }
}

impl Block {
    /// Writes a wrench into a lane by writing whole registers, which the steps then read.
    #[inline(always)]
    fn set(&mut self, lane: usize, wrench: Spatial) {
        for (part, entry) in self.0.iter_mut().zip(wrench.array()) {
            for (k, value) in part.iter_mut().enumerate() {
                *value = if k == lane { entry } else { *value };
            }
        }
    }

    /// Applies a rotation about z and a translation along it.
    #[inline(always)]
    fn screw_z<const FUSED: bool>(&mut self, turn: &Turn, lift: f64) {
        let [fx, fy, _, mx, my, _] = &mut self.0;
        for k in 0..LANES {
            let (x, y) = turn.across::<FUSED>(fx[k], fy[k]);
            let (a, b) = turn.across::<FUSED>(mx[k], my[k]);
            (fx[k], fy[k]) = (x, y);
            (mx[k], my[k]) = (fused::<FUSED>(-lift, y, a), fused::<FUSED>(lift, x, b));
        }
    }

    /// Applies a rotation about x and a translation along it.
    #[inline(always)]
    fn screw_x<const FUSED: bool>(&mut self, turn: &Turn, shift: f64) {
        let [_, fy, fz, _, my, mz] = &mut self.0;
        for k in 0..LANES {
            let (y, z) = turn.across::<FUSED>(fy[k], fz[k]);
            let (b, c) = turn.across::<FUSED>(my[k], mz[k]);
            (fy[k], fz[k]) = (y, z);
            (my[k], mz[k]) = (fused::<FUSED>(-shift, z, b), fused::<FUSED>(shift, y, c));
        }
    }

    #[inline(always)]
    fn set_placement<const FUSED: bool>(&mut self, r: &M3, p: V3) {
        let [fx, fy, fz, mx, my, mz] = &mut self.0;
        for k in 0..LANES {
            let force = turn::<FUSED>(r, V3::new(fx[k], fy[k], fz[k]), V3::ZERO);
            let moment = turn::<FUSED>(r, V3::new(mx[k], my[k], mz[k]), p.cross(force));
            (fx[k], fy[k], fz[k]) = (force.x, force.y, force.z);
            (mx[k], my[k], mz[k]) = (moment.x, moment.y, moment.z);
        }
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

/// Returns the wrench that accelerates `inertia` by one unit of the joint's motion, about z or along it.
#[inline(always)]
fn unit_wrench(body: &DhBody, inertia: &RigidInertia) -> Spatial {
    let (h, i) = (inertia.moment, &inertia.rotational);
    if body.prismatic {
        Spatial::new(V3::new(0.0, 0.0, inertia.mass), V3::new(h.y, -h.x, 0.0))
    } else {
        Spatial::new(V3::new(-h.y, h.x, 0.0), V3::new(i.xz, i.yz, i.zz))
    }
}
