//! Runs that are equal but for one thing.

use super::cell::{Asked, CellPlan};
use protocol::{Observables, TangentKind};
use rve_server::contact::{ContactTable, Rotations};
use rve_server::definition::{Accuracy, RveOptions};

/// What a run is compared for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Claim {
    /// It asks for nothing; the others of its group are compared with it.
    Plain,
    /// It asks for nothing more, so it must execute what the plain run does.
    Unasked,
    /// It asks with the last increment alone, the next run with all but the last, and the one after that with every increment. Increments
    /// that do not ask must cost what they cost in the plain run, so the differences of the first two add up to no more than that of the
    /// third.
    Last,
    /// It asks with all increments but the last.
    Before,
    /// It asks with every increment.
    Asked,
    /// It asks for other physics: only instructions per force evaluation can be compared.
    Law,
}

protocol::keywords! {
    pub(super) Claim {
        Plain => "plain",
        Unasked => "unasked",
        Last => "asked with the last",
        Before => "asked with all but the last",
        Asked => "asked with all",
        Law => "other law",
    }
}

/// How a run is made.
#[derive(Clone, Debug)]
pub(super) enum Course {
    /// Cells in one process, as a worker solves them.
    Cells(Box<CellPlan>),
    /// `grainspan element` on a test file with `--set KEY=VALUE` and other arguments; `DIR` in them is a folder of the run.
    Element { settings: &'static [&'static str], arguments: &'static [&'static str] },
}

/// A run.
#[derive(Clone, Debug)]
pub(super) struct Case {
    pub(super) name: String,
    pub(super) claim: Claim,
    pub(super) course: Course,
}

/// Names of all groups, in the table and for `--only`.
pub(super) const GROUPS: [&str; 7] =
    ["cell", "lanes", "spheres", "element", "laws", "laws-in-lanes", "laws-of-spheres"];

/// The element test of the group of that name, next to `packing.json`.
pub(super) const ELEMENT_TEST: &str = "packing = 'packing.json'
[contact]
modulus = 1.0e8
stiffness_ratio = 0.5
friction = 0.5
[[path]]
increments = 4
strain = { xx = 0.002, yy = -0.004 }
";

pub(super) const DISCS: &str = include_str!("../../../packings/discs-100.json");
const SPHERES: &str = include_str!("../../../packings/spheres-100.json");

/// The runs of a group, the one first that the others are compared with; in seconds, if they must do.
pub(super) fn group(name: &str, is_quick: bool) -> Vec<Case> {
    let increments = if is_quick { 2 } else { 4 };
    let plan = |packing: &str, contact: ContactTable, cells: u32| CellPlan {
        packing: packing.to_owned(),
        contact,
        options: RveOptions {
            accuracy: if is_quick { Accuracy::Draft } else { Accuracy::Default },
            ..RveOptions::default()
        },
        increments,
        cells,
        tangent: (TangentKind::None, Asked::Never),
        observables: (Observables::NONE, Asked::Never),
    };
    match name {
        "cell" => requests(&plan(DISCS, linear(), 1), &TANGENTS),
        "lanes" => requests(&plan(DISCS, linear(), 8), &TANGENTS[..2]),
        // Valgrind 3.19 does not know an instruction of the network operators of spheres.
        "spheres" => requests(&plan(SPHERES, spheres(), 1), &[TangentKind::Kruyt]),
        "laws" => laws(&plan(DISCS, linear(), 1), &LAWS),
        "laws-in-lanes" => laws(&plan(DISCS, linear(), 8), &LAWS),
        "laws-of-spheres" => laws(&plan(SPHERES, spheres(), 1), &LAWS),
        _ => element(),
    }
}

const TANGENTS: [TangentKind; 4] =
    [TangentKind::TrussLike, TangentKind::TrussLikeSlip, TangentKind::Kruyt, TangentKind::Consistent];

const OBSERVABLES: [(&str, Observables); 7] = [
    ("first Piola stress", Observables::FIRST_PIOLA),
    ("coordination without rattlers", Observables::COORDINATION_NO_RATTLERS),
    ("fabric", Observables::FABRIC),
    ("sliding fraction", Observables::SLIDING_FRACTION),
    ("energy", Observables::ENERGY),
    ("mean rotation", Observables::ROTATION),
    ("all observables", Observables::ALL),
];

