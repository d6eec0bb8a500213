//! A specimen test: the TOML document that `grainspan specimen` runs.

use super::axes::{AXES, axis_of};
use super::profile::ProfileTable;
use super::removal::Region;
use super::stage::{Sheared, Stage};
use crate::contact::ContactTable;
use crate::error::DefinitionError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpecimenTest {
    /// Packing file, relative to this one. Its cell may lean as those of `grainspan pack` do: Y1 points along x and Y2 lies in the plane of x
    /// and y. A periodic axis that leans along a walled one is refused without `straighten`. The packing is repeated `tiles` times.
    pub packing: String,
    /// Repetitions along the axes.
    #[schemars(inner(range(min = 1)))]
    pub tiles: Vec<usize>,
    /// Treatment of the grains at the border.
    #[serde(default)]
    pub cut: Cut,
    /// Contact law; `damping` is a damping ratio of every contact here, `density` the grains' own.
    pub contact: ContactTable,
    /// Axes along which the specimen is periodic (`"x"`, `"y"`, `"z"`) instead of walled.
    #[serde(default)]
    pub periodic: Vec<String>,
    /// Whether periodic axes that lean along a walled one are made upright by a homogeneous shear of the packing, which the first
    /// stage has to bring back to its stress. Otherwise such a packing is refused.
    #[serde(default)]
    pub straighten: bool,
    /// Motion.
    #[serde(default)]
    pub motion: MotionTable,
    /// Walls.
    #[serde(default)]
    pub walls: WallTable,
    /// Regions that lose grains before the first stage, as in [Liu2015] section 3.4.
    #[serde(default)]
    pub region: Vec<Region>,
    /// Shear of layers; `--profiles DIR` writes it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<ProfileTable>,
    /// Stages, one after the other.
    pub stage: Vec<Stage>,
}

/// Which grains of the repeated packing a specimen consists of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Cut {
    /// Every grain of every tile.
    #[default]
    Tiles,
    /// As [Liu2018] copies its frame: tiles joined at their boundary grains, which the outer border keeps on both sides.
    /// Plane packings only.
    Frames,
}

/// The table `[motion]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MotionTable {
    /// Acceleration of gravity, m/s2, one number per axis; none if empty.
    #[schemars(extend("x-unit" = "m/s2"))]
    pub gravity: Vec<f64>,
    /// Coefficient of local damping; 0 for none. It takes this share of every force that does work on a grain: grains fall with the rest of
    /// gravity, and grains that walls drag along bear a part of the shear, the less the slower they move. With periodic sides it acts on the
    /// motion relative to the mean strain.
    #[schemars(extend("x-unit" = "-"))]
    pub local_damping: f64,
    /// Share of the stability limit that a step takes.
    #[schemars(extend("x-unit" = "-"))]
    pub safety: f64,
    /// Step, s; from the stability limit if absent.
    #[schemars(extend("x-unit" = "s", "x-default" = "from the stability limit"))]
    pub step: Option<f64>,
    /// Whether masses are scaled so that all grains have the same stability limit; the unit of time is the step then.
    pub scaled_masses: bool,
}

impl Default for MotionTable {
    fn default() -> Self {
        Self { gravity: Vec::new(), local_damping: 0.7, safety: 0.5, step: None, scaled_masses: true }
    }
}

/// The table `[walls]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WallTable {
    /// Friction of the walls; 0 (default) makes them smooth.
    #[schemars(extend("x-unit" = "-"), range(min = 0.0))]
    pub friction: f64,
    /// Speed of the servo per missing force, relative to the walls' stiffness.
    #[schemars(extend("x-unit" = "-", "x-default" = "0.3"))]
    pub servo_gain: Option<f64>,
    /// Largest strain of one step of a servo-controlled wall.
    #[schemars(extend("x-unit" = "-", "x-default" = "1e-5"))]
    pub largest_strain_per_step: Option<f64>,
    /// Thickness of the layer that `glue` of a stage fixes to a wall: grains whose surface is closer to it than this. 0 (default)
    /// takes the grains that touch it.
    #[schemars(extend("x-unit" = "m"), range(min = 0.0))]
    pub glue_depth: f64,
}

