//! The loading-aware variant of the truss-like operator.

use super::contact_stiffness::ContactStiffness;
use super::network_operator::{self, NetworkOperator};
use crate::network::ContactNetwork;

/// As [`super::truss_like::operator`], but a contact that slid during the ramp that led here goes on slipping: its
/// tangential force stays on the Coulomb cone, `d f_t = -friction sign(f_t) d f_n`, whatever the tangential
/// displacement. The flow is not associated, hence the operator is not symmetric. It describes loading on, not reversal.
/// `None` if the network cannot be solved.
pub fn operator(network: &ContactNetwork) -> Option<NetworkOperator> {
    network_operator::solve(network, |contact| {
        if contact.slid {
            ContactStiffness::slipping(contact, network.friction)
        } else {
            ContactStiffness::sticking(contact)
        }
    })
}
