//! Gain and bias of an actuator: from the elements of its class, then from its own element.

use roxmltree::Node;

use super::attributes::Element;
use super::error::MjcfError;

/// `force = gain * control + bias[0] + bias[1] * length + bias[2] * velocity`, for a fixed gain and an affine
/// bias.
///
/// MuJoCo has one actuator default per class. Each element of `<default>`, and then the actuator itself, sets
/// its values there in the form of a general actuator.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gains {
    pub(crate) gain: f64,
    pub(crate) bias: [f64; 3],
    pub(crate) is_fixed: bool,
    pub(crate) is_affine: bool,
}

impl Gains {
    pub(crate) fn read(actuator: &Element<'_, '_, '_>) -> Result<Self, MjcfError> {
        let mut gains = Self { gain: 1.0, bias: [0.0; 3], is_fixed: true, is_affine: false };
        for node in actuator.elements() {
            let numbers = |name, most| actuator.own_numbers(node, name, most);
            let number = |name| numbers(name, 1).map(|numbers| numbers.first().copied());
            match node.tag_name().name() {
                "general" => gains.general(node, numbers("gainprm", 10)?, &numbers("biasprm", 10)?),
                "motor" => (gains.gain, gains.is_fixed, gains.is_affine) = (1.0, true, false),
                "position" | "intvelocity" => {
                    gains.gain = number("kp")?.unwrap_or(gains.gain);
                    gains.bias[1] = -gains.gain;
                    let damping = number("kv")?.map(|kv| -kv);
                    gains.bias[2] = damping.or(number("dampratio")?).unwrap_or(gains.bias[2]);
                    (gains.is_fixed, gains.is_affine) = (true, true);
                }
                "velocity" => {
                    gains.gain = number("kv")?.unwrap_or(gains.gain);
                    gains.bias = [0.0, 0.0, -gains.gain];
                    (gains.is_fixed, gains.is_affine) = (true, true);
                }
                _ => gains.is_fixed = false,
            }
        }
        Ok(gains)
    }

    fn general(&mut self, node: Node<'_, '_>, gain: Vec<f64>, bias: &[f64]) {
        self.gain = gain.first().copied().unwrap_or(self.gain);
        self.bias.iter_mut().zip(bias).for_each(|(slot, number)| *slot = *number);
        if let Some(kind) = node.attribute("gaintype") {
            self.is_fixed = kind == "fixed";
        }
        if let Some(kind) = node.attribute("biastype") {
            self.is_affine = kind == "affine";
        }
    }
}