impl SpecimenTest {
    /// Checks every key; `dimension` is that of the packing.
    ///
    /// # Errors
    /// The key and the remedy.
    pub fn validate(&self, dimension: usize) -> Result<(), DefinitionError> {
        let contact = self.contact_without_damping();
        contact.validate().and_then(|()| contact.validate_for(dimension))?;
        contact.refuse_inner_blocked()?;
        if !(0.0..=10.0).contains(&self.contact.damping) {
            return Err(DefinitionError(format!(
                "contact.damping = {} is a damping ratio, 0 to 10",
                self.contact.damping
            )));
        }
        if self.tiles.len() != dimension || self.tiles.iter().any(|count| *count == 0 || *count > 1000) {
            return Err(DefinitionError(format!(
                "tiles = {:?} needs {dimension} whole numbers from 1 to 1000",
                self.tiles
            )));
        }
        if self.cut == Cut::Frames && (dimension == 3 || !self.periodic.is_empty()) {
            return Err(DefinitionError("cut = \"frames\" is for plane specimens without periodic axes".into()));
        }
        let periodic = self.periodic_axes(dimension)?;
        // With walls it is a flow down a slope.
        if periodic[..dimension].iter().all(|one| *one) && self.motion.gravity.iter().any(|gravity| *gravity != 0.0) {
            return Err(DefinitionError(
                "motion.gravity lets grains without walls fall for ever; give one axis walls, or leave gravity out"
                    .into(),
            ));
        }
        self.check_motion(dimension)?;
        self.refuse_without_effect(&periodic[..dimension])?;
        if !(self.walls.friction.is_finite() && self.walls.friction >= 0.0) {
            return Err(DefinitionError(format!(
                "walls.friction = {} must be zero or positive",
                self.walls.friction
            )));
        }
        for (key, value) in
            [("servo_gain", self.walls.servo_gain), ("largest_strain_per_step", self.walls.largest_strain_per_step)]
        {
            if value.is_some_and(|value| !(value.is_finite() && value > 0.0 && value <= 1.0)) {
                let value = value.unwrap_or_default();
                return Err(DefinitionError(format!("walls.{key} = {value} must be above 0 and at most 1")));
            }
        }
        if !(self.walls.glue_depth.is_finite() && self.walls.glue_depth >= 0.0) {
            return Err(DefinitionError(format!(
                "walls.glue_depth = {} must be zero or positive, m",
                self.walls.glue_depth
            )));
        }
        for (number, region) in self.region.iter().enumerate() {
            region
                .validate(dimension)
                .map_err(|reason| DefinitionError(format!("region {}: {reason}", number + 1)))?;
        }
        if self.stage.is_empty() {
            return Err(DefinitionError("at least one [[stage]] is needed".into()));
        }
        let names = || self.stage.iter().map(|stage| &stage.name);
        if let Some(twice) =
            names().enumerate().find(|(number, name)| names().take(*number).any(|other| other == *name))
        {
            return Err(DefinitionError(format!(
                "stage {}: there is a stage '{}' before it; give every stage a name of its own",
                twice.0 + 1,
                twice.1
            )));
        }
        if let Some(profile) = &self.profile {
            profile.validate(dimension, &self.stage.iter().map(|stage| stage.name.as_str()).collect::<Vec<_>>())?;
        }
        let periodic = self.periodic_axes(dimension)?;
        self.stage.iter().enumerate().try_for_each(|(number, stage)| {
            stage
                .validate(dimension, periodic)
                .and_then(|()| self.check_grip(&self.stage[..=number], periodic))
                .map_err(|reason| DefinitionError(format!("stage {}: {reason}", number + 1)))
        })
    }

    /// Refuses keys that change nothing here, `periodic` or not along each axis: whoever sets them expects that they do.
    fn refuse_without_effect(&self, periodic: &[bool]) -> Result<(), DefinitionError> {
        let unused = |reason: String| Err(DefinitionError(reason));
        let walls = &self.walls;
        let keys = [
            ("friction", walls.friction > 0.0),
            ("servo_gain", walls.servo_gain.is_some()),
            ("largest_strain_per_step", walls.largest_strain_per_step.is_some()),
        ];
        if let Some((key, _)) = keys.into_iter().find(|(_, is_given)| *is_given && !periodic.contains(&false)) {
            return unused(format!(
                "walls.{key} is not used: all axes are periodic, and there are no walls; leave it out, or take an axis out of `periodic`"
            ));
        }
        if self.straighten && !(periodic.contains(&true) && periodic.contains(&false)) {
            return unused(
                "straighten is not used: it is for periodic axes that lean along walled ones, and this specimen has only one of both kinds; leave \
                 it out"
                    .into(),
            );
        }
        if walls.glue_depth > 0.0 && self.stage.iter().all(|stage| stage.glue.is_empty()) {
            return unused(
                "walls.glue_depth is not used: no stage has `glue`; leave it out, or name the walls that grip".into(),
            );
        }
        if self.contact.has_tangential_springs() {
            return Ok(());
        }
        let of_stage = self.stage.iter().position(|stage| stage.friction.is_some_and(|friction| friction > 0.0));
        let place = match of_stage {
            Some(number) => format!("stage {}: friction", number + 1),
            None if walls.friction > 0.0 => "walls.friction".to_owned(),
            None => return Ok(()),
        };
        unused(format!(
            "{place} is not used: contact.stiffness_ratio = 0 leaves no tangential springs, and so no friction; leave it out, or give a \
             stiffness_ratio above 0"
        ))
    }