/// The plain run, once more, and with each result requested at the end and throughout.
fn requests(plain: &CellPlan, tangents: &[TangentKind]) -> Vec<Case> {
    let case =
        |name: String, claim: Claim, plan: CellPlan| Case { name, claim, course: Course::Cells(Box::new(plan)) };
    let mut cases = vec![
        case("plain".into(), Claim::Plain, plain.clone()),
        case("the same once more".into(), Claim::Unasked, plain.clone()),
    ];
    let times = [(Asked::Last, Claim::Last), (Asked::Before, Claim::Before), (Asked::Every, Claim::Asked)];
    for kind in tangents {
        for (asked, claim) in times {
            let plan = CellPlan { tangent: (*kind, asked), ..plain.clone() };
            cases.push(case(format!("tangent {}", kind.keyword()), claim, plan));
        }
    }
    for (name, wanted) in OBSERVABLES {
        for (asked, claim) in times {
            let plan = CellPlan { observables: (wanted, asked), ..plain.clone() };
            cases.push(case(name.into(), claim, plan));
        }
    }
    cases
}

fn linear() -> ContactTable {
    ContactTable { modulus: Some(1e8), normal_stiffness: None, ..ContactTable::linear(1.0, 0.5, 0.5) }
}

fn spheres() -> ContactTable {
    ContactTable::hertz_mindlin(2.9e10, 0.15, 0.5)
}

/// A change of a contact law.
type Change = (&'static str, Claim, fn(&mut ContactTable));

const LAWS: [Change; 7] = [
    ("cohesion = 0", Claim::Unasked, |law| law.cohesion = 0.0),
    ("density", Claim::Unasked, |law| law.density = 1000.0),
    ("rotations free, said so", Claim::Unasked, |law| law.rotations = Rotations::Free),
    ("cohesion = 1e-9 m", Claim::Law, |law| law.cohesion = 1e-9),
    ("rotations blocked", Claim::Law, |law| law.rotations = Rotations::Blocked),
    ("rolling resistance", Claim::Law, |law| (law.rolling_stiffness, law.rolling_friction) = (1.0, 0.1)),
    ("contact viscosity", Claim::Law, |law| law.damping = 0.5),
];

fn laws(plain: &CellPlan, changes: &[Change]) -> Vec<Case> {
    let case = |name: &str, claim, plan| Case { name: name.into(), claim, course: Course::Cells(Box::new(plan)) };
    let mut cases = vec![case("plain", Claim::Plain, plain.clone())];
    for (name, claim, change) in changes {
        let mut plan = plain.clone();
        change(&mut plan.contact);
        cases.push(case(name, *claim, plan));
    }
    cases
}

/// `grainspan element`: keys at their defaults, and what only flags ask for.
fn element() -> Vec<Case> {
    let case = |name: &str, claim, settings, arguments| Case {
        name: name.into(),
        claim,
        course: Course::Element { settings, arguments },
    };
    vec![
        case("plain", Claim::Plain, &[], &[]),
        case("the same once more", Claim::Unasked, &[], &[]),
        case("contact.cohesion = 0", Claim::Unasked, &["contact.cohesion=0.0"], &[]),
        case("contact.rolling_stiffness = 0", Claim::Unasked, &["contact.rolling_stiffness=0.0"], &[]),
        case("contact.rotations = \"free\"", Claim::Unasked, &["contact.rotations='free'"], &[]),
        case("contact.damping = 0", Claim::Unasked, &["contact.damping=0.0"], &[]),
        case("rve.solver = \"relaxation\"", Claim::Unasked, &["rve.solver='relaxation'"], &[]),
        case("rve.criterion = \"max_force\"", Claim::Unasked, &["rve.criterion='max_force'"], &[]),
        case("path.repeat = 1", Claim::Unasked, &["path.0.repeat=1"], &[]),
        case("--units", Claim::Unasked, &[], &["--units"]),
        case("--tangent truss_like", Claim::Asked, &[], &["--tangent", "truss_like"]),
        case("--contacts", Claim::Last, &[], &["--contacts", "DIR", "--contacts-at", "4"]),
        case("--contacts", Claim::Before, &[], &["--contacts", "DIR", "--contacts-at", "1,2,3"]),
        case("--contacts", Claim::Asked, &[], &["--contacts", "DIR", "--contacts-at", "1,2,3,4"]),
        case(
            "--contacts with fluctuations",
            Claim::Asked,
            &[],
            &["--contacts", "DIR", "--contacts-at", "1,2,3,4", "--fluctuations-from", "0"],
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_group_begins_with_its_plain_run_and_a_request_at_the_end_is_followed_by_its_complement_and_all() {
        for name in GROUPS {
            let cases = group(name, false);
            let claims: Vec<Claim> = cases.iter().map(|case| case.claim).collect();
            assert_eq!(claims.iter().position(|claim| *claim == Claim::Plain), Some(0), "{name}");
            assert_eq!(claims.iter().filter(|claim| **claim == Claim::Plain).count(), 1, "{name}");
            for (place, _) in claims.iter().enumerate().filter(|(_, claim)| **claim == Claim::Last) {
                assert_eq!(claims[place + 1..place + 3], [Claim::Before, Claim::Asked], "{name}");
                assert!(cases[place + 1..place + 3].iter().all(|case| case.name == cases[place].name), "{name}");
            }
        }
    }
}
