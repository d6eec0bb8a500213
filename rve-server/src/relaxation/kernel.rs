//! The force kernel: all contact forces of one cell, once. Nearly all time is spent here.
//!
//! Pairs are visited in key order and forces are summed in that order, so the bits depend on the contacts alone and not
//! on which non-touching pairs happen to be listed. Nothing allocates. Conventions of one contact: see
//! [`crate::network`].

/// One grain as the kernel sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct GrainSlot {
    /// Centre, m.
    pub(crate) position: [f64; 2],
    /// Rotation since the last evaluation, rad.
    pub(crate) spin: f64,
    /// Radius, m.
    pub(crate) radius: f64,
}

/// What acts on one grain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LoadSlot {
    /// Sum of contact forces, N.
    pub(crate) force: [f64; 2],
    /// Sum of their moments about the centre, N m.
    pub(crate) moment: f64,
}

/// One listed pair and its contact history.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PairSlot {
    /// Origin grain.
    pub(crate) origin: u32,
    /// End grain.
    pub(crate) end: u32,
    /// Row of the table of image translations.
    pub(crate) image: u32,
    /// Evaluations at the Coulomb limit since the counter was last cleared.
    pub(crate) limit_count: u32,
    /// Whether the contact was at the Coulomb limit in most samples of the second half of the ramp.
    pub(crate) slid: bool,
    /// k_n, N/m.
    pub(crate) normal_stiffness: f64,
    /// Unit vector from origin to end at the last evaluation; exactly zero while the pair does not touch.
    pub(crate) direction: [f64; 2],
    /// Tangential force, N.
    pub(crate) tangential_force: f64,
}

impl PairSlot {
    /// Whether the pair touched at the last evaluation.
    pub(crate) fn touches(&self) -> bool {
        self.direction != [0.0, 0.0]
    }
}

/// Constants of the linear law that all contacts share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LinearLaw {
    /// k_t / k_n.
    pub(crate) stiffness_ratio: f64,
    /// Coulomb coefficient.
    pub(crate) friction: f64,
    /// Cohesive overlap C, m.
    pub(crate) cohesion: f64,
}

/// Sums over all contacts of one evaluation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ContactSums {
    /// Number of touching pairs.
    pub(crate) contacts: u32,
    /// Sum of |f_n|, N.
    pub(crate) normal_force: f64,
    /// Work lost to friction during the motion since the last evaluation, J.
    pub(crate) dissipation: f64,
}

/// A contact counts as being at the Coulomb limit from this share of the limit on. The relaxation breathes a little, so
/// a contact that slides steadily is often a hair below the limit at the moment of evaluation.
pub(crate) const AT_LIMIT: f64 = 1.0 - 1e-3;

/// Evaluates all contacts: updates the histories for the motion since the last call and sums the loads.
///
/// The law is [Argilaga2018] eqs. A.4 to A.7 with the contact point on the branch (alpha = 1/2):
/// `f_n = -k_n (h - C)`, `df_t = k_t [db.t - (l_O dtheta_O + l_E dtheta_E)]`. Erratum: the paper gives no tension bound
/// and no friction limit for cohesive contacts; used here are `|f_t| <= mu (-f_n + k_n C)`, which equals `mu k_n h`, and
/// loss of contact at `f_n > k_n C`, which is `h < 0`.
pub(crate) fn evaluate(
    law: &LinearLaw,
    grains: &[GrainSlot],
    images: &[[f64; 2]],
    pairs: &mut [PairSlot],
    loads: &mut [LoadSlot],
) -> ContactSums {
    loads.fill(LoadSlot::default());
    let mut sums = ContactSums::default();
    for pair in pairs {
        let (origin, end) = (pair.origin as usize, pair.end as usize);
        let (o, e, image) = (grains[origin], grains[end], images[pair.image as usize]);
        let branch = [(e.position[0] - o.position[0]) + image[0], (e.position[1] - o.position[1]) + image[1]];
        let range = o.radius + e.radius;
        let square = branch[0] * branch[0] + branch[1] * branch[1];
        if square >= range * range {
            if pair.touches() {
                sums.dissipation += opening_loss(law, pair);
                pair.direction = [0.0, 0.0];
                pair.tangential_force = 0.0;
                pair.slid = false;
            }
            continue;
        }
        let length = square.sqrt();
        let scale = 1.0 / length;
        let direction = [branch[0] * scale, branch[1] * scale];
        let overlap = range - length;
        let arms = [o.radius - 0.5 * overlap, e.radius - 0.5 * overlap];
        let normal_force = -pair.normal_stiffness * (overlap - law.cohesion);
        let limit = law.friction * pair.normal_stiffness * overlap;
        let tangential_stiffness = law.stiffness_ratio * pair.normal_stiffness;

        // The branch's own turn is measured as an angle, not as a chord: a rigidly rotating pair then slips by exactly
        // nothing. arcsin by its series; the next term is below rounding for turns under 0.02 rad.
        let sine = pair.direction[0] * direction[1] - pair.direction[1] * direction[0];
        let sine_square = sine * sine;
        let turn = sine * (1.0 + sine_square * (1.0 / 6.0 + sine_square * 0.075));
        let slip = length * turn - (arms[0] * o.spin + arms[1] * e.spin);
        let attempt = if pair.touches() { pair.tangential_force + tangential_stiffness * slip } else { 0.0 };
        let tangential_force = attempt.max(-limit).min(limit);
        if attempt.abs() >= AT_LIMIT * limit {
            pair.limit_count += 1;
            if attempt != tangential_force {
                sums.dissipation += tangential_force * (attempt - tangential_force) / tangential_stiffness;
            }
        }
        pair.direction = direction;
        pair.tangential_force = tangential_force;

        let force = [
            normal_force * direction[0] - tangential_force * direction[1],
            normal_force * direction[1] + tangential_force * direction[0],
        ];
        let on_origin = &mut loads[origin];
        on_origin.force[0] += force[0];
        on_origin.force[1] += force[1];
        on_origin.moment += arms[0] * tangential_force;
        let on_end = &mut loads[end];
        on_end.force[0] -= force[0];
        on_end.force[1] -= force[1];
        on_end.moment += arms[1] * tangential_force;
        sums.contacts += 1;
        sums.normal_force += normal_force.abs();
    }
    sums
}

/// Tangential energy that is lost when a contact opens before friction has let go of it, J.
fn opening_loss(law: &LinearLaw, pair: &PairSlot) -> f64 {
    if pair.tangential_force == 0.0 {
        return 0.0;
    }
    let stiffness = law.stiffness_ratio * pair.normal_stiffness;
    0.5 * pair.tangential_force * pair.tangential_force / stiffness
}
