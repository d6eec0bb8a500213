//! What MGIS reads from a library before it calls: names, types and numbers of a behaviour.
//!
//! A text is a pointer to its first byte; the bytes end with a zero.

use std::ffi::{c_int, c_ushort};

/// Number of the interface between behaviours and MGIS.
const API_VERSION: c_ushort = 1;
/// The entry is a behaviour (and neither a material property nor a model).
const IS_BEHAVIOUR: c_ushort = 1;
/// Types of variables.
const SCALAR: c_int = 0;
const SYMMETRIC: c_int = 1;
const TENSOR: c_int = 3;

/// A text of C as MGIS reads it.
type Text = &'static u8;

macro_rules! text {
    ($value:literal) => {
        &concat!($value, "\0").as_bytes()[0]
    };
}

/// Internal state variables: the number of the state, then the scalars of the header's `grainspan_trial`.
const VARIABLES: usize = 6;
const NAMES: [Text; VARIABLES] = [
    text!("GrainState"),
    text!("VoidRatio"),
    text!("CoordinationNumber"),
    text!("UnbalancedForceRatio"),
    text!("LargestOverlap"),
    text!("VolumeRatio"),
];

macro_rules! exported {
    ($behaviour:literal: $($name:literal: $kind:ty = $value:expr;)*) => {
        $(const _: () = {
            #[unsafe(export_name = concat!($behaviour, "_", $name))]
            #[expect(unsafe_code, reason = "MGIS looks symbols up by these names")]
            static SYMBOL: $kind = $value;
        };)*
    };
}

macro_rules! behaviour {
    ($behaviour:literal, $kind:expr, $kinematic:expr, $gradient:literal, $gradient_type:expr, $text:literal) => {
        exported! { $behaviour:
            "api_version": c_ushort = API_VERSION;
            "mfront_mkt": c_ushort = IS_BEHAVIOUR;
            "mfront_ept": Text = text!($behaviour);
            "mfront_interface": Text = text!("Generic");
            "tfel_version": Text = text!("");
            "unit_system": Text = text!("SI");
            "src": Text = text!("grainspan");
            "author": Text = text!("");
            "date": Text = text!("");
            "validator": Text = text!("");
            "build_id": Text = text!("");
            "description": Text = text!($text);
            "BehaviourType": c_ushort = $kind;
            "BehaviourKinematic": c_ushort = $kinematic;
            // A cell has directions, but they turn with no material frame.
            "SymmetryType": c_ushort = 0;
            "ElasticSymmetryType": c_ushort = 0;
            "requiresStiffnessTensor": c_ushort = 0;
            "requiresThermalExpansionCoefficientTensor": c_ushort = 0;
            "ComputesInternalEnergy": c_ushort = 0;
            "ComputesDissipatedEnergy": c_ushort = 0;
            "UsableInPurelyImplicitResolution": c_ushort = 1;
            "nMainVariables": c_ushort = 1;
            "nGradients": c_ushort = 1;
            "Gradients": [Text; 1] = [text!($gradient)];
            "GradientsTypes": [c_int; 1] = [$gradient_type];
            "nThermodynamicForces": c_ushort = 1;
            "ThermodynamicForces": [Text; 1] = [text!("Stress")];
            "ThermodynamicForcesTypes": [c_int; 1] = [SYMMETRIC];
            "nTangentOperatorBlocks": c_ushort = 2;
            "TangentOperatorBlocks": [Text; 2] = [text!("Stress"), text!($gradient)];
            "nMaterialProperties": c_ushort = 0;
            "nInternalStateVariables": c_ushort = VARIABLES as c_ushort;
            "InternalStateVariables": [Text; VARIABLES] = NAMES;
            "InternalStateVariablesTypes": [c_int; VARIABLES] = [SCALAR; VARIABLES];
            "TemperatureRemovedFromExternalStateVariables": c_ushort = 0;
            "nExternalStateVariables": c_ushort = 0;
            "nParameters": c_ushort = 0;
            "ParametersTypes": [c_int; 1] = [0];
            "nInitializeFunctions": c_ushort = 0;
            "nPostProcessings": c_ushort = 0;
            "nModellingHypotheses": c_ushort = 3;
            "ModellingHypotheses": [Text; 3] =
                [text!("PlaneStrain"), text!("Axisymmetrical"), text!("Tridimensional")];
        }
    };
}

behaviour!("GrainCell", 1, 1, "Strain", SYMMETRIC, "Cell of grains, small strains");
behaviour!("GrainCellFiniteStrain", 2, 3, "DeformationGradient", TENSOR, "Cell of grains, finite strains");
