//! Answer: every quantity at every state, in the layout of the input.

use motorium_robots::{Dynamics, FrameId, Kinematics, Model, Momentum, Reference, Twist};
use nalgebra::{DMatrix, Isometry3};
use serde_json::{Map, Value, json};

use super::states::{State, States};

/// Returns the complete answer.
pub(super) fn answer(model: &Model, states: &States) -> anyhow::Result<Value> {
    let mut work = Work {
        model,
        states,
        columns: states.layout.columns(model),
        dynamics: Dynamics::new(model),
        moving: Kinematics::new(model),
        accelerating: Kinematics::new(model),
    };
    let cases: Vec<Value> = states.cases.iter().map(|state| work.case(state)).collect();
    let frames = states.frames.iter().map(|id| model.frames()[id.index()].name.clone());
    Ok(json!({
        "format": 1,
        "robot": model.name(),
        "floating_base": model.base().floating,
        "nq": states.layout.nq,
        "nv": states.layout.nv,
        "total_mass": model.mass(),
        "gravity": states.gravity.as_slice(),
        "dt": states.dt,
        "joints": states.layout.json(),
        "jacobian_frames": frames.collect::<Vec<_>>(),
        "cases": cases,
    }))
}

struct Work<'a> {
    model: &'a Model,
    states: &'a States,
    /// Index in our velocity vector for each entry of theirs.
    columns: Vec<usize>,
    dynamics: Dynamics,
    moving: Kinematics,
    accelerating: Kinematics,
}

