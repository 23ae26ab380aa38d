//! Stability of the methods, against predictions: the largest stable steps against the
//! eigenvalues, chatter, extreme contacts, invalid paces, hours at rest, orders of
//! convergence, and physical laws that hold whatever the method.

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
