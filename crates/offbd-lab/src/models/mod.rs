//! Contact models for scenes, in addition to those of `offbd_core::plant`: a compliant
//! contact, its stiff step in closed form, and rolling with creep.

mod compliant;
mod contact_step;
mod creeping;

pub use compliant::Compliant;
pub use contact_step::ContactStep;
pub use creeping::{CreepAndSag, Creeping};
