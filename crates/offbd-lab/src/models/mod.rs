//! Contact models for scenes, in addition to those of `offbd_core::plant`: a compliant
//! contact, its stiff step in closed form, rolling with creep, and a quicker step of rolling.

mod compliant;
mod contact_step;
mod creeping;
mod rolling_step;

pub use compliant::Compliant;
pub use contact_step::ContactStep;
pub use creeping::{CreepAndSag, Creeping};
pub use rolling_step::RollingConstants;