impl Work<'_> {
    fn case(&mut self, state: &State) -> Value {
        let (model, gravity) = (self.model, self.states.gravity);
        let State { q, v, a, tau, .. } = state;
        let n = model.nv();
        let offset = model.nq() - model.joint_count();
        let named = model.joint_names().iter().zip(&q[offset..]).map(|(name, q)| (name.clone(), json!(q)));
        let mut case = Map::new();
        let mut put = |key: &str, value: Value| case.insert(key.to_string(), value);
        put("q", json!(state.q_given));
        put("joint_positions", Value::Object(named.collect()));
        for (key, ours) in [("v", v), ("a", a), ("tau", tau)] {
            put(key, self.tangent(ours));
        }
        let mut mass = DMatrix::zeros(n, n);
        self.dynamics.crba(model, q, &mut mass);
        put("M_upper", self.upper(&mass));
        let mut out = vec![0.0; n];
        self.dynamics.gravity(model, q, gravity, &mut out);
        put("gravity", self.tangent(&out));
        self.dynamics.bias(model, q, v, gravity, &mut out);
        put("nle", self.tangent(&out));
        self.dynamics.rnea(model, q, v, a, gravity, &mut out);
        put("rnea", self.tangent(&out));
        // A robot with a singular mass matrix has no forward dynamics.
        let solved = self.dynamics.forward(model, q, v, tau, gravity, &mut out);
        put("aba", solved.map_or(Value::Null, |()| self.tangent(&out)));
        if let Some((frame, wrench)) = state.wrench {
            let vector = [wrench.force.as_slice(), wrench.moment.as_slice()].concat();
            let name = &model.frames()[frame.index()].name;
            put("fext", json!({ "frame": name, "wrench_local": vector }));
            let wrenches = [(frame, wrench)];
            self.dynamics.rnea_external(model, q, v, a, gravity, &wrenches, &mut out);
            put("rnea_fext", self.tangent(&out));
            let solved = self.dynamics.forward_external(model, q, v, tau, gravity, &wrenches, &mut out);
            put("aba_fext", solved.map_or(Value::Null, |()| self.tangent(&out)));
        }
        self.moving.update_with_velocity(model, q, v);
        self.accelerating.update_with_acceleration(model, q, v, a);
        put("frames", self.frames());
        self.whole(state, &mut case);
        Value::Object(case)
    }

    /// Adds the centre of mass, momentum, energies, and the integration on the configuration manifold to
    /// `case`.
    fn whole(&mut self, state: &State, case: &mut Map<String, Value>) {
        let model = self.model;
        let State { q, v, a, .. } = state;
        let n = model.nv();
        let mut put = |key: &str, value: Value| case.insert(key.to_string(), value);
        let com = self.accelerating.centre_of_mass(model);
        put("com", json!(com.position.as_slice()));
        put("vcom", json!(com.velocity.as_slice()));
        put("acom", json!(com.acceleration.as_slice()));
        let mut three = DMatrix::zeros(3, n);
        self.accelerating.com_jacobian(model, &mut three);
        put("J_com", self.matrix(&three));
        let mut six = DMatrix::zeros(6, n);
        self.dynamics.centroidal_map(model, q, &mut six);
        put("Ag", self.matrix(&six));
        let both =
            |momentum: Momentum| json!([momentum.linear.as_slice(), momentum.angular.as_slice()].concat());
        put("hg", both(self.dynamics.momentum(model, q, v)));
        put("dhg", both(self.dynamics.momentum_rate(model, q, v, a)));
        put("Agdot_v", both(self.dynamics.momentum_rate(model, q, v, &vec![0.0; n])));
        put("kinetic_energy", json!(self.dynamics.kinetic_energy(model, q, v)));
        put("potential_energy", json!(self.dynamics.potential_energy(model, q, self.states.gravity)));
        let step: Vec<f64> = v.iter().map(|v| v * self.states.dt).collect();
        let mut after = vec![0.0; model.nq()];
        model.integrate(q, &step, &mut after);
        put("q_integrated", json!(self.states.layout.theirs(model, &after)));
        let mut difference = vec![0.0; n];
        model.difference(q, &after, &mut difference);
        put("q_difference", self.tangent(&difference));
    }

    /// Returns the poses of all frames, and the motions of the selected ones.
    fn frames(&self) -> Value {
        let frames = self.model.frames().iter().map(|frame| {
            let id = self.model.frame(&frame.name).expect("a frame of the model is found by its name");
            let pose: Isometry3<f64> = self.moving.pose(self.model, id);
            let rotation = pose.rotation.to_rotation_matrix();
            let rows: Vec<Vec<f64>> =
                rotation.matrix().row_iter().map(|row| row.iter().copied().collect()).collect();
            let mut entry = Map::new();
            entry.insert("p".to_string(), json!(pose.translation.vector.as_slice()));
            entry.insert("R".to_string(), json!(rows));
            if self.states.frames.contains(&id) {
                self.motion(id, &mut entry);
            }
            (frame.name.clone(), Value::Object(entry))
        });
        Value::Object(frames.collect())
    }

    fn motion(&self, id: FrameId, entry: &mut Map<String, Value>) {
        let model = self.model;
        let six = |twist: Twist| json!(twist.vector().as_slice());
        for (key, reference) in
            [("lwa", Reference::LocalWorldAligned), ("local", Reference::Local), ("world", Reference::World)]
        {
            let mut jacobian = DMatrix::zeros(6, model.nv());
            self.moving.jacobian(model, id, reference, &mut jacobian);
            entry.insert(format!("J_{key}"), self.matrix(&jacobian));
            entry.insert(format!("v_{key}"), six(self.moving.velocity_in(model, id, reference)));
        }
        entry.insert("a_classical_lwa".to_string(), six(self.accelerating.acceleration(model, id)));
        let spatial = self.accelerating.acceleration_in(model, id, Reference::Local);
        entry.insert("a_spatial_local".to_string(), six(spatial));
        entry.insert("Jdot_v_lwa".to_string(), six(self.moving.acceleration(model, id)));
    }

    /// Reorders a vector to their layout.
    fn tangent(&self, ours: &[f64]) -> Value {
        self.columns.iter().map(|&column| ours[column]).collect()
    }

    /// Reorders a matrix over our velocities, row by row, to their layout.
    fn matrix(&self, ours: &DMatrix<f64>) -> Value {
        let row = |row: usize| self.columns.iter().map(|&column| ours[(row, column)]).collect::<Value>();
        (0..ours.nrows()).map(row).collect()
    }

    /// Reorders the upper triangle of a symmetric matrix, row by row, to their layout.
    fn upper(&self, ours: &DMatrix<f64>) -> Value {
        let n = self.columns.len();
        let entries = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
        entries.map(|(i, j)| ours[(self.columns[i], self.columns[j])]).collect()
    }
}