    /// Whether the last of these stages can do what it asks of walls and glued layers.
    fn check_grip(&self, stages: &[Stage], periodic: [bool; 3]) -> Result<(), DefinitionError> {
        let Some(stage) = stages.last() else { return Ok(()) };
        let is_glued = |side: usize| stages.iter().any(|stage| stage.glued_axes().contains(&side));
        for sheared in stage.shear.components() {
            if !periodic[sheared.side] && self.walls.friction == 0.0 && !is_glued(sheared.side) {
                return Err(DefinitionError(format!(
                    "shear.{}: smooth walls slide along the grains; set walls.friction, or glue = [\"{}\"] in this stage or before",
                    sheared.name, AXES[sheared.side]
                )));
            }
        }
        if let Some(sheared) =
            stage.shear.components().into_iter().find(|one| is_glued(one.side) && !periodic[one.along])
        {
            let along = AXES[sheared.along];
            return Err(DefinitionError(format!(
                "shear.{}: the layer glued to the wall would be dragged through the walls along {along}; set periodic = [\"{along}\"]",
                sheared.name
            )));
        }
        let strains_sides = (0..3).any(|axis| periodic[axis] && stage.moves(axis));
        if strains_sides && (0..3).any(is_glued) {
            return Err(DefinitionError(
                "a glued layer is rigid and cannot follow periodic sides that strain; take out glue, or the strain or shear \
                 of the periodic axes"
                    .into(),
            ));
        }
        Ok(())
    }

    /// Components of shear that some stage asks for, in the order of the table's columns.
    pub fn sheared(&self) -> Vec<Sheared> {
        let mut all: Vec<Sheared> = self.stage.iter().flat_map(|stage| stage.shear.components()).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    fn check_motion(&self, dimension: usize) -> Result<(), DefinitionError> {
        let motion = &self.motion;
        let gravity_is_sound = (motion.gravity.is_empty() || motion.gravity.len() == dimension)
            && motion.gravity.iter().all(|value| value.is_finite());
        if !gravity_is_sound {
            return Err(DefinitionError(format!("motion.gravity needs {dimension} numbers, m/s2")));
        }
        if motion.scaled_masses && motion.gravity.iter().any(|value| *value != 0.0) {
            return Err(DefinitionError(
                "motion.gravity needs physical masses: set motion.scaled_masses = false".into(),
            ));
        }
        if !(0.0..1.0).contains(&motion.local_damping) {
            return Err(DefinitionError(format!(
                "motion.local_damping = {} must be at least 0 and below 1",
                motion.local_damping
            )));
        }
        if !(motion.safety > 0.0 && motion.safety < 1.0) {
            return Err(DefinitionError(format!("motion.safety = {} must lie between 0 and 1", motion.safety)));
        }
        if motion.step.is_some_and(|step| !(step.is_finite() && step > 0.0)) {
            return Err(DefinitionError("motion.step must be a positive time, s".into()));
        }
        if motion.scaled_masses && motion.step.is_some() {
            return Err(DefinitionError("motion.step has no meaning with scaled masses; remove it".into()));
        }
        Ok(())
    }

    /// Which axes are periodic.
    ///
    /// # Errors
    /// An axis that does not exist.
    pub fn periodic_axes(&self, dimension: usize) -> Result<[bool; 3], DefinitionError> {
        let mut periodic = [false; 3];
        for name in &self.periodic {
            match axis_of(name) {
                Some(axis) if axis < dimension => periodic[axis] = true,
                _ => {
                    return Err(DefinitionError(format!(
                        "periodic = \"{name}\" is no axis of a specimen of {dimension} dimensions"
                    )));
                }
            }
        }
        Ok(periodic)
    }

    /// The contact table with its viscosity taken out, as periodic cells know it.
    pub fn contact_without_damping(&self) -> ContactTable {
        ContactTable { damping: 0.0, ..self.contact.clone() }
    }
}
