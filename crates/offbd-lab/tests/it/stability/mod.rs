//! Where the methods fail, each against a prediction made beforehand: the
//! largest stable steps against the eigenvalues, chatter, extremes of the
//! contact, bad paces, hours at rest, orders of convergence, and the physics
//! that must hold whatever the method.

mod bad_paces;
mod chatter;
mod extremes;
mod flight;
mod forces;
mod limits;
mod orders;
mod rest;
mod rough;
mod scenes;
mod sliding_events;
