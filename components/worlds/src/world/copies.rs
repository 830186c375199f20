//! Copies of an object in a pattern.

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Deserializer};

use super::{Copies, Object};

/// Maximum number of copies of an object.
const MOST: usize = 1000;

/// An object whose numbers are checked during parsing, so that an error has a position.
struct Checked(Object);

impl<'de> Deserialize<'de> for Checked {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let object = Object::deserialize(deserializer)?;
        object.check_numbers().map_err(serde::de::Error::custom)?;
        Ok(Self(object))
    }
}

/// Parses objects and expands `copies` to `NAME_0`, `NAME_1` and so on, x first, then y, then z.
pub(super) fn expanded<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Object>, D::Error> {
    let written = Vec::<Checked>::deserialize(deserializer)?;
    let mut objects = Vec::with_capacity(written.len());
    for Checked(object) in written {
        let Some(Copies { count, spacing }) = object.copies else {
            objects.push(object);
            continue;
        };
        let all = count.iter().try_fold(1_usize, |all, count| all.checked_mul(*count));
        if all.is_none_or(|all| !(1..=MOST).contains(&all)) {
            return Err(serde::de::Error::custom(format!(
                "object \"{}\": `copies.count` is {count:?}, expected numbers from 1 up whose product is at most {MOST}",
                object.name
            )));
        }
        let [roll, pitch, yaw] = object.rpy;
        let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let start = Vector3::from(object.position);
        for number in 0..count.iter().product() {
            let place = [number % count[0], number / count[0] % count[1], number / (count[0] * count[1])];
            let shift = Vector3::from_fn(|axis, _| place[axis] as f64 * spacing[axis]);
            let position = (start + turn * shift).into();
            let name = format!("{}_{number}", object.name);
            objects.push(Object { name, position, copies: None, ..object.clone() });
        }
    }
    Ok(objects)
}
