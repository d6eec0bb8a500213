//! PSTLO: the prestressed truss-like operator of [Argilaga2018] eqs. 22-23 and appendix B.

use super::contact_stiffness::ContactStiffness;
use super::network_operator::{self, NetworkOperator};
use crate::network::ContactNetwork;

/// The elastic operator of the frozen network: every contact sticks, prestress and grain rotations included. `None` if
/// the network cannot be solved.
pub fn operator(network: &ContactNetwork) -> Option<NetworkOperator> {
    network_operator::solve(network, ContactStiffness::sticking)
}
