//! Golden vectors: reading them and comparing a model with them.

use motorium_robots::{Dynamics, Kinematics, Model, Reference};
use nalgebra::{DMatrix, DVector, Isometry3, Vector3};
use serde_json::Value;

/// One JSON file of golden vectors.
pub(crate) struct Golden {
    document: Value,
}

/// The largest error of each quantity, relative to the largest entry of that quantity in its case.
#[derive(Default)]
pub(crate) struct Errors(pub(crate) Vec<(&'static str, f64)>);

impl Errors {
    fn add(&mut self, what: &'static str, ours: &[f64], theirs: &[f64]) {
        assert_eq!(ours.len(), theirs.len(), "size of {what}");
        let scale = theirs.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let worst = ours.iter().zip(theirs).fold(0.0_f64, |most, (x, y)| {
            assert!(x.is_finite(), "{what} is {x}");
            most.max((x - y).abs())
        });
        // Where everything is zero, a rounding of 1e-15 is not an infinite error: judge it by the unit.
        let error = worst / if scale > 1e-6 { scale } else { 1.0 };
        match self.0.iter_mut().find(|(name, _)| *name == what) {
            Some((_, most)) => *most = most.max(error),
            None => self.0.push((what, error)),
        }
    }

    /// Fails, naming the quantity, when one error exceeds its bound. `loose` holds for forward dynamics.
    pub(crate) fn stay_below(&self, bound: f64, loose: f64) {
        for (what, error) in &self.0 {
            let bound = if *what == "aba" { loose } else { bound };
            assert!(*error <= bound, "{what} is off by {error:.1e} relative, more than {bound:.0e}");
        }
    }

    /// One line: the worst of all and of each.
    pub(crate) fn summary(&self) -> String {
        let each: Vec<_> = self.0.iter().map(|(what, error)| format!("{what} {error:.1e}")).collect();
        each.join(", ")
    }
}

impl Golden {
    pub(crate) fn parse(text: &str) -> Self {
        Self { document: serde_json::from_str(text).unwrap() }
    }

    /// Compares every case with `model`, joint by joint and frame by frame, by name.
    pub(crate) fn compare(&self, model: &Model) -> Errors {
        let mut errors = Errors::default();
        let gravity = Vector3::from_column_slice(&numbers(&self.document["gravity"]));
        let cases = self.document["cases"].as_array().unwrap();
        assert!(!cases.is_empty());
        for case in cases {
            self.compare_case(model, gravity, case, &mut errors);
        }
        errors
    }

    fn compare_case(&self, model: &Model, gravity: Vector3<f64>, case: &Value, errors: &mut Errors) {
        let columns = self.columns(model);
        let arrange = |values: &[f64]| {
            let mut arranged = vec![0.0; model.nv()];
            columns.iter().zip(values).for_each(|(&column, value)| arranged[column] = *value);
            arranged
        };
        let joint_space = |key: &str| arrange(&numbers(&case[key]));
        let q = match &case["joint_positions"] {
            Value::Object(by_name) => {
                let of = |name: &String| by_name[name].as_f64().unwrap();
                model.joint_names().iter().map(of).collect()
            }
            _ => joint_space("q"),
        };
        let (v, a, tau) = (joint_space("v"), joint_space("a"), joint_space("tau"));

        let n = model.nv();
        let mut dynamics = Dynamics::new(model);
        let mut out = vec![f64::NAN; n];
        dynamics.gravity(model, &q, gravity, &mut out);
        errors.add("gravity", &out, &joint_space("gravity"));
        dynamics.bias(model, &q, &v, gravity, &mut out);
        errors.add("nle", &out, &joint_space("nle"));
        dynamics.rnea(model, &q, &v, &a, gravity, &mut out);
        errors.add("rnea", &out, &joint_space("rnea"));
        let mut mass = DMatrix::from_element(n, n, f64::NAN);
        dynamics.crba(model, &q, &mut mass);
        errors.add("M", mass.as_slice(), self.mass(&columns, &numbers(&case["M_upper"])).as_slice());
        dynamics.forward(model, &q, &v, &tau, gravity, &mut out).unwrap();
        errors.add("aba", &out, &joint_space("aba"));

        let mut kinematics = Kinematics::new(model);
        kinematics.update_with_velocity(model, &q, &v);
        for (name, golden) in case["frames"].as_object().unwrap() {
            compare_frame(model, &kinematics, &columns, name, golden, errors);
        }
    }

    /// The place in our vectors of each entry of theirs.
    fn columns(&self, model: &Model) -> Vec<usize> {
        let joints = self.document["joints"].as_array().unwrap();
        let mut columns = vec![usize::MAX; joints.len()];
        for (index, joint) in joints.iter().enumerate() {
            let (name, place) = match joint {
                Value::String(name) => (name.as_str(), index),
                joint => (joint["name"].as_str().unwrap(), joint["idx_v"].as_u64().unwrap() as usize),
            };
            columns[place] = model.joint_index(name).unwrap_or_else(|| panic!("no joint {name}"));
        }
        assert_eq!(columns.len(), model.nv(), "number of independent joints");
        columns
    }

    fn mass(&self, columns: &[usize], upper: &[f64]) -> DMatrix<f64> {
        let n = columns.len();
        let mut mass = DMatrix::zeros(n, n);
        let mut entries = upper.iter();
        for i in 0..n {
            for j in i..n {
                let entry = *entries.next().unwrap();
                mass[(columns[i], columns[j])] = entry;
                mass[(columns[j], columns[i])] = entry;
            }
        }
        mass
    }

    /// Lower, upper, velocity and effort limits agree, joint by joint.
    pub(crate) fn compare_limits(&self, model: &Model) {
        let columns = self.columns(model);
        for (key, ours) in [
            ("lower", model.lower()),
            ("upper", model.upper()),
            ("velocity_limit", model.velocity_limit()),
            ("effort_limit", model.effort_limit()),
        ] {
            let theirs = numbers(&self.document[key]);
            assert_eq!(theirs.len(), columns.len(), "{key}");
            for (&column, theirs) in columns.iter().zip(theirs) {
                assert_eq!(ours[column], theirs, "{key} of {}", model.joint_names()[column]);
            }
        }
    }
}

fn compare_frame(
    model: &Model,
    kinematics: &Kinematics,
    columns: &[usize],
    name: &str,
    golden: &Value,
    errors: &mut Errors,
) {
    let frame = model.frame(name).unwrap();
    let pose: Isometry3<f64> = kinematics.pose(model, frame);
    errors.add("p", pose.translation.vector.as_slice(), &numbers(&golden["p"]));
    let rotation = pose.rotation.to_rotation_matrix();
    errors.add("R", rotation.matrix().transpose().as_slice(), &matrix(&golden["R"]).concat());
    for (reference, jacobian_key, velocity_key) in [
        (Reference::LocalWorldAligned, "J_lwa", "v_lwa"),
        (Reference::Local, "J_local", "v_local"),
        (Reference::World, "J_world", "v_world"),
    ] {
        let Some(_) = golden.get(jacobian_key) else { continue };
        let mut jacobian = DMatrix::from_element(6, model.nv(), f64::NAN);
        kinematics.jacobian(model, frame, reference, &mut jacobian);
        let mut theirs = DMatrix::zeros(6, model.nv());
        for (row, entries) in matrix(&golden[jacobian_key]).iter().enumerate() {
            for (&column, entry) in columns.iter().zip(entries) {
                theirs[(row, column)] = *entry;
            }
        }
        errors.add(jacobian_key, jacobian.as_slice(), theirs.as_slice());
        let twist = kinematics.velocity_in(model, frame, reference).vector();
        errors.add(
            velocity_key,
            DVector::from_row_slice(twist.as_slice()).as_slice(),
            &numbers(&golden[velocity_key]),
        );
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|entry| entry.as_f64().unwrap()).collect()
}

fn matrix(value: &Value) -> Vec<Vec<f64>> {
    value.as_array().unwrap().iter().map(numbers).collect()
}
