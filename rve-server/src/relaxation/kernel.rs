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
    /// 1 if the pair touched at the last evaluation, else 0. A number, because the kernel computes with it.
    pub(crate) touching: u32,
    /// Evaluations at the Coulomb limit since the counter was last cleared.
    pub(crate) limit_count: u32,
    /// Whether the contact was at the Coulomb limit in most samples of the second half of the ramp.
    pub(crate) slid: bool,
    /// k_n, N/m.
    pub(crate) normal_stiffness: f64,
    /// 1 / k_t, m/N; 0 without tangential stiffness.
    pub(crate) tangential_compliance: f64,
    /// Unit vector from origin to end at the last evaluation, if it touched then.
    pub(crate) direction: [f64; 2],
    /// Tangential force, N.
    pub(crate) tangential_force: f64,
}

impl PairSlot {
    /// Whether the pair touched at the last evaluation.
    pub(crate) fn touches(&self) -> bool {
        self.touching != 0
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

/// Geometry of the touching pairs of one evaluation, in pair order. Working memory of the kernel.
#[derive(Clone, Debug, Default)]
pub(crate) struct Touching {
    pair: Vec<u32>,
    branch: Vec<[f64; 2]>,
    length: Vec<f64>,
    reciprocal: Vec<f64>,
}

impl Touching {
    /// Makes room for the contacts of `count` listed pairs.
    pub(crate) fn reserve(&mut self, count: usize) {
        self.pair.resize(count, 0);
        self.branch.resize(count, [0.0; 2]);
        self.length.resize(count, 0.0);
        self.reciprocal.resize(count, 0.0);
    }
}

/// Evaluates all contacts: updates the histories for the motion since the last call and sums the loads. `touching` has
/// room for all `pairs`.
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
    touching: &mut Touching,
    loads: &mut [LoadSlot],
) -> ContactSums {
    loads.fill(LoadSlot::default());
    // Three passes instead of one: each has a short chain of dependent operations and no branch that depends on the
    // data, so the processor overlaps many pairs. Measured 2x faster than the fused loop; the bits are the same.
    let mut sums = ContactSums::default();
    let contacts = find_touching(grains, images, pairs, touching, &mut sums);
    let Touching { pair: order, branch, length, reciprocal } = touching;
    for ((length, reciprocal), branch) in
        length.iter_mut().zip(reciprocal.iter_mut()).zip(branch.iter()).take(contacts)
    {
        *length = (branch[0] * branch[0] + branch[1] * branch[1]).sqrt();
        *reciprocal = 1.0 / *length;
    }
    let geometry = order.iter().zip(branch.iter()).zip(length.iter().zip(reciprocal.iter()));
    for ((index, branch), (length, reciprocal)) in geometry.take(contacts) {
        load_contact(law, grains, &mut pairs[*index as usize], *branch, *length, *reciprocal, loads, &mut sums);
    }
    sums.contacts = contacts as u32;
    sums
}

/// Lists the touching pairs and lets go of those that touched until now. Returns their number.
fn find_touching(
    grains: &[GrainSlot],
    images: &[[f64; 2]],
    pairs: &mut [PairSlot],
    touching: &mut Touching,
    sums: &mut ContactSums,
) -> usize {
    let mut count = 0;
    for (index, pair) in pairs.iter_mut().enumerate() {
        let (o, e) = (&grains[pair.origin as usize], &grains[pair.end as usize]);
        let image = images[pair.image as usize];
        let branch = [(e.position[0] - o.position[0]) + image[0], (e.position[1] - o.position[1]) + image[1]];
        let range = o.radius + e.radius;
        let apart = branch[0] * branch[0] + branch[1] * branch[1] >= range * range;
        touching.pair[count] = index as u32;
        touching.branch[count] = branch;
        count += usize::from(!apart);
        // One test that hardly ever succeeds, not two of which one is a coin toss.
        if u32::from(apart) & pair.touching != 0 {
            sums.dissipation += opening_loss(pair);
            pair.touching = 0;
            pair.tangential_force = 0.0;
            pair.slid = false;
        }
    }
    count
}

/// Force, history and loads of one touching pair.
#[expect(clippy::too_many_arguments, reason = "the innermost loop's body; a struct would only rename the arguments")]
#[inline(always)]
fn load_contact(
    law: &LinearLaw,
    grains: &[GrainSlot],
    pair: &mut PairSlot,
    branch: [f64; 2],
    length: f64,
    reciprocal: f64,
    loads: &mut [LoadSlot],
    sums: &mut ContactSums,
) {
    let (origin, end) = (pair.origin as usize, pair.end as usize);
    let (o, e) = (&grains[origin], &grains[end]);
    let direction = [branch[0] * reciprocal, branch[1] * reciprocal];
    let overlap = (o.radius + e.radius) - length;
    let arms = [o.radius - 0.5 * overlap, e.radius - 0.5 * overlap];
    let normal_force = -pair.normal_stiffness * (overlap - law.cohesion);
    let limit = law.friction * pair.normal_stiffness * overlap;

    // The branch's own turn is measured as an angle, not as a chord: a rigidly rotating pair then slips by exactly
    // nothing. arcsin by its series; the next term is below rounding for turns under 0.02 rad.
    let sine = pair.direction[0] * direction[1] - pair.direction[1] * direction[0];
    let sine_square = sine * sine;
    let turn = sine * (1.0 + sine_square * (1.0 / 6.0 + sine_square * 0.075));
    let slip = length * turn - (arms[0] * o.spin + arms[1] * e.spin);
    let elastic = pair.tangential_force + law.stiffness_ratio * pair.normal_stiffness * slip;
    let attempt = if pair.touches() { elastic } else { 0.0 };
    let cut = if attempt > limit { limit } else { attempt };
    let tangential_force = if cut < -limit { -limit } else { cut };
    pair.limit_count += u32::from(attempt.abs() >= AT_LIMIT * limit);
    sums.dissipation += tangential_force * (attempt - tangential_force) * pair.tangential_compliance;
    pair.touching = 1;
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
    sums.normal_force += normal_force.abs();
}

/// Tangential energy that is lost when a contact opens before friction has let go of it, J.
fn opening_loss(pair: &PairSlot) -> f64 {
    0.5 * pair.tangential_force * pair.tangential_force * pair.tangential_compliance
}
