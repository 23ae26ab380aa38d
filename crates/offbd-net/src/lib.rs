//! What clients and servers of offbd share beside their interfaces: the HTTPS client,
//! compressed bodies, the rest of a refused body, and logs that name each reason once.

pub mod coding;
mod https;
mod reasons;
pub mod unread_body;

pub use https::{HttpsClient, https_client};
pub use reasons::Reasons;
