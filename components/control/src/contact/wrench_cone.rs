//! Limits of the total wrench of a sole.

with_defaults! {
    /// Limits of the wrench that the world exerts on a sole: the force `f`, and the torque `t` about the
    /// origin of the sole's frame, both in the axes of this frame:
    ///
    /// ```text
    /// min_force <= f_z <= max_force                                    N
    /// |f_x|, |f_y| <= mu f_z                                           mu = friction / sqrt(2)
    /// |t_x| <= Y f_z,   |t_y| <= X f_z                                 centre of pressure in 2 X by 2 Y
    /// |t_z| <= max_yaw                                                 Nm
    /// -mu (X + Y) f_z + |Y f_x - mu t_x| + |X f_y - mu t_y|  <=  t_z   yaw torque of the same sole
    ///  mu (X + Y) f_z - |Y f_x + mu t_x| - |X f_y + mu t_y|  >=  t_z
    /// ```
    ///
    /// Forces at the four corners of the rectangle, each within its friction pyramid, sum to exactly these
    /// wrenches. Limits with the sole's own sides and friction are therefore redundant. Use this type to
    /// tighten the limits at the corners: a smaller rectangle or friction than the contact's, a minimum force
    /// that keeps the foot loaded, a maximum force of the whole foot, or a maximum yaw torque. Caron, Pham
    /// and Nakamura, *Stability of surface contacts for humanoid robots: closed-form formulae of the contact
    /// wrench for rectangular support areas*, ICRA 2015.
    ///
    /// ```
    /// use motorium_control::inverse_dynamics::WrenchCone;
    ///
    /// let cone = WrenchCone { sides: [0.2, 0.1], friction: 0.7, min_force: 20.0, ..WrenchCone::default() };
    /// // 100 N, 4 cm ahead of the middle
    /// assert!(cone.excess(&[0.0, 0.0, 100.0, 0.0, -4.0, 0.0]) <= 0.0);
    /// // 6 cm to the side: it tips
    /// assert!(cone.excess(&[0.0, 0.0, 100.0, 6.0, 0.0, 0.0]) > 0.0);
    /// ```
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct WrenchCone;

    /// Sides `2 X` and `2 Y` of the rectangle along x and y, centred at the origin of the frame \[m\].
    pub sides: [f64; 2] = [0.2, 0.1];
    /// Coefficient of friction. Default 0.6.
    pub friction: f64 = 0.6;
    /// Minimum normal force of the whole sole \[N\]. Default 0. The limit is relaxed if constraints conflict,
    /// and while the contact is lifted.
    pub min_force: f64 = 0.0;
    /// Maximum normal force of the whole sole \[N\]. Default infinite.
    pub max_force: f64 = f64::INFINITY;
    /// Maximum torque about the normal \[Nm\]. Default infinite.
    pub max_yaw: f64 = f64::INFINITY;
}

impl WrenchCone {
    /// Number of rows.
    pub(crate) const ROWS: usize = 18;

    /// Returns the coefficients of row `row` for the wrench, force then torque, and the row's lower and upper
    /// bound.
    pub(crate) fn row(&self, row: usize) -> ([f64; 6], f64, f64) {
        let [x, y] = self.sides.map(|side| 0.5 * side);
        let mu = self.friction * std::f64::consts::FRAC_1_SQRT_2;
        let sign = |bit: usize| if row >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let below = |coefficients| (coefficients, f64::NEG_INFINITY, 0.0);
        match row {
            0..4 => {
                let [fx, fy] = if row < 2 { [sign(0), 0.0] } else { [0.0, sign(0)] };
                below([fx, fy, -mu, 0.0, 0.0, 0.0])
            }
            4..6 => below([0.0, 0.0, -y, sign(0), 0.0, 0.0]),
            6..8 => below([0.0, 0.0, -x, 0.0, sign(0), 0.0]),
            8..16 => {
                // turn: about the normal, or against it
                let (one, other, turn) = (sign(0), sign(1), sign(2));
                let mixed = turn * mu;
                below([one * y, other * x, -mu * (x + y), one * mixed, other * mixed, turn])
            }
            16 => ([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], self.min_force, self.max_force),
            _ => ([0.0, 0.0, 0.0, 0.0, 0.0, 1.0], -self.max_yaw, self.max_yaw),
        }
    }

    /// Returns the largest excess of a wrench, force \[N\] then torque \[Nm\], over any limit. The result is
    /// at most 0 if all limits are met.
    pub fn excess(&self, wrench: &[f64; 6]) -> f64 {
        (0..Self::ROWS).fold(f64::NEG_INFINITY, |most, row| {
            let (coefficients, least, largest) = self.row(row);
            let value: f64 = coefficients.iter().zip(wrench).map(|(c, w)| c * w).sum();
            most.max(value - largest).max(least - value)
        })
    }
}
