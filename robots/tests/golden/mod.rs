//! Golden vectors: reading them and comparing a model with them.

mod compare;

use motorium_robots::Model;
use nalgebra::{DMatrix, Vector3};
use serde_json::Value;

/// One JSON file of golden vectors.
pub(crate) struct Golden {
    document: Value,
}

/// Largest error of each quantity, relative to the largest entry of that quantity in its case.
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
        // If everything is zero, a rounding of 1e-15 is not an infinite error: compare with one instead.
        let error = worst / if scale > 1e-6 { scale } else { 1.0 };
        match self.0.iter_mut().find(|(name, _)| *name == what) {
            Some((_, most)) => *most = most.max(error),
            None => self.0.push((what, error)),
        }
    }

    /// Fails and names the quantity if an error exceeds its bound. `loose` applies to forward dynamics.
    pub(crate) fn stay_below(&self, bound: f64, loose: f64) {
        for (what, error) in &self.0 {
            let bound = if what.starts_with("aba") { loose } else { bound };
            assert!(*error <= bound, "{what} is off by {error:.1e} relative, more than {bound:.0e}");
        }
    }

    /// Returns one line with the largest error overall and of each quantity.
    pub(crate) fn summary(&self) -> String {
        let each: Vec<_> = self.0.iter().map(|(what, error)| format!("{what} {error:.1e}")).collect();
        each.join(", ")
    }
}

impl Golden {
    pub(crate) fn parse(text: &str) -> Self {
        Self::from_document(serde_json::from_str(text).unwrap())
    }

    pub(crate) fn from_document(document: Value) -> Self {
        Self { document }
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

    /// Returns the position in our vectors of each entry of theirs.
    fn columns(&self, model: &Model) -> Vec<usize> {
        let joints = self.document["joints"].as_array().unwrap();
        let mut columns = vec![usize::MAX; model.nv()];
        let offset = model.nv() - model.joint_count();
        for (index, joint) in joints.iter().enumerate() {
            let (name, place) = match joint {
                Value::String(name) => (name.as_str(), index),
                joint => (joint["name"].as_str().unwrap(), joint["idx_v"].as_u64().unwrap() as usize),
            };
            if name == "root_joint" && offset == 6 {
                (0..6).for_each(|entry| columns[place + entry] = entry);
            } else {
                let index = model.joint_index(name).unwrap_or_else(|| panic!("no joint {name}"));
                columns[place] = offset + index;
            }
        }
        assert!(columns.iter().all(|column| *column < model.nv()), "number of independent joints");
        columns
    }

    /// Returns our configuration of a case.
    fn configuration(&self, model: &Model, case: &Value) -> Vec<f64> {
        let golden = numbers(&case["q"]);
        let mut q = vec![0.0; model.nq()];
        let offset = model.nq() - model.joint_count();
        q[..offset].copy_from_slice(&golden[..offset]);
        for (index, name) in model.joint_names().iter().enumerate() {
            q[offset + index] = match &case["joint_positions"] {
                Value::Object(by_name) => by_name[name].as_f64().unwrap(),
                _ => {
                    let names = self.document["joints"].as_array().unwrap();
                    golden[names.iter().position(|joint| joint.as_str() == Some(name)).unwrap()]
                }
            };
        }
        q
    }

    /// Returns our configuration in Pinocchio's layout and the golden file's order of joints.
    fn in_their_order(&self, model: &Model, q: &[f64]) -> Vec<f64> {
        let ours = model.to_pinocchio(q);
        let mut theirs = vec![f64::NAN; ours.len()];
        let offset = model.nq() - model.joint_count();
        theirs[..offset].copy_from_slice(&ours[..offset]);
        let mut from = offset;
        for name in model.joint_names() {
            let joint = self.document["joints"].as_array().unwrap();
            let joint = joint.iter().find(|joint| joint["name"].as_str() == Some(name)).unwrap();
            let (to, count) =
                (joint["idx_q"].as_u64().unwrap() as usize, joint["nq"].as_u64().unwrap() as usize);
            theirs[to..to + count].copy_from_slice(&ours[from..from + count]);
            from += count;
        }
        theirs
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

/// Returns a matrix with their columns in our order.
fn arrange_matrix(columns: &[usize], rows: &Value) -> DMatrix<f64> {
    let rows = matrix(rows);
    let mut arranged = DMatrix::zeros(rows.len(), columns.len());
    for (row, entries) in rows.iter().enumerate() {
        for (&column, entry) in columns.iter().zip(entries) {
            arranged[(row, column)] = *entry;
        }
    }
    arranged
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|entry| entry.as_f64().unwrap()).collect()
}

fn matrix(value: &Value) -> Vec<Vec<f64>> {
    value.as_array().unwrap().iter().map(numbers).collect()
}
