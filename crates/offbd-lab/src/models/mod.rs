//! Models of contact for scenes, above those of `offbd_core::plant`: a
//! compliant contact, its stiff step, and rolling that creeps.

mod compliant;
mod contact_step;
mod creeping;

pub use compliant::Compliant;
pub use contact_step::ContactStep;
pub use creeping::{Creeping, Give};
