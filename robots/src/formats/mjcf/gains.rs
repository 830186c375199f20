//! Gain and bias of an actuator: from the elements of its class, then from its own element.

use roxmltree::Node;

use super::attributes::Element;
use super::error::MjcfError;
use super::schema::ACTUATORS;

/// `force = gain * control + bias[0] + bias[1] * length + bias[2] * velocity`, for a fixed gain and an affine
/// bias.
///
/// MuJoCo has one actuator default per class. Each element of `<default>`, and then the actuator itself, sets
/// its values there in the form of a general actuator. A `<general>` starts from the values of its class. Any
/// other element starts from values of its own kind, or from values of a `<general>` with a fixed gain. If
/// its class has neither, it uses the nearest enclosing class that does, otherwise MuJoCo's defaults.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gains {
    pub(crate) gain: f64,
    pub(crate) bias: [f64; 3],
    pub(crate) is_fixed: bool,
    pub(crate) is_affine: bool,
    /// Index in [`ACTUATORS`] of the kind of the last element; `None` before the first.
    kind: Option<usize>,
}

/// Index of general actuators in [`ACTUATORS`].
const GENERAL: Option<usize> = Some(0);

impl Gains {
    const DEFAULT: Self = Self { gain: 1.0, bias: [0.0; 3], is_fixed: true, is_affine: false, kind: None };

    pub(crate) fn read(actuator: &Element<'_, '_, '_>) -> Result<Self, MjcfError> {
        let (mut gains, mut class) = (Self::DEFAULT, None);
        // values of the enclosing classes, outermost first
        let mut around: Vec<Self> = Vec::new();
        for node in actuator.elements() {
            if class.replace(node.parent()).is_some_and(|class| class != node.parent()) {
                around.push(gains);
            }
            let tag = node.tag_name().name();
            let kind = ACTUATORS.iter().position(|known| *known == tag);
            if kind != GENERAL && !gains.suit(kind) {
                gains = around.iter().rev().find(|gains| gains.suit(kind)).copied().unwrap_or(Self::DEFAULT);
            }
            gains.kind = kind;
            let numbers = |name, most| actuator.own_numbers(node, name, most);
            let number = |name| numbers(name, 1).map(|numbers| numbers.first().copied());
            match tag {
                "general" => gains.general(node, numbers("gainprm", 10)?, &numbers("biasprm", 10)?),
                "motor" => gains = Self { kind, ..Self::DEFAULT },
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

    /// Returns `true` if an element of this kind starts from these values.
    fn suit(&self, kind: Option<usize>) -> bool {
        self.kind.is_none() || self.kind == kind || self.kind == GENERAL && self.is_fixed
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
