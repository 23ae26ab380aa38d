//! Where the methods fail, each against a prediction made beforehand: the
//! largest stable steps against the eigenvalues, chatter, extremes of the
//! contact, bad paces, hours at rest, orders of convergence, and the physics
//! that must hold whatever the method.

#[path = "stability/bad_paces.rs"]
mod bad_paces;
#[path = "stability/chatter.rs"]
mod chatter;
#[path = "stability/extremes.rs"]
mod extremes;
#[path = "stability/flight.rs"]
mod flight;
#[path = "stability/forces.rs"]
mod forces;
#[path = "stability/limits.rs"]
mod limits;
#[path = "stability/orders.rs"]
mod orders;
#[path = "stability/rest.rs"]
mod rest;
#[path = "stability/rough.rs"]
mod rough;
#[path = "stability/scenes.rs"]
mod scenes;
#[path = "stability/sliding_events.rs"]
mod sliding_events;
